"""Says how long the training of tiers will take here: times a few steps of each phase: without the GAN term, with it, and with the
terms that come last."""

import argparse
import sys
import time
from dataclasses import replace

import numpy as np
import torch

from .dataset import Batch
from .tiers import SHIPPED, TIERS
from .train import hours
from .trainer import Trainer

STEPS = 3


class NoData:
    """Classes of no data set: enough to feed a network with."""

    classes = ("outside", "soft_tissue")
    attenuation_power = 1.0


def phases(config):
    """Steps of each phase, and what makes the first step one of it: settings."""
    never = config.steps
    last = config.divergence_from if max(config.divergence_weight, config.grid_weight) > 0 else never
    gan = config.warmup if config.gan_weight > 0 else never
    edges = sorted({0, min(gan, never), min(last, never), never})
    for begin, end in zip(edges, edges[1:]):
        warmup, divergence_from = (0 if begin >= at else never for at in (gan, last))
        yield end - begin, replace(config, warmup=warmup, divergence_from=divergence_from, ramp=1)


def step_seconds(config, device, bf16):
    """Least seconds of a step."""
    trainer = Trainer(config, NoData, device, bf16)
    shape = (config.batch, 4, config.crop, config.crop)
    batch = Batch(np.random.default_rng(1).integers(0, 2, shape, dtype=np.uint8), np.full((shape[0], 1, *shape[2:]), 255, np.uint8))
    times = []
    for _ in range(STEPS + 1):
        begun = time.perf_counter()
        trainer.train(batch)["l1"].item()
        times.append(time.perf_counter() - begun)
    return min(times[1:])


def main(argv=None):
    """The command."""
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument("tiers", nargs="*", default=list(SHIPPED), metavar="TIER", help="[default: those that are shipped]")
    p.add_argument("--threads", type=int, default=2)
    p.add_argument("--device", default="cpu")
    p.add_argument("--bf16", action="store_true")
    p.add_argument("--steps", type=int, help="of each tier [default: the tier's]")
    args = p.parse_args(argv)
    torch.set_num_threads(args.threads)
    total, seen = 0.0, {}
    for name in args.tiers:
        if name not in TIERS:
            raise SystemExit(f"no tier is called {name}; there are {', '.join(TIERS)}")
        config = TIERS[name]
        if args.steps is not None:
            config = replace(config, steps=args.steps)
        alike = replace(config, variant="MSA")
        if alike not in seen:
            seen[alike] = [(steps, step_seconds(phase, args.device, args.bf16)) for steps, phase in phases(alike)]
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
