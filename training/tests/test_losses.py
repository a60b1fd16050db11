"""Losses and patch measures, compared with NumPy."""

import numpy as np
import pytest
import torch

from insonify_training.losses import discriminator_hinge, dissimilarity, generator_hinge, grid, patch_divergence, soft_histogram
from insonify_training.patches import BINS, PATCH, PSEUDO_COUNT, patches
from insonify_training.quality import pkl, similarity_map


def picture(seed, side=2 * PATCH, spread=1.0):
    generator = torch.Generator().manual_seed(seed)
    return 0.5 + spread * (torch.rand(2, 1, side, side, generator=generator) - 0.5)


def test_patches_equal_numpy_slices():
    of = picture(1, 3 * PATCH)
    cut = patches(of, 5)
    assert cut.shape == (2 * 2 * 2, PATCH * PATCH)
    expected = of[1, 0, 5 + PATCH : 5 + 2 * PATCH, 5 : 5 + PATCH]
    assert torch.equal(cut[4 + 2].view(PATCH, PATCH), expected)


def test_moved_levels_within_a_patch_cost_nothing():
    a = picture(1)
    b = a.clone()
    b[..., :PATCH, :PATCH] = b[..., :PATCH, :PATCH].flip(-1)
    assert patch_divergence(a, b, 0) == pytest.approx(0, abs=1e-7)
    assert patch_divergence(a, b, PATCH // 2) > 1e-3


def test_a_level_is_divided_between_the_two_nearest_bins():
    levels = torch.tensor([[0.0, 0.5 / BINS, 0.75 / BINS, 1.0]])
    counts = soft_histogram(levels)[0] * (4 + BINS * PSEUDO_COUNT) - PSEUDO_COUNT
    expected = torch.zeros(BINS)
    expected[0], expected[1], expected[-1] = 2.75, 0.25, 1.0
    assert torch.allclose(counts, expected, atol=1e-5)


def test_divergence_falls_along_its_gradient_and_detects_smoothing():
    target, output = picture(1), picture(2, spread=0.3).requires_grad_()
    before = patch_divergence(output, target, 3)
    assert before > 4 * patch_divergence(picture(2), target, 3)
    before.backward()
    after = patch_divergence(output.detach() - 20 * output.grad, target, 3)
    assert after < 0.98 * before


def test_black_patches_are_ignored():
    target = picture(1)
    target[..., :PATCH] = 0
    assert patch_divergence(target, target, 0) == pytest.approx(0, abs=1e-7)
    assert patch_divergence(target, torch.zeros_like(target), 0) == 0
    half = patch_divergence(picture(2, spread=0.5), target, 0)
    assert half == pytest.approx(float(patch_divergence(picture(2, spread=0.5)[..., PATCH:], target[..., PATCH:], 0)))


def test_the_hinge_is_0_beyond_the_margins_alone():
    far, near = torch.tensor([1.5, 3.0]), torch.tensor([0.25, 0.75])
    assert discriminator_hinge(far, -far) == 0
    assert discriminator_hinge(near, -near) == pytest.approx(0.5) and discriminator_hinge(-far, far) == pytest.approx(3.25)
    assert generator_hinge(near) == pytest.approx(-0.5)


def test_pkl_equals_numpys():
    output, target = picture(3, spread=0.6), picture(4)
    mask = torch.ones_like(target)
    mask[..., :PATCH, :PATCH] = 0
    expected = []
    for o, t, m in zip(output.numpy()[:, 0], target.numpy()[:, 0], mask.numpy()[:, 0]):
        each = []
        for y in (0, PATCH):
            for x in (0, PATCH):
                cut = np.s_[y : y + PATCH, x : x + PATCH]
                if m[cut].mean() < 0.5:
                    continue
                count = lambda p: np.bincount(np.minimum(np.round(p[cut] * 255).astype(int).ravel() * BINS // 255, BINS - 1), minlength=BINS)
                q, p = (c / c.sum() for c in (count(o) + PSEUDO_COUNT, count(t) + PSEUDO_COUNT))
                each.append((p * np.log(p / q)).sum())
        expected.append(np.mean(each))
    assert pkl(output, target, mask).numpy() == pytest.approx(expected, rel=1e-5)


def test_the_dissimilarity_is_that_of_every_fourth_window():
    a, b = picture(5), picture(6)
    whole = similarity_map(255 * a, 255 * b)
    for offset in (0, 3):
        expected = 1 - whole[..., offset::4, offset::4].mean()
        assert dissimilarity(a, b, offset) == pytest.approx(float(expected), abs=1e-5)
    assert dissimilarity(a, b, 1, every=1) == pytest.approx(float(1 - whole[..., 1:, 1:].mean()), abs=1e-5)


def test_a_static_pattern_is_detected_and_grain_is_not():
    target = picture(1, 128)
    pattern = torch.zeros(1, 1, 8, 8)
    pattern[..., 2, 3] = 1.0
    still = target + 0.1 * pattern.repeat(1, 1, 16, 16)
    # One pixel of 64 is brighter by 0.1.
    assert grid(still, target) == pytest.approx(0.1 * (1 / 64 * 63 / 64) ** 0.5, rel=1e-3)
    assert grid(target + 0.1, target) == pytest.approx(0, abs=2e-5)
    # Equal noise, of which a 16th of the power stands still by chance.
    noise = 0.1 * (picture(2, 128) - 0.5)
    assert grid(target + noise, target).item() == pytest.approx(noise.std().item() / 4, rel=0.1)
