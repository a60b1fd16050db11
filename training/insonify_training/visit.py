"""Training of several generators at once on a GPU, within a budget of seconds.

`python -m insonify_training.visit PLAN --data NAME=DIR... --seconds N --out FOLDER`

PLAN is a JSON list of trainings: {"name", "generator", "data", and any numbers of its configuration}. All train side by side; each step
is a CUDA graph, so that the processor only starts it. The number of steps comes from the pace that is measured first. A folder NAME in FOLDER
gets checkpoint.pt (the best weights so far, judged on held-out tuples in the coordinates of the network), log.jsonl and config.json. Killed at any time, the best weights stay.
"""

import argparse
import contextlib
import json
import os
import sys
import time
from dataclasses import dataclass, fields, replace
from pathlib import Path

import torch

from .beam import BeamGrid
from .dataset import Dataset, DatasetError
from .generators import GENERATORS, Config
from .networks import make
from .quality import pkl, psnr_db, seen_error
from .resident import BORDER, Resident
from .train import CHOICES
from .trainer import Trainer, save_checkpoint

# Steps before the pace is measured: the first choose algorithms.
WARM_STEPS = 4
# Steps between two looks at the clock.
ROUND_STEPS = 10
# Held-out tuples that decide which weights are best, and seconds between such looks.
LOOKED_AT, LOOK_S = 12, 20.0
# Share of the time that the steps are planned for; the rest is for looks.
PLANNED = 0.93
# Exit code if a training ended early, and others did not.
ENDED = 3
# Keys of a configuration that mean nothing here.
UNUSED = {"steps", "crop", "border", "freeze_from"}


@dataclass(frozen=True)
class Entry:
    """A training of the plan."""

    name: str
    data: str
    config: Config

    @classmethod
    def of(cls, row):
        """An entry of the plan's JSON."""
        row = dict(row)
        try:
            name, generator, data = (row.pop(key) for key in ("name", "generator", "data"))
        except KeyError as error:
            raise SystemExit(f"plan: a training lacks the key {error}") from None
        if generator not in GENERATORS:
            raise SystemExit(f"plan: {name}: no generator is called {generator}")
        unknown = set(row) - {field.name for field in fields(Config)}
        if unknown:
            raise SystemExit(f"plan: {name}: a configuration has no key {sorted(unknown)[0]}")
        unused = set(row) & UNUSED
        if unused:
            raise SystemExit(f"plan: {name}: {sorted(unused)[0]} has no effect here: crops are of whole width, and time sets the steps")
        config = replace(GENERATORS[generator], **row)
        for key, known in CHOICES.items():
            if getattr(config, key) not in known:
                raise SystemExit(f"plan: {name}: {key} is {getattr(config, key)}; it must be one of {', '.join(known)}")
        if config.norm != "none":
            raise SystemExit(f"plan: {name}: norm is {config.norm}; only networks without norm are trained here")
        return cls(name, data, config)


