"""Exports a run for the station: `python -m insonify_training.export RUN --data DIR --out assets/generators/NAME`.

Writes NAME.onnx (the norms' statistics frozen and folded into the convolutions, height and width free),
NAME.toml (its manifest), NAME.parity_input.npy and NAME.parity_output.npy, and checks them in ONNX Runtime.
"""

import argparse
import hashlib
import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch

from .beam import BeamGrid
from .channels import VARIANTS
from .dataset import ATTENUATION, LQ, SEGMENTATION, Dataset, DatasetError
from .networks import fold, freeze
from .quality import pkl, psnr_db, ssim
from .generators import Config
from .trainer import Trainer, read_checkpoint

OPSET = 18
# Height and width of the parity pair.
PARITY_SIZE = (128, 160)
# Accepted difference, grey levels, by another machine's arithmetic.
TOLERANCE = 0.25
# Accepted difference, grey levels, between ONNX Runtime and PyTorch on this machine.
AGREES = 0.05


class ExportError(Exception):
    """Reason why a run can't be exported."""


def read_run(folder):
    """State and configuration of a run's checkpoint."""
    checkpoint = Path(folder) / "checkpoint.pt"
    if not checkpoint.is_file():
        raise ExportError(f"{folder}: no run: checkpoint.pt must be there")
    state = read_checkpoint(checkpoint)
    try:
        return state, Config.from_dict(state["config"])
    except ValueError as error:
        raise ExportError(f"{checkpoint}: made by another version ({error}): train it anew") from None


def grid_of(folder):
    """Beam coordinates of a run; none if it is of pictures."""
    return BeamGrid.parse(read_run(folder)[1].beam)


def load_run(folder, data):
    """Trainer of a run, its norms frozen, and the SHA-256 of its training data; `data` is in the run's coordinates."""
    state, config = read_run(folder)
    grid = BeamGrid.parse(config.beam)
    if grid != data.grid:
        named = lambda one: f"beam coordinates {one}" if one else "pictures"  # noqa: E731
        raise ExportError(f"{folder}: the run is of {named(grid)}, the others are of {named(data.grid)}: name it alone")
    trainer = Trainer(config, data)
    trainer.load(state)
    trainer.generator = trainer.shown
    freeze(trainer.generator.eval())
    return trainer, state.get("data_sha256")


def write_onnx(network, channels, path):
    """Writes `network` as ONNX with a free height and width."""
    multiple = network.padding_multiple
    sample = torch.zeros(1, channels, multiple, 2 * multiple)
    axes = {"input": {2: "height", 3: "width"}, "output": {2: "height", 3: "width"}}
    torch.onnx.export(
        network.to(memory_format=torch.contiguous_format), (sample,), str(path), dynamo=False, opset_version=OPSET,
        input_names=["input"], output_names=["output"], dynamic_axes=axes,
    )


