"""Share of fine detail that stands still."""

import torch

from insonify_training.pattern import PERIOD, TILE, main, variances


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
