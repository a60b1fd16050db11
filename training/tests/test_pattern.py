"""Share of fine detail that stands still, and the phases of an estimate."""

from dataclasses import astuple, replace

import torch

from insonify_training.estimate import phases
from insonify_training.pattern import PERIOD, TILE, main, variances
from insonify_training.tiers import TIERS


def part(picture, inside=None):
    """Share of the pattern that `variances` finds in a picture."""
    pattern, detail = variances(picture, torch.ones_like(picture, dtype=torch.bool) if inside is None else inside)
    return pattern / detail if detail else None


def test_independent_detail_leaves_one_over_the_number_of_blocks():
    torch.manual_seed(3)
    noise = 128 + 20 * torch.randn(512, 512)
    # The blur removes a part of each pixel; the remainder is averaged over 64 blocks per tile.
    assert abs(part(noise) - (PERIOD / TILE) ** 2) < 0.003


def test_a_pattern_counts_by_its_variance():
    torch.manual_seed(4)
    noise = 128 + 20 * torch.randn(512, 512)
    block = torch.randn(PERIOD, PERIOD)
    block = 10 * (block - block.mean()) / block.std(correction=0)
    pattern = block.repeat(512 // PERIOD, 512 // PERIOD)
    found = part(noise + pattern)
    assert abs(found - (100 + 400 / 64) / 500) < 0.03, found
    # A pattern of another period is not counted.
    other = torch.randn(11, 11).repeat(47, 47)[:512, :512] * 10
    assert part(noise + other) < 0.03


def test_only_tiles_inside_with_detail_count():
    torch.manual_seed(5)
    picture = 128 + 20 * torch.randn(192, 192)
    inside = torch.zeros(192, 192, dtype=torch.bool)
    assert part(picture, inside) is None
    inside[:TILE, :TILE] = True
    block = torch.randn(PERIOD, PERIOD)
    picture[TILE:] += 100 * block.repeat(16, 24)
    assert part(picture, inside) < 0.05
    assert part(torch.full((192, 192), 90.0)) is None


def test_a_folder_without_a_run_is_named(data_dir, tmp_path):
    try:
        main([str(data_dir), str(tmp_path)])
    except SystemExit as error:
        assert "checkpoint.pt" in str(error)
    else:
        raise AssertionError("no error")


def test_phases_cover_all_steps():
    fast = TIERS["fast_msa"]
    assert phases(fast) == [(4000, 0), (1500, 4000), (1500, 5500), (5000, 7000)]
    assert phases(TIERS["classic_msa"]) == [(6000, 0), (4500, 6000)]
    assert phases(fast.trial(12)) == [(6, 0), (3, 6), (3, 9)]
    # If the polish changes only weights, no term is added or removed.
    assert phases(replace(fast, polish_gan_weight=0.2)) == [(4000, 0), (1500, 4000), (6500, 5500)]


def test_the_polish_has_its_own_rate_and_weights():
    fast = TIERS["fast_msa"]
    assert [fast.rate_at(step) for step in (0, 4200)] == [7e-4, 7e-4]
    assert fast.rate_at(6999) < 1e-5
    assert fast.rate_at(7000) == 6e-4 and fast.rate_at(11_999) < 7e-6
    assert [astuple(fast.weights_at(step)) for step in (0, 5000, 5499, 5500, 6999, 7000)] == [
        (0.0, 0.0, 0.0, 0.3), (0.5, 0.0, 0.0, 0.3), (0.5, 0.0, 0.0, 0.3),
        (0.5, 0.6, 4.0, 0.3), (0.5, 0.6, 4.0, 0.3), (0.0, 0.6, 4.0, 2.5),
    ]
    assert astuple(TIERS["paper_msa"].weights_at(49_999)) == (1.0, 0.0, 0.0, 0.0)
    off = replace(fast, gan_weight=0.0, divergence_weight=0.0, grid_weight=0.0, ssim_weight=0.0, polish_gan_weight=0.2)
    assert [astuple(off.weights_at(step)) for step in (6000, 8000)] == [(0.0,) * 4] * 2
    # A trial has a polish, too.
    assert [fast.trial(12).main_steps, TIERS["classic_m"].main_steps] == [9, 10500]
    assert astuple(fast.trial(12).weights_at(11)) == (0.0, 0.6, 4.0, 2.5)
