"""Trains one generator: `python -m insonify_training.train GENERATOR --data DIR --out RUN`.

The run's folder contains config.json, checkpoint.pt, log.jsonl, loss.png and sheet.png. The same command resumes a
stopped run. Ctrl-C or SIGTERM saves first; the exit code is then 130.
"""

import argparse
import json
import signal
import sys
import time
from dataclasses import fields, replace
from pathlib import Path

import torch

from .beam import BeamGrid
from .channels import VARIANTS
from .dataset import LQ, Crops, Dataset, DatasetError
from .losses import GAN
from .networks import NORMS, make
from .patches import PATCH
from .quality import pkl, psnr_db, ssim
from .sheets import loss_plot, sample_sheet
from .generators import GENERATORS, Config
from .trainer import Trainer, read_checkpoint, save_checkpoint

# Seed and number of the test crops of the log, the same for every run.
TEST_SEED, TEST_CROPS = 20260, 16
STOPPED = 130
# Values of a configuration's keys that are names.
CHOICES = {"variant": list(VARIANTS), "norm": list(NORMS), "gan": list(GAN)}


def parser():
    """Command line: a generator, and flags that override its values."""
    p = argparse.ArgumentParser(prog="insonify-train", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("generator", nargs="?", default="fast_msa", choices=sorted(GENERATORS), metavar="GENERATOR", help=", ".join(GENERATORS))
    p.add_argument("--data", type=Path, required=True, help="data set that `insonify dataset` wrote")
    p.add_argument("--out", type=Path, help="folder of the run [default: runs/GENERATOR]")
    for field in fields(Config):
        flag = "--" + field.name.replace("_", "-")
        if field.type is bool:
            p.add_argument(flag, action=argparse.BooleanOptionalAction, default=None)
        else:
            p.add_argument(flag, type=field.type, help="[default: the generator's]")
    p.add_argument("--trial", type=int, metavar="STEPS", help="only to see that it runs: so many steps")
    p.add_argument("--threads", type=int, default=2, help="threads of the arithmetic [default: 2]")
    p.add_argument("--loaders", type=int, default=1, help="threads that read crops [default: 1]")
    p.add_argument("--device", default="cpu", help="cpu or cuda [default: cpu]")
    p.add_argument("--bf16", action="store_true", help="bfloat16 where torch's autocast allows it")
    p.add_argument("--save-minutes", type=float, default=5.0, help="between checkpoints and pictures [default: 5]")
    p.add_argument("--stop-after", type=int, metavar="N", help="stop after N steps of this call, saved, as Ctrl-C does")
    return p


def configure(args):
    """The generator's configuration with the flags' values."""
    given = {f.name: getattr(args, f.name) for f in fields(Config)}
    generator = GENERATORS[args.generator] if args.trial is None else GENERATORS[args.generator].trial(args.trial)
    config = replace(generator, **{k: v for k, v in given.items() if v is not None})
    for name, known in CHOICES.items():
        if getattr(config, name) not in known:
            raise SystemExit(f"--{name} {getattr(config, name)}: it must be one of {', '.join(known)}")
    try:
        # Only its shape: ngf 64 has 54 million weights.
        with torch.device("meta"):
            network = make(config.network, 1)
    except ValueError as error:
        raise SystemExit(f"--{error}") from None
    try:
        BeamGrid.parse(config.beam)
    except ValueError as error:
        raise SystemExit(f"--beam {error}") from None
    multiple = network.padding_multiple
    if config.crop % multiple != 0:
        raise SystemExit(f"--crop {config.crop}: {config.network} takes multiples of {multiple} pixels")
    if config.crop < PATCH:
        raise SystemExit(f"--crop {config.crop}: pKL is of patches of {PATCH} pixels")
    if config.border < 0:
        raise SystemExit(f"--border {config.border}: 0 or more pixels")
    if not 0 <= config.share < 1 or (config.share > 0 and not hasattr(network, "share")):
        raise SystemExit(f"--share {config.share}: at least 0 and below 1; {config.network} takes {'any' if hasattr(network, 'share') else 'only 0'}")
    if config.divergence_weight > 0 and config.crop < 2 * PATCH:
        raise SystemExit(f"--crop {config.crop}: the divergence is of patches of {PATCH}, so that crops need {2 * PATCH} pixels")
    return config


def check_quality(config, data):
    """Refuses a data set whose frames are rendered otherwise than the configuration says."""
    try:
        unlike = data.unlike(config)
    except ValueError as error:
        raise SystemExit(f"--{error}") from None
    if unlike:
        name, found, wanted = unlike
        given = ",".join(f"{q.rays}x{q.layers}x{q.angles}" for q in found)
        raise SystemExit(
            f"{data.directory}: {name} is {', '.join(map(str, found))}, the generator wants {', '.join(map(str, wanted))}: "
            f"name another data set, or --{name} {given}"
        )


class Run:
    """Files of a run."""

    def __init__(self, folder):
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self.checkpoint, self.log_path = folder / "checkpoint.pt", folder / "log.jsonl"

    def keep_config(self, config, data):
        """Stores the configuration and the data set's identity."""
        text = json.dumps({"config": config.to_dict(), "data": str(data.directory.resolve())}, indent=2)
        (self.folder / "config.json").write_text(text + "\n", encoding="utf-8")

    def log(self, **row):
        """Appends a row to the log."""
        with open(self.log_path, "a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")


def resume(trainer, run, config, data_sha256):
    """Resumes from the run's checkpoint, if there is one."""
    if not run.checkpoint.exists():
        run.log(event="start", data_sha256=data_sha256, config=config.to_dict())
        return
    state = read_checkpoint(run.checkpoint)
    try:
        kept = Config.from_dict(state["config"])
    except ValueError as error:
        raise SystemExit(f"{run.checkpoint}: made by another version ({error}): name another --out") from None
    if state["step"] > config.steps:
        raise SystemExit(f"{run.checkpoint}: at step {state['step']}, beyond the {config.steps} of this training: name another --out")
    # More steps continue the same training; another network structure doesn't.
    for name in ("network", "variant", "lq", "hq", "attenuation_power", "norm", "ndf", "gan", "ema"):
        if getattr(kept, name) != getattr(config, name):
            raise SystemExit(
                f"{run.checkpoint}: {name} is {getattr(kept, name)}, not {getattr(config, name)}: name another --out"
            )
    trainer.load(state)
    # Settings that an older checkpoint doesn't name did not exist.
    changed = {k: v for k, v in config.to_dict().items() if state["config"].get(k) != v}
    if changed:
        print(f"goes on with other settings than before: {changed}", file=sys.stderr)
    if state.get("data_sha256") != data_sha256:
        print("goes on with other data than before", file=sys.stderr)
    run.log(event="resume", at=trainer.step, data_sha256=data_sha256, changed=changed)


def examine(trainer, batch, run):
    """PSNR, SSIM and pKL on the test crops, and the sample sheet."""
    output, target, mask = trainer.generate(batch)
    lq = torch.from_numpy(batch.planes[:, LQ : LQ + 1]).to(target).mul(1 / 255) * mask
    row = {
        "psnr_db": round(psnr_db(output, target, mask).mean().item(), 3),
        "ssim": round(ssim(output, target, mask).mean().item(), 4),
        "psnr_lq_db": round(psnr_db(lq, target, mask).mean().item(), 3),
        "ssim_lq": round(ssim(lq, target, mask).mean().item(), 4),
        "pkl": round(pkl(output, target, mask).mean().item(), 4),
        "pkl_lq": round(pkl(lq, target, mask).mean().item(), 4),
    }
    run.log(step=trainer.step, **row)
    shown = slice(0, 4)
    columns = {"LQ": lq, "generated": output, "target": target, "difference": (output - target).abs()}
    title = f"step {trainer.step}  {row['psnr_db']:.2f} dB (LQ {row['psnr_lq_db']:.2f})"
    sample_sheet(run.folder / "sheet.png", {k: v[shown].cpu() for k, v in columns.items()}, title)
    loss_plot(run.log_path, run.folder / "loss.png", run.folder.name)
    return row


def hours(seconds):
    """Seconds as h:mm:ss."""
    seconds = int(seconds)
    return f"{seconds // 3600}:{seconds // 60 % 60:02}:{seconds % 60:02}"


def loop(trainer, crops, test, run, args, data_sha256):
    """Trains to the end, or until told to stop. Returns whether it reached the end."""
    config = trainer.config
    stop = []
    previous = {s: signal.signal(s, lambda number, _: stop.append(number)) for s in (signal.SIGINT, signal.SIGTERM)}
    begun, first = time.monotonic(), trainer.step
    last = config.steps if args.stop_after is None else min(config.steps, first + args.stop_after)
    saved = shown = begun
    waited = 0.0
    sums, count = {}, 0

    def save():
        trainer.seconds += time.monotonic() - save.since
        save.since = time.monotonic()
        save_checkpoint(run.checkpoint, {**trainer.state(), "data_sha256": data_sha256})

    save.since = begun
    stream = crops.stream(first, last, args.loaders)
    try:
        while trainer.step < last and not stop:
            asked = time.monotonic()
            batch = next(stream)
            waited += time.monotonic() - asked
            seen = trainer.train(batch)
            for key, value in seen.items():
                sums[key] = sums.get(key, 0.0) + value
            count += 1
            now = time.monotonic()
            if now - shown > 2.0 or trainer.step == last:
                means = {key: float(total) / count for key, total in sums.items()}
                if not all(abs(value) < 1e6 for value in means.values()):
                    raise SystemExit(f"step {trainer.step}: the losses are no numbers any more: {means}")
                pace = (now - begun) / (trainer.step - first)
                run.log(
                    step=trainer.step,
                    **{k: round(v, 6) for k, v in means.items()},
                    step_ms=round(1000 * pace, 1),
                    waited_ms=round(1000 * waited / (trainer.step - first), 2),
                )
                left = hours(pace * (config.steps - trainer.step))
                terms = "  ".join(f"{key} {value:.4f}" for key, value in means.items() if key != "rate")
                print(
                    f"\r{run.folder.name} {trainer.step}/{config.steps}  {terms}  {1000 * pace:.0f} ms/step  left {left}  ",
                    end="",
                    file=sys.stderr,
                    flush=True,
                )
                shown, sums, count = now, {}, 0
            if now - saved > 60 * args.save_minutes:
                save()
                row = examine(trainer, test, run)
                print(f"{row['psnr_db']:.2f} dB (LQ {row['psnr_lq_db']:.2f})", file=sys.stderr)
                saved = time.monotonic()
    finally:
        stream.close()
        for s, handler in previous.items():
            signal.signal(s, handler)
    save()
    row = examine(trainer, test, run)
    print(f"\n{run.folder}: step {trainer.step} of {config.steps}, {row}", file=sys.stderr)
    return trainer.step >= config.steps


def main(argv=None):
    """Entry point of the command."""
    args = parser().parse_args(argv)
    config = configure(args)
    torch.set_num_threads(args.threads)
    try:
        data = Dataset(args.data, BeamGrid.parse(config.beam))
        check_quality(config, data)
        crops = Crops(data, "train", config.crop, config.batch, config.seed, config.flip, border=config.border)
        # A data set that is still being written may have no test rows yet.
        split = "test" if data.split("test") else "train"
        test = Crops(data, split, config.crop, TEST_CROPS, TEST_SEED, flip=False, min_inside=0.5).at(0)
    except DatasetError as error:
        raise SystemExit(str(error)) from None
    trainer = Trainer(config, data, args.device, args.bf16)
    unknown = trainer.segmentation.unknown(data.classes)
    if unknown:
        print(f"not in insonify's table, taken for {trainer.segmentation.other}: {', '.join(unknown)}", file=sys.stderr)
    if split == "train":
        print("no test rows yet: figures and sheet are of training crops", file=sys.stderr)
    run = Run(args.out or Path("runs") / args.generator)
    data_sha256 = data.sha256()
    resume(trainer, run, config, data_sha256)
    run.keep_config(config, data)
    weights = sum(p.numel() for p in trainer.generator.parameters())
    print(
        f"{run.folder}: {config.network} {config.variant}, {weights / 1e6:.2f} M weights; {len(crops.rows)} tuples; "
        f"steps {trainer.step} to {config.steps} of {config.batch} x {config.crop}²",
        file=sys.stderr,
    )
    if not loop(trainer, crops, test, run, args, data_sha256):
        print("stopped: the same command goes on", file=sys.stderr)
        return STOPPED
    return 0


if __name__ == "__main__":
    sys.exit(main())
