"""Estimates the training time of generators on this machine from a few steps of each phase of the loss."""

import argparse
import sys
import time
from dataclasses import replace

import numpy as np
import torch

from .dataset import Batch
from .generators import GENERATORS, SHIPPED
from .train import hours
from .trainer import Trainer

STEPS = 6


class NoData:
    """Classes without a data set: enough to feed a network."""

    classes = ("outside", "soft_tissue")
    attenuation_power = 1.0


def phases(config):
    """Number of steps and first step of each phase: without and with the GAN term."""
    warmup = min(config.warmup, config.steps) if config.gan_weight > 0 else config.steps
    return [(count, first) for count, first in ((warmup, 0), (config.steps - warmup, warmup)) if count > 0]


def step_seconds(config, first, device, bf16):
    """Shortest time of a step, s, in the phase that begins with step `first`."""
    trainer = Trainer(config, NoData, device, bf16)
    shape = (config.batch, 4, config.crop, config.crop)
    batch = Batch(np.random.default_rng(1).integers(0, 2, shape, dtype=np.uint8), np.full((shape[0], 1, *shape[2:]), 255, np.uint8))
    times = []
    for _ in range(STEPS + 1):
        trainer.step = first
        begun = time.perf_counter()
        trainer.train(batch)["l1"].item()
        times.append(time.perf_counter() - begun)
    return min(times[1:])


def main(argv=None):
    """Entry point of the command."""
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument("generators", nargs="*", default=list(SHIPPED), metavar="GENERATOR", help="[default: those that are shipped]")
    p.add_argument("--threads", type=int, default=2)
    p.add_argument("--device", default="cpu")
    p.add_argument("--bf16", action="store_true")
    p.add_argument("--trial", type=int, metavar="STEPS", help="of a trial of so many steps a generator")
    args = p.parse_args(argv)
    torch.set_num_threads(args.threads)
    total, seen = 0.0, {}
    for name in args.generators:
        if name not in GENERATORS:
            raise SystemExit(f"no generator is called {name}; there are {', '.join(GENERATORS)}")
        config = GENERATORS[name]
        if args.trial is not None:
            config = config.trial(args.trial)
        alike = replace(config, variant="MSA", lq="", hq="")
        if alike not in seen:
            seen[alike] = [(steps, step_seconds(alike, first, args.device, args.bf16)) for steps, first in phases(alike)]
        seconds = sum(steps * each for steps, each in seen[alike])
        parts = " + ".join(f"{steps} of {1000 * each:.0f} ms" for steps, each in seen[alike])
        total += seconds
        print(
            f"{name:14} {config.steps} steps of {config.batch} x {config.crop}²: {parts}; {hours(seconds)} h"
        )
    print(f"in all         {hours(total)} h of training on this machine as it is now")
    return 0


if __name__ == "__main__":
    sys.exit(main())
