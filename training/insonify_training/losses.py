"""Losses of the generator and the discriminator."""

import torch
import torch.nn.functional as F

from .patches import BINS, PATCH, divergence, parts, patches
from .quality import similarity_map

# Slope of the output beyond black and white: the station clips there, but a gradient must lead back.
LEAK = 0.05


def soft_clip(y):
    """`y` clipped to 0..=1, with a slight slope outside."""
    inside = y.clamp(0.0, 1.0)
    return inside + LEAK * (y - inside)


def l1(output, target, area=None):
    """Mean absolute difference of masked pictures, weighted by `area`, whose mean is 1."""
    difference = (output - target).abs()
    return (difference if area is None else difference * area).mean()


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

    Patches begin `offset` pixels from the upper left corner; incomplete ones at the edges and those with a black target
    are ignored. It rewards the grain that L1 smooths away. Pictures are at least `side` + `offset` pixels high and wide.
    """
    output, target = (patches(picture, offset, side) for picture in (output, target))
    # Black patches have the weight 0 and are not cut out: shapes stay the same, as CUDA graphs need.
    seen = (target.amax(1) > 0).to(output.dtype)
    p, q = (soft_histogram(levels) for levels in (target, output))
    return (divergence(p, q) * seen).sum() / seen.sum().clamp_min(1)


def grid(output, target, period=8, tile=32):
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


def dissimilarity(output, target, offset=0, every=4):
    """1 minus the mean structural similarity of pictures within 0..=1, of every `every`-th window from `offset` on.

    Windows overlap, so that each pixel is in several; all windows would cost more than the network.
    """
    return 1 - similarity_map(255 * output, 255 * target, offset, every).mean()


def discriminator_loss(real, fake):
    """Cross-entropy of logits of rendered and of generated patches."""
    on_real = F.binary_cross_entropy_with_logits(real.float(), torch.ones_like(real, dtype=torch.float32))
    on_fake = F.binary_cross_entropy_with_logits(fake.float(), torch.zeros_like(fake, dtype=torch.float32))
    return 0.5 * (on_real + on_fake)


def generator_gan_loss(fake):
    """Cross-entropy of generated patches labelled as rendered."""
    return F.binary_cross_entropy_with_logits(fake.float(), torch.ones_like(fake, dtype=torch.float32))


def discriminator_hinge(real, fake):
    """Hinge loss of logits of rendered and of generated patches (Lim and Ye 2017): 0 where they are apart by the margins."""
    return 0.5 * (F.relu(1 - real.float()).mean() + F.relu(1 + fake.float()).mean())


def generator_hinge(fake):
    """Mean logit of generated patches, negated."""
    return -fake.float().mean()


# Losses of discriminator and generator by the name of the adversarial term.
GAN = {"log": (discriminator_loss, generator_gan_loss), "hinge": (discriminator_hinge, generator_hinge)}
