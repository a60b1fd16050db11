import pytest
import torch

from insonify_training import losses
from insonify_training.ceiling import oracle
from insonify_training.discriminator import PatchDiscriminator
from insonify_training.networks import Norm, fold, freeze, make
from insonify_training.quality import psnr_db, ssim


@pytest.mark.parametrize("norm", ["none", "instance", "batch"])
@pytest.mark.parametrize("name", ["stride8", "stride4", "unet4"])
def test_a_folded_network_equals_the_frozen_one(name, norm):
    torch.manual_seed(1)
    network = make(name, 4, norm)
    # The coarsest maps need more than a pixel: a single one has no variance.
    size = max(64, network.padding_multiple)
    for _ in range(3):
        network(torch.rand(2, 4, size, size))
    freeze(network.eval())
    folded = fold(network)
    assert not any(isinstance(m, Norm) for m in folded.modules())
    x = torch.rand(1, 4, size, 2 * size)
    with torch.no_grad():
        y = network(x)
        torch.testing.assert_close(folded(x), y, atol=1e-4, rtol=1e-4)
    assert y.shape == (1, 1, size, 2 * size)


def test_frozen_statistics_treat_a_crop_like_the_whole_picture():
    torch.manual_seed(2)
    network = make("stride8", 4, "instance").eval()
    x = torch.rand(1, 4, 768, 768)
    crop = x[..., 128:640, 128:640]
    for frozen, same in ((True, True), (False, False)):
        freeze(network, frozen)
        with torch.no_grad():
            whole, part = network(x)[..., 128:640, 128:640], network(crop)
        # The middle is farther from the crop's border than the receptive field.
        inner = (whole - part)[..., 240:272, 240:272].abs().max()
        assert (inner < 1e-5) == same


def test_statistics_are_the_mean_of_all_inputs():
    norm = Norm(3, "instance")
    norm.every, norm.momentum = 1, 0.0
    x = torch.randn(4, 2, 3, 8, 8) * 3 + 1
    for one in x:
        norm(one)
    torch.testing.assert_close(norm.mean, x.mean((0, 1, 3, 4)))
    torch.testing.assert_close(norm.variance, x.var((3, 4), unbiased=False).mean((0, 1)))


def test_the_discriminator_has_four_convolutions_and_judges_patches():
    discriminator = PatchDiscriminator(4, 8)
    assert len(discriminator.layers) == 4
    assert discriminator(torch.rand(2, 4, 64, 64), torch.rand(2, 1, 64, 64)).shape == (2, 1, 14, 14)


def test_rates_and_weights_follow_their_schedules():
    weights = [losses.gan_weight(step, 1.0, 10, 5) for step in range(20)]
    assert weights[:10] == [0.0] * 10 and weights[10:15] == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0]) and weights[19] == 1.0
    rates = [losses.falling(step, 100, 1.0, 0.5) for step in (0, 50, 75, 99)]
    assert rates == pytest.approx([1.0, 1.0, 0.5, 0.02])


def test_soft_clip_has_a_gradient_outside():
    y = torch.tensor([-1.0, 0.5, 2.0], requires_grad=True)
    losses.soft_clip(y).sum().backward()
    assert y.grad.tolist() == pytest.approx([0.05, 1.0, 0.05])


def test_patch_histograms_depend_on_levels_and_not_on_places():
    torch.manual_seed(2)
    target = torch.rand(2, 1, 64, 96)
    shuffled = target.clone()
    patch = target[0, 0, 32:, 64:].reshape(-1)
    shuffled[0, 0, 32:, 64:] = patch[torch.randperm(patch.numel())].reshape(32, 32)
    assert losses.l1(shuffled, target) > 0.02
    assert losses.patch_histogram(shuffled, target, 0) < 1e-7
    # Detected by patches that straddle it.
    assert losses.patch_histogram(shuffled, target, 16) > 1e-4
    # A uniform shift counts in full; a smooth picture has different levels than speckle of equal mean.
    assert abs(losses.patch_histogram(target + 0.25, target, 3).item() - 0.25) < 1e-6
    assert losses.patch_histogram(torch.full_like(target, 0.5), target, 0) > 0.2


def test_dissimilarity_falls_towards_the_target():
    torch.manual_seed(3)
    target = torch.rand(2, 1, 48, 40)
    assert abs(losses.dissimilarity(target, target)) < 1e-6
    # As `ssim`, except for the rounding.
    other = 0.6 * target + 0.3
    assert losses.dissimilarity(other, target).item() == pytest.approx(1 - ssim(other, target, torch.ones_like(target)).mean().item(), abs=1e-3)
    guess = torch.full_like(target, 0.5, requires_grad=True)
    before = losses.dissimilarity(guess, target)
    before.backward()
    assert losses.dissimilarity(guess - 2e3 * guess.grad, target) < before - 0.05


def test_an_oracle_uses_its_knowledge():
    torch.manual_seed(4)
    hq = torch.rand(1, 1, 120, 90)
    mask = torch.ones_like(hq)
    # If LQ equals HQ, nothing is missing; if it is noise, only the blurred picture remains, and a finer one says more.
    assert (oracle(hq, hq, mask, 4) - hq).abs().max() < 1e-4
    noise = torch.rand_like(hq)
    errors = [(oracle(noise, hq, mask, sigma) - hq).abs().mean() for sigma in (2, 8)]
    assert 0.05 < errors[0] < errors[1]


def test_quality_of_known_pictures():
    x = torch.rand(2, 1, 32, 32)
    everywhere = torch.ones_like(x)
    assert ssim(x, x, everywhere).tolist() == pytest.approx([1.0, 1.0])
    grey = torch.full((1, 1, 16, 16), 100 / 255)
    everywhere = torch.ones_like(grey)
    assert psnr_db(grey, grey + 10 / 255, everywhere).item() == pytest.approx(28.13, abs=0.01)
    # For constants only the means differ: (2ab + c1) / (a² + b² + c1).
    a, b, c1 = 100.0, 110.0, 2.55**2
    assert ssim(grey, grey + 10 / 255, everywhere).item() == pytest.approx((2 * a * b + c1) / (a * a + b * b + c1), abs=1e-4)
    # The outside doesn't count, even if it is black in both.
    mask = (torch.arange(16) < 8).float().expand(1, 1, 16, 16)
    half = torch.where(mask > 0, grey + 10 / 255, grey)
    assert psnr_db(half, grey, mask).item() == pytest.approx(28.13, abs=0.01)
    assert psnr_db(half, grey, everywhere).item() == pytest.approx(28.13 + 3.01, abs=0.01)
    assert ssim(half, grey, mask).item() < ssim(half, grey, everywhere).item() - 1e-4
