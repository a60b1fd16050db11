"""PSNR, SSIM and pKL of grey levels, for the training log and the manifest. The table is that of `insonify evaluate`."""

import torch

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
