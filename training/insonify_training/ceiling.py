"""Estimates the largest gain of a generator: `python -m insonify_training.ceiling DATA`.

A generator can't know the part of the HQ speckle that LQ doesn't show. The estimate is that of an oracle which knows
the structure: HQ blurred by sigma pixels. It adds the fine detail of LQ times the gain that fits HQ best, for every
hundred rows. Full field of view. This is an estimate and no bound: another oracle may use the same knowledge better.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import torch

from .dataset import HQ, LQ, Dataset, DatasetError
from .quality import blur_matrix, psnr_db, ssim

SIGMAS = (2, 4, 8, 16)
# Rows that share a gain: the similarity of the speckle depends on depth.
ROWS = 100


def oracle(lq, hq, mask, sigma):
    """Estimate by the oracle of `sigma` for pictures [1, 1, h, w] within 0..=1."""
    down, across = (blur_matrix(n, sigma, 3 * sigma) for n in hq.shape[-2:])
    output = (down @ hq @ across.T) * mask
    detail, missing = (lq - down @ lq @ across.T) * mask, hq - output
    for top in range(0, hq.shape[-2], ROWS):
        rows = slice(top, top + ROWS)
        a, b = detail[..., rows, :], missing[..., rows, :]
        output[..., rows, :] += (a * b).sum() / a.square().sum().clamp_min(1e-9) * a
    return output.clamp(0, 1)


def main(argv=None):
    """Entry point of the command."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("data", type=Path, help="data set that `insonify dataset` wrote")
    p.add_argument("--limit", type=int, default=10, help="test tuples to look at, evenly spread [default: 10]")
    args = p.parse_args(argv)
    try:
        data = Dataset(args.data)
    except DatasetError as error:
        raise SystemExit(str(error)) from None
    rows = data.split("test")
    rows = [rows[i] for i in np.linspace(0, len(rows) - 1, min(args.limit, len(rows))).astype(int)]
    if not rows:
        raise SystemExit(f"{args.data}: no test rows")
    seen = {name: [] for name in ("LQ", *SIGMAS)}
    for row in rows:
        planes, mask = np.array(data.planes(row)), data.mask(row) > 0
        lq, hq = (torch.from_numpy(planes[i][None, None]).float() / 255 for i in (LQ, HQ))
        mask = torch.from_numpy(mask)[None, None].float()
        for name, values in seen.items():
            made = lq if name == "LQ" else oracle(lq, hq, mask, name)
            values.append((psnr_db(made, hq, mask).item(), 100 * ssim(made, hq, mask).item()))
    means = {name: np.mean(values, 0) for name, values in seen.items()}
    for name, (psnr, similarity) in means.items():
        what = "LQ" if name == "LQ" else f"oracle of {name} px"
        gain = "" if name == "LQ" else f"  {psnr - means['LQ'][0]:+.1f} dB  {similarity - means['LQ'][1]:+.1f} points"
        print(f"{what:16} {psnr:6.2f} dB  SSIM {similarity:5.1f} %{gain}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
