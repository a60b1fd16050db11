"""Losses of the generator and the discriminator, and their weights over the steps."""

import torch
import torch.nn.functional as F

from .patches import BINS, PATCH, divergence, parts, patches
from .quality import similarity

# Slope of the output beyond black and white: the station clips there, but a gradient must lead back.
LEAK = 0.05


def soft_clip(y):
    """`y` clipped to 0..=1, with a slight slope outside."""
    inside = y.clamp(0.0, 1.0)
    return inside + LEAK * (y - inside)


def l1(output, target):
    """Mean absolute difference of masked pictures."""
    return F.l1_loss(output, target)


def patch_histogram(output, target, offset, side=PATCH):
    """Mean 1-Wasserstein distance of the grey-level histograms of patches of `side` pixels, by sorting.

    It depends on levels and not on their places, and so rewards the grain that L1 smooths away. Patches begin
    `offset` pixels from the upper left corner; incomplete ones at the edges are ignored. Pictures are at least
    `side` + `offset` pixels high and wide.
    """

    output, target = (patches(picture, offset, side).sort(1).values for picture in (output, target))
    return (output - target).abs().mean()


def soft_histogram(levels, bins=BINS):
    """Fractions of the levels [patches, n] within 0..=1 in each bin [patches, bins].

    A level is divided between the two bins with the nearest centres, by distance, so that there is a gradient.
    """
    place = (levels * bins - 0.5).clamp(0.0, bins - 1.0)
    lower = place.detach().floor().clamp(max=bins - 2)
    above = place - lower
    lower = lower.long()
    counts = levels.new_zeros(len(levels), bins).scatter_add(1, lower, 1 - above).scatter_add(1, lower + 1, above)
    return parts(counts)


def patch_divergence(output, target, offset, side=PATCH):
    """Mean Kullback-Leibler divergence D(target || output) of patches' grey-level histograms: pKL with soft bins.

    Patches as in `patch_histogram`; those with a black target are ignored.
    """
    output, target = (patches(picture, offset, side) for picture in (output, target))
    seen = target.amax(1) > 0
    p, q = (soft_histogram(levels[seen]) for levels in (target, output))
    return divergence(p, q).sum() / seen.sum().clamp_min(1)


def grid(output, target, period=8, tile=64):
    """Root mean square of the error common to the same place of all `period` x `period` blocks of a tile.

    This is a pattern that stands still on the screen, which networks of that stride would use as grain. Pictures
    should be whole tiles; the remainder is ignored.
    """
    error = (output - target)[:, 0]
    rows, columns = (error.shape[1] // tile, error.shape[2] // tile)
    error = error[:, : rows * tile, : columns * tile]
    blocks = tile // period
    pattern = error.reshape(-1, rows, blocks, period, columns, blocks, period).mean((2, 5))
    return (pattern - pattern.mean((2, 4), keepdim=True)).square().mean().add(1e-10).sqrt()


def dissimilarity(output, target):
    """1 minus the mean structural similarity of pictures within 0..=1."""
    return 1 - similarity(255 * output, 255 * target).mean()


def discriminator_loss(real, fake):
    """Cross-entropy of logits of rendered and of generated patches."""
    on_real = F.binary_cross_entropy_with_logits(real.float(), torch.ones_like(real, dtype=torch.float32))
    on_fake = F.binary_cross_entropy_with_logits(fake.float(), torch.zeros_like(fake, dtype=torch.float32))
    return 0.5 * (on_real + on_fake)


def generator_gan_loss(fake):
    """Cross-entropy of generated patches labelled as rendered."""
    return F.binary_cross_entropy_with_logits(fake.float(), torch.ones_like(fake, dtype=torch.float32))


def gan_weight(step, weight, warmup, ramp):
    """Weight of the GAN term: 0 for `warmup` steps, then linear to `weight` over `ramp` steps."""
    if step < warmup:
        return 0.0
    return weight * min(1.0, (step - warmup + 1) / max(ramp, 1))


def falling(step, steps, rate, decay_from):
    """`rate` up to the fraction `decay_from` of the steps, then falling linearly towards 0 (at least a hundredth)."""
    start = decay_from * steps
    if step <= start:
        return rate
    return rate * max(0.01, 1.0 - (step - start) / max(steps - start, 1.0))
