"""Measures how much fine detail stands still on the screen: `python -m insonify_training.pattern DATA RUN...`.

A network of stride 8 may make grain as a pattern that repeats every 8 x 8 pixels. In each tile of 64 x 64 inside the
sector, the fine detail is averaged over its blocks of 8 x 8. The pattern's share is the variance of that mean over
the variance of the detail. Detail without such a pattern also leaves some: LQ and HQ show how much.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import torch

from .dataset import HQ, LQ, Dataset, DatasetError
from .export import ExportError, grid_of, load_run, run_torch
from .quality import blur_matrix

PERIOD, TILE = 8, 64
# Scale of the fine detail, px; tiles with less detail than this, grey levels, are ignored.
SIGMA, LEVELS = 4.0, 1.0


def variances(picture, inside, period=PERIOD, tile=TILE):
    """Variance of the pattern and of the fine detail, each summed over the tiles that are completely `inside`.

    `picture` holds levels 0..=255 [h, w], `inside` is bool [h, w]; the remainder at right and bottom is ignored.
    """
    down, across = (blur_matrix(n, SIGMA, int(3 * SIGMA)) for n in picture.shape)
    rows, columns = (n // tile for n in picture.shape)

    def tiles(of):
        cut = of[: rows * tile, : columns * tile].reshape(rows, tile, columns, tile)
        return cut.permute(0, 2, 1, 3).reshape(rows * columns, tile, tile)

    detail = tiles(picture - down @ picture @ across.T)
    detail = detail - detail.mean((1, 2), keepdim=True)
    power = detail.square().mean((1, 2))
    seen = tiles(inside).all(2).all(1) & (power >= LEVELS**2)
    blocks = tile // period
    pattern = detail[seen].reshape(-1, blocks, period, blocks, period).mean((1, 3))
    return np.array([pattern.square().mean((1, 2)).sum().item(), power[seen].sum().item()])


def main(argv=None):
    """Entry point of the command."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("data", type=Path, help="data set that `insonify dataset` wrote")
    p.add_argument("runs", type=Path, nargs="*", metavar="RUN", help="folders of training runs")
    p.add_argument("--limit", type=int, default=10, help="test tuples to look at, evenly spread [default: 10]")
    args = p.parse_args(argv)
    try:
        data = Dataset(args.data, grid_of(args.runs[0]) if args.runs else None)
        rows = data.split("test")
        if not rows:
            raise SystemExit(f"{args.data}: no test rows")
        trainers = {str(run): load_run(run, data)[0] for run in args.runs}
    except (DatasetError, ExportError) as error:
        raise SystemExit(str(error)) from None
    rows = [rows[i] for i in np.linspace(0, len(rows) - 1, min(args.limit, len(rows))).astype(int)]
    sums = {name: np.zeros(2) for name in ("LQ", "HQ", *trainers)}
    for row in rows:
        planes, mask = np.array(data.planes(row)), data.mask(row)
        inside = torch.from_numpy(mask > 0)
        for name, plane in (("LQ", LQ), ("HQ", HQ)):
            sums[name] += variances(torch.from_numpy(planes[plane]).float(), inside)
        for name, trainer in trainers.items():
            inputs, _, _ = trainer.encode(planes[None], np.array(mask)[None, None])
            output = run_torch(trainer.generator, inputs, trainer.encode.outside)
            made = output[0, 0].clamp(0, 1) * 255 * inside
            sums[name] += variances(made, inside)
    for name, (pattern, detail) in sums.items():
        print(f"{name:16} {100 * pattern / detail if detail else 0:5.2f} % of the fine detail stands still in {PERIOD} x {PERIOD} px")
    return 0


if __name__ == "__main__":
    sys.exit(main())
