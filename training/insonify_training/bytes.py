"""Gives an exported generator tensors of bytes: `python -m insonify_training.bytes assets/generators/NAME --out DIR/NAME`.

The converted graph takes uint8 [1, c, h, w] (grey levels, the mask as 0 or 255, classes, the attenuation after its power, times 255),
normalises it by the manifest's mappings, and gives rounded grey levels as uint8 [1, 1, h, w]. A quarter of the bytes travels to and
from a GPU. Each model of the manifest is converted, [[precision]] included, and checked on its parity pair: at most a grey level may
change by rounding.
"""

import argparse
import hashlib
import json
import re
import shutil
import sys
import tomllib
from pathlib import Path

import numpy as np

# Accepted difference on the parity pair, grey levels: values are rounded before the last step of the pair.
ROUNDING = 1.0
# Prefix of the names of what is added to a graph.
PREFIX = "insonify_bytes_"


class ConversionError(Exception):
    """Reason why a generator can't be converted."""


def normalisation(manifest):
    """Scale and offset of each channel of the input tensor, float32 [c]: value = scale · byte + offset."""
    scales, offsets = [], []
    for channel in manifest["input"]["channels"]:
        affine = manifest["input"][channel]
        scale, count = np.float32(affine["scale"]), 1
        if channel == "segmentation":
            table = manifest["segmentation"]
            count = len(table["classes"]) if table["encoding"] == "classes" else 1
        else:
            # As the station divides.
            scale = scale / np.float32(255)
        scales += [scale] * count
        offsets += [np.float32(affine["offset"])] * count
    return np.array(scales, np.float32), np.array(offsets, np.float32)


def convert(model, manifest):
    """The ONNX `model` with an input and an output of bytes, by the mappings of its manifest."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    made = onnx.ModelProto()
    made.CopyFrom(model)
    graph = made.graph
    names = manifest["input"]["name"], manifest["output"]["name"]
    entry = next((value for value in graph.input if value.name == names[0]), None)
    end = next((value for value in graph.output if value.name == names[1]), None)
    if entry is None or end is None:
        raise ConversionError(f"no tensors {names[0]} and {names[1]} in the graph")
    if entry.type.tensor_type.elem_type != TensorProto.FLOAT or end.type.tensor_type.elem_type != TensorProto.FLOAT:
        raise ConversionError(f"{names[0]} and {names[1]} must be of float32: was it converted before?")
    attributes = (attribute for node in graph.node for attribute in node.attribute)
    if any(one.type in (onnx.AttributeProto.GRAPH, onnx.AttributeProto.GRAPHS) for one in attributes):
        raise ConversionError("the graph has others within it")
    inner = PREFIX + "input", PREFIX + "output"
    for node in graph.node:
        for found in (node.input, node.output):
            for index, name in enumerate(found):
                found[index] = dict(zip(names, inner)).get(name, name)

    def constant(name, values):
        graph.initializer.append(numpy_helper.from_array(np.asarray(values, np.float32), PREFIX + name))
        return PREFIX + name

    def chain(source, target, steps):
        """Nodes of `steps` (operator, further inputs, attributes) from one tensor to another."""
        between = [f"{PREFIX}{source}_{index}" for index in range(1, len(steps))]
        return [
            helper.make_node(operator, [given, *others], [to], name=f"{PREFIX}to_{to}", **attributes)
            for (operator, others, attributes), given, to in zip(steps, [source, *between], [*between, target])
        ]

    scales, offsets = (values.reshape(1, -1, 1, 1) for values in normalisation(manifest))
    before = [("Cast", [], {"to": TensorProto.FLOAT}), ("Mul", [constant("scale", scales)], {})]
    if offsets.any():
        before.append(("Add", [constant("offset", offsets)], {}))
    output = manifest["output"]
    scale, offset = (np.float32(output[key]) * np.float32(255) for key in ("scale", "offset"))
    after = [("Mul", [constant("levels", scale)], {})]
    if offset:
        after.append(("Add", [constant("lift", offset)], {}))
    after += [
        ("Clip", [constant("black", 0), constant("white", 255)], {}),
        # Halves go to the even level, as in the station.
        ("Round", [], {}),
        ("Cast", [], {"to": TensorProto.UINT8}),
    ]
    nodes = [*chain(names[0], inner[0], before), *graph.node, *chain(inner[1], names[1], after)]
    del graph.node[:]
    graph.node.extend(nodes)
    for value in (entry, end):
        value.type.tensor_type.elem_type = TensorProto.UINT8
    onnx.checker.check_model(made, full_check=True)
    return made


def parity_bytes(planes, manifest):
    """Input of a converted model, uint8 [1, c, h, w], and the mask [h, w], of a parity pair's planes [4, h, w]."""
    image, classes, attenuation, mask = planes
    channels = []
    for channel in manifest["input"]["channels"]:
        if channel == "segmentation" and manifest["segmentation"]["encoding"] == "classes":
            channels += [classes == index for index in range(len(manifest["segmentation"]["classes"]))]
        elif channel == "attenuation":
            channels.append(np.rint(attenuation ** manifest["input"]["attenuation"].get("power", 1.0) * 255))
        else:
            channels.append({"image": image, "mask": np.where(mask > 0, 255, 0), "segmentation": classes}[channel])
    return np.stack(channels)[None].astype(np.uint8), mask > 0