def place(size, multiple):
    """Padded size of `size` (height, width) as in the station, and the slices of rows and columns that it occupies."""
    sides = [-(-n // multiple) * multiple for n in size]
    begins = [(side - n) // 2 for side, n in zip(sides, size)]
    return sides, tuple(slice(begin, begin + n) for begin, n in zip(begins, size))


def padded(inputs, multiple, outside):
    """`inputs` [n, c, h, w] padded by `outside` [1, c, 1, 1] to sides that are a multiple, as in the station."""
    sides, at = place(inputs.shape[-2:], multiple)
    out = outside.expand(*inputs.shape[:2], *sides).clone()
    out[(..., *at)] = inputs
    return out


def run_onnx(session, inputs, multiple, outside):
    """Output [n, 1, h, w] of the model for inputs of any size."""
    _, at = place(inputs.shape[-2:], multiple)
    return torch.from_numpy(
        np.concatenate(
            [session.run(None, {"input": padded(one[None], multiple, outside).numpy()})[0] for one in inputs]
        )
    )[(..., *at)]


@torch.no_grad()
def run_torch(network, inputs, outside, device="cpu"):
    """Output [n, 1, h, w] of a network on `device` for inputs of any size, padded as in the station."""
    _, at = place(inputs.shape[-2:], network.padding_multiple)
    return network(padded(inputs, network.padding_multiple, outside).to(device)).cpu()[(..., *at)]


def session(path, threads=2):
    """An ONNX Runtime session on the CPU."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


def parity_planes(data, segmentation):
    """Planes float32 [4, h, w] of a parity pair, from a part of a test tuple with bone or many tissues."""
    rows = data.split("test")[:8]
    # A grid may have fewer scanlines.
    height, width = (min(side, *sizes) for side, sizes in zip(PARITY_SIZE, zip(*(row.size[::-1] for row in rows))))
    best, found = -1, None
    for row in rows:
        planes, mask = data.planes(row), data.mask(row)
        for y in range(0, row.size[1] - height + 1, height // 2):
            for x in range(0, row.size[0] - width + 1, width // 2):
                at = np.s_[y : y + height, x : x + width]
                kinds = len(np.unique(planes[SEGMENTATION][at]))
                # With the sector's edge included, the mask is tested as well.
                score = kinds + 2 * (0.05 < (mask[at] == 0).mean() < 0.4)
                if score > best:
                    best, found = score, (np.array(planes[(slice(None), *at)]), np.array(mask[at]))
    planes, mask = found
    indices = segmentation.indices(data.classes)
    attenuation = (planes[ATTENUATION] / 255.0) ** (1 / data.attenuation_power)
    return np.stack(
        [planes[LQ], indices[planes[SEGMENTATION]], attenuation, mask]
    ).astype(np.float32), planes, mask


def toml_value(value):
    """A value in TOML syntax."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return json.dumps(value)


def write_manifest(path, head, tables):
    """Writes the keys `head` and `tables` as TOML."""
    lines = ["# Written by training/insonify_training/export.py."]
    lines += [f"{key} = {toml_value(value)}" for key, value in head.items()]
    for name, table in tables.items():
        lines += ["", f"[{name}]"]
        nested = {key: value for key, value in table.items() if name == "segmentation" and isinstance(value, dict)}
        lines += [f"{key} = {toml_value(value)}" for key, value in table.items() if key not in nested]
        for key, value in nested.items():
            lines += ["", f"[{name}.{key}]", *(f"{one} = {toml_value(of)}" for one, of in value.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def on_picture(config, sampling, output, lq):
    """Picture [height, width] within 0..=1 of a network's output on the grid, as the station makes it; `lq` are its grey levels."""
    levels = 255 * output
    levels = sampling.corrected(levels, lq, config.detail_kept) if config.detail_kept > 0 else sampling.picture(levels)
    return torch.from_numpy(levels).float() / 255


def measure(trainer, ort, multiple, data, frames):
    """Mean PSNR, SSIM and pKL inside the sector of test tuples, full field of view: of the exported model [3], of LQ [3].

    They are of pictures, also if the model is in beam coordinates.
    """
    rows = data.split("test")
    rows = rows[:: max(1, len(rows) // frames)][:frames]
    values = []
    for row in rows:
        planes, mask = np.array(data.planes(row))[None], np.array(data.mask(row))[None, None]
        inputs, target, inside = trainer.encode(planes, mask)
        output = run_onnx(ort, inputs, multiple, trainer.encode.outside).clamp(0, 1) * inside
        if data.grid:
            planes, mask = (part[None] for part in data.picture(row))
            output = on_picture(trainer.config, data.sampling(row), output[0, 0].numpy(), planes[0, LQ])[None, None]
            _, target, inside = trainer.encode(np.array(planes), mask[None])
        lq = torch.from_numpy(planes[:, LQ : LQ + 1]).float() / 255 * inside
        values.append([[f(p, target, inside).item() for f in (psnr_db, ssim, pkl)] for p in (output, lq)])
    return np.mean(values, axis=0)


def export(run, data, out, description=None, frames=32, name=None):
    """Exports the run in folder `run` to folder `out`; returns the figures as a dictionary."""
    out = Path(out)
    name = name or out.name
    if not data.split("test"):
        raise ExportError(f"{data.directory}: no test rows: the parity pair and the quality are of them")
    trainer, data_sha256 = load_run(run, data)
    config, encode = trainer.config, trainer.encode
    network = fold(trainer.generator)
    multiple = network.padding_multiple
    out.mkdir(parents=True, exist_ok=True)
    model = out / f"{name}.onnx"
    write_onnx(network, encode.channels, model)
    ort = session(model)

    parity, planes, mask = parity_planes(data, trainer.segmentation)
    inputs, _, inside = encode(planes[None], mask[None, None])
    whole = padded(inputs, multiple, encode.outside)
    with torch.no_grad():
        _, at = place(mask.shape, multiple)
        live, expected = (of(whole)[(..., *at)].clamp(0, 1) * inside for of in (trainer.generator, network))
    found = run_onnx(ort, inputs, multiple, encode.outside).clamp(0, 1) * inside
    differences = {
        "folded_levels": (expected - live).abs().max().item() * 255,
        "onnxruntime_levels": (expected - found).abs().max().item() * 255,
    }
    if not max(differences.values()) < AGREES:
        raise ExportError(f"{model}: differs from PyTorch by more than {AGREES} grey levels: {differences}")
    np.save(out / f"{name}.parity_input.npy", parity)
    np.save(out / f"{name}.parity_output.npy", (expected[0, 0] * 255).numpy().astype(np.float32))

    made, lq = measure(trainer, ort, multiple, data, frames)
    unit = {"scale": 1.0, "offset": 0.0}
    channels = VARIANTS[config.variant]
    affine = {channel: dict(unit) for channel in channels}
    tables = {"input": {"name": "input", "channels": list(channels), **affine}}
    if "segmentation" in channels:
        affine["segmentation"]["scale"] = trainer.segmentation.scale
        tables["segmentation"] = trainer.segmentation.manifest()
    if "attenuation" in channels and config.attenuation_power != 1.0:
        affine["attenuation"]["power"] = config.attenuation_power
    if data.grid:
        tables["beam"] = {"scanlines": data.grid.scanlines, "cell_mm": data.grid.cell_mm, **({"detail_kept": config.detail_kept} if config.detail_kept > 0 else {})}
    tables["output"] = {"name": "output", **unit}
    tables["parity"] = {
        "input": f"{name}.parity_input.npy", "output": f"{name}.parity_output.npy", "tolerance": TOLERANCE,
    }
    tables["training"] = {
        "data_sha256": data_sha256 or data.sha256(), "iterations": trainer.step, "lq": asdict(data.lq[0]),
        **({"lq_more": [asdict(lq) for lq in data.lq[1:]]} if data.lq[1:] else {}), "hq": asdict(data.hq),
    }
    tables["quality"] = {
        "psnr_db": round(float(made[0]), 3), "ssim": round(float(made[1]), 4), "lq_psnr_db": round(float(lq[0]), 3),
    }
    head = {
        "format": 1,
        "name": name,
        "description": description or f"{config.network}, {config.variant}: {', '.join(map(str, data.lq))} to {data.hq}.",
        "kind": "trained",
        "variant": config.variant,
        "sha256": hashlib.sha256(model.read_bytes()).hexdigest(),
        "padding_multiple": multiple,
    }
    write_manifest(out / f"{name}.toml", head, tables)
    return {
        "model": str(model), "bytes": model.stat().st_size, "iterations": trainer.step, **differences,
        **{key: float(value) for key, value in zip(("psnr_db", "ssim", "pkl"), made)},
        **{f"{key}_lq": float(value) for key, value in zip(("psnr_db", "ssim", "pkl"), lq)},
    }


def main(argv=None):
    """Entry point of the command."""
    p = argparse.ArgumentParser(prog="insonify-export", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("run", type=Path, help="folder of the run")
    p.add_argument("--data", type=Path, required=True, help="data set: its test split gives the parity pair and quality")
    p.add_argument("--out", type=Path, required=True, help="folder to write; its name is the generator's")
    p.add_argument("--description", help="a sentence for the manifest")
    p.add_argument("--frames", type=int, default=32, help="test frames for [quality] [default: 32]")
    p.add_argument("--threads", type=int, default=2)
    args = p.parse_args(argv)
    torch.set_num_threads(args.threads)
    try:
        found = export(args.run, Dataset(args.data, grid_of(args.run)), args.out, args.description, args.frames)
    except (ExportError, DatasetError) as error:
        raise SystemExit(str(error)) from None
    print(json.dumps(found, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