class Session:
    """A generator in training, and its tuples; on a GPU a step is one CUDA graph."""

    def __init__(self, entry, data, train, test, bf16):
        self.entry, self.data, self.train, self.test = entry, data, train, test
        self.trainer = Trainer(entry.config, data, train.device, bf16)
        self.gan_weight = torch.zeros((), device=train.device)
        self.graph, self.stream = None, None
        self.seen, self.best = {}, float("inf")
        self.trainer.generator.train()

    def _update(self):
        drawn = self.train.draw(self.entry.config.batch, self.entry.config.flip)
        inputs, target, inside = self.trainer.encode(drawn.planes, drawn.mask)
        weight = self.gan_weight if self.entry.config.gan_weight > 0 else None
        return self.trainer.update(inputs, target, inside, weight, area=drawn.area, view=drawn.view)

    def capture(self):
        """Takes the first steps, and keeps the next as a graph where the device is a GPU."""
        self.trainer.schedule()
        if self.train.device.type != "cuda":
            for _ in range(WARM_STEPS):
                self.step()
            return
        self.stream = torch.cuda.Stream()
        self.stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(self.stream):
            for _ in range(WARM_STEPS):
                self._update()
                self.trainer.step += 1
        torch.cuda.synchronize()
        graph = torch.cuda.CUDAGraph()
        try:
            with torch.cuda.graph(graph, stream=self.stream):
                self.seen = self._update()
        except RuntimeError as error:
            # Slower, and better than a visit without a result.
            print(f"visit: {self.entry.name}: no CUDA graph, steps are started one by one: {error}", file=sys.stderr, flush=True)
            torch.cuda.synchronize()
            return
        self.graph = graph

    def plan(self, steps):
        """Sets the number of steps, by which rates and weights follow their schedules."""
        old = self.entry.config
        share = steps / old.steps
        self.trainer.config = replace(old, steps=steps, warmup=int(old.warmup * share), ramp=max(1, int(old.ramp * share)))

    def schedule(self):
        """Sets the rates and the weight of the adversarial term for the coming steps."""
        self.gan_weight.fill_(self.trainer.schedule())

    def step(self):
        """Starts a step; on a GPU it runs on."""
        with torch.cuda.stream(self.stream) if self.stream else contextlib.nullcontext():
            if self.graph is None:
                self.seen = self._update()
            else:
                self.graph.replay()
        self.trainer.step += 1

    @torch.no_grad()
    def look(self, out):
        """Judges the weights on held-out tuples, and keeps them if they are the best; returns the figures."""
        self.trainer.shown.eval()
        values = []
        for planes, mask in self.test:
            inputs, target, inside = self.trainer.encode(planes, mask)
            output = self.trainer.shown(inputs).float().clamp(0, 1) * inside
            lq = inputs[:, :1] * inside
            values.append(torch.stack([torch.cat([psnr_db(p, target, inside), pkl(p, target, inside), seen_error(p, target, inside)[0]]) for p in (output, lq)]))
        made, lq = torch.stack(values).mean(0).tolist()
        named = lambda figures, of: dict(zip((f"psnr_db{of}", f"pkl{of}", f"seen{of}", f"levels{of}", f"texture{of}"), figures))  # noqa: E731
        row = {"step": self.trainer.step, **{k: round(v, 4) for k, v in {**named(made, ""), **named(lq, "_lq")}.items()}}
        row |= {key: round(float(value), 5) for key, value in self.seen.items()}
        with open(out / "log.jsonl", "a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        if row["seen"] < self.best:
            self.best = row["seen"]
            state = {**self.trainer.weights(), "data_sha256": self.data.sha256()}
            save_checkpoint(out / "checkpoint.pt", state)
        self.trainer.generator.train()
        return row


def held_out(resident, count):
    """Planes and mask [1, ., h, w] of up to `count` held-out tuples, evenly spread, without mirroring."""
    step = max(1, len(resident) // count)
    chosen = resident.store[::step][:count]
    (height, width), (down, across) = resident.crop, BORDER
    cut = chosen[:, :, down : down + height, across : across + width]
    return [(one[None, :4], one[None, 4:]) for one in cut]


def train(sessions, seconds, out):
    """Trains all sessions side by side for `seconds`."""
    device = sessions[0].train.device
    wait = torch.cuda.synchronize if device.type == "cuda" else lambda: None
    began = time.monotonic()
    for session in sessions:
        session.capture()
        print(f"visit: {session.entry.name}: {sum(p.numel() for p in session.trainer.generator.parameters()) / 1e6:.2f} M weights, {len(session.train)} tuples", file=sys.stderr, flush=True)
    wait()

    def run(rounds):
        for _ in range(rounds):
            for session in sessions:
                session.step()
        wait()

    first = time.monotonic()
    run(ROUND_STEPS)
    pace = (time.monotonic() - first) / ROUND_STEPS
    left = seconds - (time.monotonic() - began)
    steps = max(sessions[0].trainer.step + ROUND_STEPS, int(PLANNED * left / pace))
    print(f"visit: {len(sessions)} trainings, {1000 * pace:.1f} ms for a step of all: {steps} steps in {left:.0f} s", file=sys.stderr, flush=True)
    for session in sessions:
        session.plan(steps)
        (out / session.entry.name / "config.json").write_text(json.dumps({"config": session.trainer.config.to_dict(), "data": session.entry.data, "pace_ms": 1000 * pace, "beside": len(sessions)}, indent=1))
    looked = time.monotonic()
    while sessions[0].trainer.step < steps and time.monotonic() - began < seconds:
        for session in sessions:
            session.schedule()
        run(min(ROUND_STEPS, steps - sessions[0].trainer.step))
        if time.monotonic() - looked > LOOK_S:
            look(sessions, out, began)
            looked = time.monotonic()
    look(sessions, out, began)


def look(sessions, out, began):
    """Judges all sessions and says how they stand."""
    for session in list(sessions):
        row = session.look(out / session.entry.name)
        text = "  ".join(f"{key} {row[key]:.2f} ({row[key + '_lq']:.2f})" for key in ("psnr_db", "pkl", "seen", "levels", "texture"))
        gan = f"  D {row['discriminator']:.3f} G {row['gan']:.3f}" if "gan" in row else ""
        print(f"{time.monotonic() - began:5.0f} s {session.entry.name} {row['step']}: {text}{gan}", file=sys.stderr, flush=True)
        if not all(abs(value) < 1e6 for value in row.values()):
            print(f"visit: {session.entry.name} ends: its figures are no numbers any more: {row}", file=sys.stderr, flush=True)
            sessions.remove(session)
    if not sessions:
        raise SystemExit("no training is left")


def named(text):
    """Name and folder of `NAME=DIR`."""
    name, equals, folder = text.partition("=")
    if not (name and equals and folder):
        raise argparse.ArgumentTypeError(f"`{text}`; it must be NAME=DIR")
    return name, folder


def open_data(entries, directories, jobs):
    """Data set, training tuples and held-out tuples by name of the entries' data."""
    found = {}
    for entry in entries:
        with torch.device("meta"):
            multiple = max(32, make(entry.config.network, 1).padding_multiple)
        if entry.data in found:
            data, train, _ = found[entry.data]
            if data.grid != BeamGrid.parse(entry.config.beam) or any(side % multiple for side in train.crop):
                raise SystemExit(f"plan: {entry.name}: trainings on {entry.data} must have one beam grid and one stride")
            continue
        if entry.data not in directories:
            raise SystemExit(f"plan: {entry.name} takes the data set {entry.data}: --data {entry.data}=DIR is missing")
        data = Dataset(directories[entry.data], BeamGrid.parse(entry.config.beam))
        found[entry.data] = (data, *(Resident(data, split, multiple, jobs) for split in ("train", "test")))
    return found


def main(argv=None):
    """Entry point of the command."""
    p = argparse.ArgumentParser(prog="insonify-visit", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("plan", type=Path)
    p.add_argument("--data", action="append", default=[], type=named, metavar="NAME=DIR", help="a data set that `insonify dataset` wrote")
    p.add_argument("--seconds", type=float, required=True, help="budget of the training")
    p.add_argument("--out", type=Path, required=True)
    p.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    p.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes that resample tuples [default: one a core]")
    args = p.parse_args(argv)
    try:
        rows = json.loads(args.plan.read_text())
    except (OSError, ValueError) as error:
        raise SystemExit(f"{args.plan}: {error}") from None
    if not isinstance(rows, list) or not rows:
        raise SystemExit(f"{args.plan}: no JSON list of trainings")
    entries = [Entry.of(row) for row in rows]
    names = [entry.name for entry in entries]
    if len(set(names)) < len(names):
        raise SystemExit("plan: two trainings have the same name")
    for name in names:
        if (args.out / name / "checkpoint.pt").exists():
            raise SystemExit(f"{args.out / name}: the weights of an earlier run are there: name another --out, or remove it")
    directories = dict(args.data)
    began = time.monotonic()
    try:
        data = open_data(entries, directories, args.jobs)
        for entry in entries:
            unlike = data[entry.data][0].unlike(entry.config)
            if unlike:
                raise SystemExit(f"plan: {entry.name}: {unlike[0]} of {entry.data} is {', '.join(map(str, unlike[1]))}")
    except (DatasetError, ValueError) as error:
        raise SystemExit(str(error)) from None
    device = torch.device(args.device)
    torch.backends.cudnn.benchmark = True
    torch.set_float32_matmul_precision("high")
    for of in data.values():
        for resident in of[1:]:
            resident.to(device)
    sessions = []
    for entry in entries:
        of, tuples, tests = data[entry.data]
        (args.out / entry.name).mkdir(parents=True, exist_ok=True)
        sessions.append(Session(entry, of, tuples, held_out(tests, LOOKED_AT), device.type == "cuda"))
    print(f"visit: tuples read in {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)
    going = list(sessions)
    train(going, args.seconds - (time.monotonic() - began), args.out)
    return 0 if len(going) == len(sessions) else ENDED


if __name__ == "__main__":
    sys.exit(main())
