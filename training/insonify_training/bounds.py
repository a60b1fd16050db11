"""Bounds on what a generator can reach on a data set: `python -m insonify_training.bounds DATA [--also NAME=DIR...]`.

Judges pictures that know the target, as `judge` judges those of a generator, on whole pictures of test tuples:

levels N px             the input's own detail on the target's levels, which are known up to a blur of N px (standard deviation)
levels and grain N px   the same, the detail scaled to the strength of the target's
NAME                    the high quality of DIR, another data set of the same tuples (same station, frames, phantoms and seed), as one of
                        a single layer: how much of the difference is beside the scan plane
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import torch

from .dataset import HQ, LQ, SEGMENTATION, Dataset, DatasetError
from .judge import NAMES, Textures, figures, frechet
from .quality import blur_matrix
from .visit import named

# Resolutions at which levels are known, px.
SIGMAS_PX = (4.0, 8.0, 16.0)
# Least deviation of the input's detail that is scaled up, grey levels / 255, and the largest factor.
FLAT, FACTOR = 0.5 / 255, 8.0


def blurred(values, inside, sigma_px):
    """Gaussian mean of `values` [h, w] over the pixels where `inside` is 1; 0 elsewhere."""
    down, across = (blur_matrix(n, sigma_px, int(3 * sigma_px)) for n in values.shape)
    blur = lambda x: down @ x @ across.T  # noqa: E731
    return blur(values * inside) / blur(inside).clamp_min(1e-6) * inside


def informed(lq, target, inside):
    """Pictures by name that know the target's levels, from `lq` and `target` [h, w] within 0..=1."""
    made = {}
    for sigma_px in SIGMAS_PX:
        levels = [blurred(x, inside, sigma_px) for x in (lq, target)]
        details = [(x - level) * inside for x, level in zip((lq, target), levels)]
        own, wanted = (blurred(detail.square(), inside, sigma_px).clamp_min(0).sqrt() for detail in details)
        factor = (wanted / own.clamp_min(FLAT)).clamp_max(FACTOR)
        made[f"levels {sigma_px:g} px"] = levels[1] + details[0]
        made[f"levels and grain {sigma_px:g} px"] = levels[1] + details[0] * factor
    return {name: torch.round(255 * picture.clamp(0, 1)) / 255 * inside for name, picture in made.items()}


def bounds(data, others, frames):
    """Mean figures by `judge.NAMES`, and the texture distance, of the input, of informed pictures and of other data sets."""
    rows = data.split("test")
    rows = rows[:: max(1, len(rows) // frames)][:frames]
    if not rows:
        raise DatasetError(f"{data.directory}: no test rows")
    textures, values, features = Textures(1), {}, {}
    for row in rows:
        planes, mask = data.picture(row)
        inside = torch.from_numpy((np.array(mask) > 0).astype(np.float32))
        level = lambda of: torch.from_numpy(np.array(of, np.float32) / 255) * inside  # noqa: E731, B023
        lq, target = level(planes[LQ]), level(planes[HQ])
        made = {"LQ": lq, **informed(lq, target, inside)}
        for name, other in others.items():
            made[name] = level(same_tuple(data, planes, row, other)[HQ])
        for name, picture in made.items():
            values.setdefault(name, []).append(figures(*(x[None, None] for x in (picture, target, inside))))
        for name, picture in {**made, "HQ": target}.items():
            features.setdefault(name, []).append(textures(picture.numpy()))
    distance = lambda name: frechet(*(np.concatenate(features[one]) for one in (name, "HQ")))  # noqa: E731
    return {name: {**dict(zip(NAMES, np.mean(of, 0).tolist())), "fd": distance(name)} for name, of in values.items()}


def same_tuple(data, planes, row, other):
    """Planes of the tuple of another data set that shows what `row` does."""
    found = other.pictures.get(row.index)
    if found is not None and found.size == data.pictures[row.index].size:
        theirs = other.picture(found)[0]
        if np.array_equal(theirs[SEGMENTATION], planes[SEGMENTATION]):
            return theirs
    raise DatasetError(f"{other.directory}: tuple {row.index} isn't that of {data.directory}: station, frames, phantoms and seed must be the same")


def main(argv=None):
    """Entry point of the command."""
    p = argparse.ArgumentParser(prog="insonify-bounds", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("data", type=Path, help="data set that `insonify dataset` wrote")
    p.add_argument("--also", action="append", default=[], type=named, metavar="NAME=DIR", help="another data set of the same tuples, whose high quality is judged")
    p.add_argument("--frames", type=int, default=24, help="test tuples, evenly spread [default: 24]")
    args = p.parse_args(argv)
    torch.set_num_threads(1)
    try:
        report = bounds(Dataset(args.data), {name: Dataset(folder) for name, folder in args.also}, args.frames)
    except DatasetError as error:
        raise SystemExit(str(error)) from None
    print("| | PSNR, dB | SSIM, % | pKL x100 | FD texture64 | seen error | levels | texture |\n|---|" + "---:|" * 7)
    for name, r in report.items():
        print(f"| {name} | {r['psnr_db']:.2f} | {100 * r['ssim']:.1f} | {100 * r['pkl']:.1f} | {r['fd']:.2f} | {r['seen']:.2f} | {r['levels']:.2f} | {r['texture']:.2f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
