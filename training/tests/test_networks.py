import pytest
import torch
import torch.nn.functional as F

from insonify_training import losses
from insonify_training.discriminator import PatchDiscriminator
from insonify_training.networks import Norm, StemNet, fold, freeze, make, tent
from insonify_training.quality import psnr_db, ssim


@pytest.mark.parametrize("norm", ["none", "instance"])
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


def test_the_tent_interpolates_between_cells():
    for side in (2, 4, 8):
        # A slope over cells becomes a slope over pixels; the outermost cells see zeros beyond.
        cells = (torch.arange(6.0)[:, None] * 2 + torch.arange(6.0)).view(1, 1, 6, 6)
        made = F.pixel_shuffle(F.conv2d(cells, tent(side), padding=1), side)[0, 0, side:-side, side:-side]
        assert torch.allclose(made.diff(dim=0), torch.tensor(2 / side), atol=1e-5)
        assert torch.allclose(made.diff(dim=1), torch.tensor(1 / side), atol=1e-5)


def test_a_new_stem_network_keeps_half_of_the_image():
    torch.manual_seed(6)
    network = StemNet(4, 8, (8, 8))
    for parameter in (network.head[0].weight, network.reduce[0].weight, network.reduce[0].bias):
        parameter.data.zero_()
    network.head[0].bias.data[: network.shapes[0]] = 0.1
    x = torch.rand(1, 4, 32, 32)
    assert torch.allclose(network(x), 0.1 + 0.5 * x[:, :1], atol=1e-6)


def test_statistics_are_the_mean_of_all_inputs():
    norm = Norm(3)
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


def test_soft_clip_has_a_gradient_outside():
    y = torch.tensor([-1.0, 0.5, 2.0], requires_grad=True)
    losses.soft_clip(y).sum().backward()
    assert y.grad.tolist() == pytest.approx([0.05, 1.0, 0.05])


def test_dissimilarity_falls_towards_the_target():
    torch.manual_seed(3)
    target = torch.rand(2, 1, 48, 40)
    assert abs(losses.dissimilarity(target, target)) < 1e-6
    # As `ssim`, except for the rounding.
    other = 0.6 * target + 0.3
    assert losses.dissimilarity(other, target, every=1).item() == pytest.approx(1 - ssim(other, target, torch.ones_like(target)).mean().item(), abs=1e-3)
    guess = torch.full_like(target, 0.5, requires_grad=True)
    before = losses.dissimilarity(guess, target)
    before.backward()
    assert losses.dissimilarity(guess - 2e3 * guess.grad, target) < before - 0.05


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


def test_a_share_of_the_image_is_kept_in_evaluation_alone():
    torch.manual_seed(3)
    network = make("stride8", 2, "none")
    x = torch.rand(1, 2, 64, 64)
    with torch.no_grad():
        trained = network(x)
        network.share = 0.25
        torch.testing.assert_close(network(x), trained)
        kept = 0.75 * trained + 0.25 * x[:, :1]
        torch.testing.assert_close(network.eval()(x), kept)
        folded = fold(network)
        assert folded.share == 0
        torch.testing.assert_close(folded(x), kept)
