"""PSNR, SSIM and pKL of grey levels, for the training log and the manifest. The table is that of `insonify evaluate`."""

import torch
import torch.nn.functional as F

from .patches import BINS, divergence, parts, patches


def psnr_db(output, target, mask):
    """Peak signal-to-noise ratio, dB, of each picture [n, 1, h, w] within 0..=1 inside `mask`, after rounding."""
    output, target = (torch.round(x.float().clamp(0, 1) * 255) for x in (output, target))
    error = inside((output - target).square(), mask).clamp_min(1e-10)
    return 10 * torch.log10(255.0**2 / error)


def inside(values, mask):
    """Mean of each picture's `values` [n, 1, h, w] where `mask` is 1."""
    return (values * mask).sum((1, 2, 3)) / mask.sum((1, 2, 3)).clamp_min(1)


def pkl(output, target, mask):
    """pKL of each picture in nats, as in `src/quality/pkl.rs`, except at the sector's edge.

    There, patches that are half inside count with their outside part.
    """

    def histograms(picture):
        levels = patches(torch.round(picture.float().clamp(0, 1) * 255), 0)
        places = torch.div(levels * BINS, 255, rounding_mode="floor").clamp(max=BINS - 1).long()
        counts = torch.zeros(len(levels), BINS, device=levels.device)
        return parts(counts.scatter_add_(1, places, torch.ones_like(levels)))

    q, p = histograms(output), histograms(target)
    inside = (patches(mask, 0).mean(1) >= 0.5).view(len(output), -1)
    each = divergence(p, q).view(len(output), -1)
    return (each * inside).sum(1) / inside.sum(1).clamp_min(1)


# Sides, pixels: of a block whose mean an eye compares, and of a patch in which it compares the grain.
BLOCK, GRAIN_PATCH = 16, 32


def seen_error(output, target, mask):
    """What an eye sees of an error, grey levels [n, 3]: the whole, its part of levels and its part of texture.

    The square of the pixels' error is that of the means of blocks, plus that of the detail within them. Speckle's detail
    differs between any two looks, so that only its strength counts: the part of texture is the RMS difference of the detail's deviations, patch
    by patch. The whole is the root of the sum of squares. Blocks and patches with less than half of their pixels inside are left out.
    """
    side, per = BLOCK, GRAIN_PATCH // BLOCK
    rows, columns = (side * per * (n // (side * per)) for n in output.shape[-2:])
    output, target, mask = (x[..., :rows, :columns].float() for x in (output, target, mask))
    output, target = (torch.round(x.clamp(0, 1) * 255) for x in (output, target))
    pool = lambda x, n: F.avg_pool2d(x, n)  # noqa: E731
    share = pool(mask, side)
    means = [pool(x * mask, side) / share.clamp_min(1e-6) for x in (output, target)]
    counted = (share >= 0.5).float()
    of = lambda square, weight: (square * weight).sum((1, 2, 3)) / weight.sum((1, 2, 3)).clamp_min(1)  # noqa: E731
    levels = of((means[0] - means[1]).square(), counted)
    spread = []
    for x, mean in zip((output, target), means):
        detail = (x - mean.repeat_interleave(side, -1).repeat_interleave(side, -2)).square() * mask
        spread.append((pool(pool(detail, side), per) / pool(share, per).clamp_min(1e-6)).sqrt())
    texture = of((spread[0] - spread[1]).square(), (pool(share, per) >= 0.5).float())
    return torch.stack([(levels + texture).sqrt(), levels.sqrt(), texture.sqrt()], 1)


def ssim(output, target, mask):
    """Structural similarity of each picture inside `mask`, 0..=1: MATLAB's defaults (Gaussian of 1.5 px, 11 x 11, edges repeated)."""
    return inside(similarity_map(*(torch.round(p.float().clamp(0, 1) * 255) for p in (output, target))), mask)


def blur_matrix(n, sigma, reach, device="cpu"):
    """Matrix that blurs `n` pixels by a Gaussian cut at `reach`, with repeated edges.

    With one channel, PyTorch multiplies 20 times faster than it convolves.
    """
    offsets = torch.arange(-reach, reach + 1, device=device)
    weights = torch.exp(-offsets.square() / (2 * sigma**2))
    weights = weights / weights.sum()
    places = (torch.arange(n, device=device).view(-1, 1) + offsets).clamp(0, n - 1)
    return torch.zeros(n, n, device=device).scatter_add_(1, places, weights.expand(n, -1).contiguous())


def similarity_map(x, y, first=0, every=1):
    """Structural similarity around pixels of pictures of levels 0..=255, with a gradient.

    Windows are centred on every `every`-th row and column, from `first` on.
    """
    down, across = (blur_matrix(n, 1.5, 5, x.device)[first::every] for n in x.shape[-2:])
    mean_x, mean_y, xx, yy, xy = (down @ torch.cat((x, y, x * x, y * y, x * y)) @ across.T).chunk(5)
    variance_x, variance_y = xx - mean_x.square(), yy - mean_y.square()
    covariance = xy - mean_x * mean_y
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    return ((2 * mean_x * mean_y + c1) * (2 * covariance + c2)) / (
        (mean_x.square() + mean_y.square() + c1) * (variance_x + variance_y + c2)
    )
