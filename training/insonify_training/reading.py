"""Measures how fast random crops are read from .npy by memory map, compressed .npz and PNG.

`python -m insonify_training.reading DATA` rewrites a few tuples of a data set in each format and reads 256² crops.
"""

import argparse
import io
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

from .dataset import Dataset


def write(folder, name, planes):
    """Writes one tuple in each format; returns paths by format."""
    paths = {kind: folder / f"{name}.{kind}" for kind in ("npy", "npz", "png")}
    np.save(paths["npy"], planes)
    np.savez_compressed(paths["npz"], planes=planes)
    # One grey PNG of all planes, stacked vertically.
    Image.fromarray(planes.reshape(-1, planes.shape[2])).save(paths["png"])
    return paths


def read(path, at):
    """Reads a crop of all planes."""
    if path.suffix == ".npy":
        return np.array(np.load(path, mmap_mode="r")[(slice(None), *at)])
    if path.suffix == ".npz":
        return np.array(np.load(path)["planes"][(slice(None), *at)])
    whole = np.asarray(Image.open(io.BytesIO(path.read_bytes())))
    return np.array(whole.reshape(4, -1, whole.shape[1])[(slice(None), *at)])


def main(argv=None):
    """Entry point of the command."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("data", type=Path)
    p.add_argument("--tuples", type=int, default=8)
    p.add_argument("--crops", type=int, default=100)
    p.add_argument("--crop", type=int, default=256)
    args = p.parse_args(argv)
    data = Dataset(args.data)
    random = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as folder:
        rows = data.rows[:: max(1, len(data.rows) // args.tuples)][: args.tuples]
        written = [write(Path(folder), str(i), np.array(data.planes(row))) for i, row in enumerate(rows)]
        for kind in ("npy", "npz", "png"):
            size = sum(paths[kind].stat().st_size for paths in written) / len(written)
            times = []
            for _ in range(args.crops if kind == "npy" else max(10, args.crops // 5)):
                i = random.integers(len(rows))
                y, x = (random.integers(n - args.crop + 1) for n in reversed(rows[i].size))
                begun = time.perf_counter()
                read(written[i][kind], np.s_[y : y + args.crop, x : x + args.crop])
                times.append(1000 * (time.perf_counter() - begun))
            print(f"{kind}  {size / 1e6:.2f} MB a tuple  {np.median(times):.2f} ms a crop (least {min(times):.2f})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
