"""PSNR and SSIM of grey levels, for the training's log and the manifest. The table is `insonify evaluate`'s."""

import torch
import torch.nn.functional as F


def psnr_db(output, target):
    """Peak signal-to-noise ratio of each picture [n, 1, h, w] within 0..=1, after rounding to grey levels: dB."""
    output, target = (torch.round(x.float().clamp(0, 1) * 255) for x in (output, target))
    error = (output - target).square().mean((1, 2, 3)).clamp_min(1e-10)
    return 10 * torch.log10(255.0**2 / error)


def ssim(output, target):
    """Structural similarity of each picture, 0..=1: MATLAB's defaults (Gaussian of 1.5 px, 11 x 11, edges repeated)."""
    x, y = (torch.round(p.float().clamp(0, 1) * 255) for p in (output, target))
    offsets = torch.arange(-5.0, 6.0, device=x.device)
    weights = torch.exp(-offsets.square() / (2 * 1.5**2))
    weights = weights / weights.sum()

    def blur(p):
        p = F.conv2d(F.pad(p, (5, 5, 0, 0), mode="replicate"), weights.view(1, 1, 1, -1))
        return F.conv2d(F.pad(p, (0, 0, 5, 5), mode="replicate"), weights.view(1, 1, -1, 1))

    mean_x, mean_y = blur(x), blur(y)
    variance_x, variance_y = blur(x * x) - mean_x.square(), blur(y * y) - mean_y.square()
    covariance = blur(x * y) - mean_x * mean_y
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    ratio = ((2 * mean_x * mean_y + c1) * (2 * covariance + c2)) / (
        (mean_x.square() + mean_y.square() + c1) * (variance_x + variance_y + c2)
    )
    return ratio.mean((1, 2, 3))
