"""Adds int8 to an exported generator: `python -m insonify_training.int8 RUN --data DIR --out assets/generators/NAME`.

RUN is a run of the generator's configuration: it says how inputs are encoded. Writes NAME.int8.onnx (ONNX Runtime's static
quantisation: weights by channel, values by their range over training tuples) and NAME.int8.parity_output.npy, and names both in
[[precision]] of NAME.toml. The picture is judged on the test tuples: int8 may cost 0.2 dB.
"""

import argparse
import hashlib
import json
import re
import sys
import tempfile
import tomllib
from pathlib import Path

import numpy as np
import torch

from .dataset import Dataset, DatasetError
from .export import ExportError, grid_of, load_run, measure, padded, run_onnx, session, toml_value

# Tuples of the training split whose values set the ranges.
CALIBRATION = 20
# Accepted difference, grey levels, between machines: a rounding that differs moves a value by a step.
TOLERANCE = 4.0
# Most that int8 may cost, dB.
COST_DB = 0.2


# Exit code of a generator that int8 would cost more.
TOO_COSTLY = 3


class CostError(ExportError):
    """int8 costs more than it may; the generator is as it was."""


def quantise(model, inputs, out):
    """Writes `model` quantised to `out`; `inputs` are arrays [1, c, h, w] that set the ranges."""
    from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static
    from onnxruntime.quantization.shape_inference import quant_pre_process

    class Reader(CalibrationDataReader):
        def __init__(self):
            self.rest = iter(inputs)

        def get_next(self):
            values = next(self.rest, None)
            return None if values is None else {"input": values}

    with tempfile.TemporaryDirectory() as folder:
        prepared = Path(folder) / "prepared.onnx"
        quant_pre_process(str(model), str(prepared), skip_symbolic_shape=True)
        quantize_static(
            str(prepared), str(out), Reader(), quant_format=QuantFormat.QDQ, per_channel=True,
            activation_type=QuantType.QUInt8, weight_type=QuantType.QInt8,
            # Weights of 7 bits: without VNNI a processor adds two products in 16 bits, which 8 bits would overflow.
            reduce_range=True,
        )  # fmt: skip


def add(run, data, folder, frames=32):
    """Adds int8 to the generator in `folder`; returns the figures as a dictionary."""
    folder = Path(folder)
    name = folder.name
    model, manifest = folder / f"{name}.onnx", folder / f"{name}.toml"
    if not (model.is_file() and manifest.is_file()):
        raise ExportError(f"{folder}: no exported generator: {model.name} and {manifest.name} must be there")
    trainer, _ = load_run(run, data)
    encode, multiple = trainer.encode, trainer.generator.padding_multiple
    calibration = data.split("train")
    calibration = calibration[:: max(1, len(calibration) // CALIBRATION)][:CALIBRATION]
    if not calibration or not data.split("test"):
        raise ExportError(f"{data.directory}: no training or no test rows: they set the ranges and judge the picture")

    def encoded(row):
        inputs, _, _ = encode(np.array(data.planes(row))[None], np.array(data.mask(row))[None, None])
        return padded(inputs, multiple, encode.outside).numpy()

    made, output = folder / f"{name}.int8.onnx", folder / f"{name}.int8.parity_output.npy"
    # What is there stays until the new one is judged.
    new = made.with_suffix(".new")
    quantise(model, (encoded(row) for row in calibration), new)
    small, whole = session(new), session(model)

    planes = np.load(folder / f"{name}.parity_input.npy")
    inputs, inside = parity_input(planes, tomllib.loads(manifest.read_text(encoding="utf-8")))
    found = run_onnx(small, inputs, multiple, encode.outside).clamp(0, 1) * inside
    psnr_db = [float(measure(trainer, ort, multiple, data, frames)[0][0]) for ort in (whole, small)]
    if not psnr_db[1] > psnr_db[0] - COST_DB:
        new.unlink()
        raise CostError(f"{made}: int8 costs {psnr_db[0] - psnr_db[1]:.2f} dB, of at most {COST_DB}; left out")
    new.replace(made)
    np.save(output, (found[0, 0] * 255).numpy().astype(np.float32))
    table = {
        "name": "int8",
        "model": made.name,
        "sha256": hashlib.sha256(made.read_bytes()).hexdigest(),
        "output": output.name,
        "tolerance": TOLERANCE,
        "psnr_db": round(psnr_db[1], 3),
    }
    text = re.sub(r'\n\[\[precision\]\]\nname = "int8"\n[^\[]*', "\n", manifest.read_text(encoding="utf-8")).rstrip("\n")
    lines = ["", "[[precision]]", *(f"{key} = {toml_value(value)}" for key, value in table.items())]
    manifest.write_text(text + "\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return {"model": str(made), "bytes": made.stat().st_size, "psnr_db": psnr_db[1], "psnr_db_float32": psnr_db[0]}


def parity_input(planes, manifest):
    """Input of the model [1, c, h, w] and mask [1, 1, h, w] of a parity pair's planes [4, h, w], by the manifest."""
    image, classes, attenuation, mask = (torch.from_numpy(np.ascontiguousarray(plane)) for plane in planes)
    inside = (mask > 0).float()
    of = {"image": image / 255, "mask": inside, "segmentation": classes, "attenuation": attenuation}
    channels = []
    for name in manifest["input"]["channels"]:
        affine = manifest["input"][name]
        channels.append(of[name] ** affine.get("power", 1.0) * affine["scale"] + affine["offset"])
    return torch.stack(channels)[None].float(), inside[None, None]


def main(argv=None):
    """Entry point of the command."""
    p = argparse.ArgumentParser(prog="insonify-int8", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("run", type=Path, help="folder of a run of the generator's configuration")
    p.add_argument("--data", type=Path, required=True, help="data set: training tuples set the ranges, test tuples judge")
    p.add_argument("--out", type=Path, required=True, help="folder of the exported generator, named as it is")
    p.add_argument("--frames", type=int, default=32, help="test frames that judge it [default: 32]")
    p.add_argument("--threads", type=int, default=2)
    args = p.parse_args(argv)
    torch.set_num_threads(args.threads)
    try:
        found = add(args.run, Dataset(args.data, grid_of(args.run)), args.out, args.frames)
    except CostError as error:
        print(error, file=sys.stderr)
        return TOO_COSTLY
    except (ExportError, DatasetError) as error:
        raise SystemExit(str(error)) from None
    print(json.dumps(found, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