def run(model, inputs, multiple, outside):
    """Levels [h, w] that a converted model gives for `inputs`, padded as in the station by `outside` [c]."""
    import onnxruntime

    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    height, width = inputs.shape[-2:]
    sides = [-(-side // multiple) * multiple for side in (height, width)]
    top, left = ((side - own) // 2 for side, own in zip(sides, (height, width)))
    whole = np.broadcast_to(outside.reshape(1, -1, 1, 1), (1, len(outside), *sides)).copy()
    whole[..., top : top + height, left : left + width] = inputs
    (found,) = session.run(None, {session.get_inputs()[0].name: whole})
    return found[0, 0, top : top + height, left : left + width]


def outside_of(manifest):
    """Bytes beyond the sector, uint8 [c]: 0, and the class `outside`."""
    values = []
    for channel in manifest["input"]["channels"]:
        if channel != "segmentation":
            values.append(0)
            continue
        table = manifest["segmentation"]
        name = table.get("of", {}).get("outside", "outside")
        index = table["classes"].index(name if name in table["classes"] else table.get("other"))
        values += [int(one == index) for one in range(len(table["classes"]))] if table["encoding"] == "classes" else [index]
    return np.array(values, np.uint8)


def convert_folder(folder, out):
    """Converts the generator in `folder` into the folder `out`; returns the figures of each model."""
    path = Path(folder) / f"{Path(folder).name}.toml"
    if not path.is_file():
        raise ConversionError(f"{folder}: no exported generator: {path.name} must be there")
    return convert_generator(path, Path(out))


def convert_generator(path, out):
    """As `convert_folder`, of the generator with the manifest at `path`."""
    import onnx

    text = path.read_text(encoding="utf-8")
    manifest = tomllib.loads(text)
    planes = np.load(path.with_name(manifest["parity"]["input"]))
    inputs, inside = parity_bytes(planes, manifest)
    models = [(path.with_suffix(".onnx"), manifest["sha256"], manifest["parity"])]
    models += [(path.with_name(one["model"]), one["sha256"], one) for one in manifest.get("precision", [])]
    out.mkdir(parents=True, exist_ok=True)
    if out.resolve() == path.parent.resolve():
        raise ConversionError(f"{out}: the generator itself is there; name another folder")
    figures = {}
    for file, sha256, pair in models:
        data = file.read_bytes()
        if hashlib.sha256(data).hexdigest() != sha256:
            raise ConversionError(f"{file}: its sum is not that of the manifest")
        made = convert(onnx.load(file), manifest)
        levels = run(made, inputs, manifest["padding_multiple"], outside_of(manifest)) * inside
        expected = np.load(path.with_name(pair["output"]))
        difference = float(np.abs(levels - expected).max())
        if not difference <= pair["tolerance"] + ROUNDING:
            raise ConversionError(f"{file}: {difference:.2f} grey levels off its parity pair")
        onnx.save(made, out / file.name)
        np.save(out / pair["output"], levels.astype(np.float32))
        text = text.replace(sha256, hashlib.sha256((out / file.name).read_bytes()).hexdigest())
        figures[file.name] = {"bytes": (out / file.name).stat().st_size, "levels": difference}
    tolerance = max(ROUNDING, manifest["parity"]["tolerance"])
    text = re.sub(r"(\[parity\][^\[]*?tolerance = )[\d.e-]+", lambda found: f"{found[1]}{tolerance}", text)
    (out / path.name).write_text(text, encoding="utf-8")
    shutil.copyfile(path.with_name(manifest["parity"]["input"]), out / manifest["parity"]["input"])
    return figures


def main(argv=None):
    """Entry point of the command."""
    p = argparse.ArgumentParser(prog="insonify-bytes", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("generator", type=Path, help="folder of the exported generator, named as it is")
    p.add_argument("--out", type=Path, required=True, help="folder to write")
    args = p.parse_args(argv)
    try:
        found = convert_folder(args.generator, args.out)
    except ConversionError as error:
        raise SystemExit(str(error)) from None
    print(json.dumps(found, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
