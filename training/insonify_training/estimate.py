"""Says how long the training of tiers will take here: times a few steps of each, without the GAN term and with all terms."""

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


def step_seconds(config, device, bf16, gan):
    """Least seconds of a step without the GAN term, or with all terms."""
    warmup = 0 if gan else config.steps
    trainer = Trainer(replace(config, warmup=warmup, divergence_from=warmup, ramp=1), NoData, device, bf16)
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
            seen[alike] = [step_seconds(config, args.device, args.bf16, gan) for gan in (False, True)]
        plain, gan = seen[alike]
        before = min(config.warmup, config.steps)
        seconds = plain * before + gan * (config.steps - before)
        total += seconds
        print(
            f"{name:14} {config.steps} steps of {config.batch} x {config.crop}²: {1000 * plain:.0f} ms each, "
            f"{1000 * gan:.0f} ms with all terms; {hours(seconds)} h"
        )
    print(f"in all         {hours(total)} h of training on this machine as it is now")
    return 0


if __name__ == "__main__":
    sys.exit(main())
