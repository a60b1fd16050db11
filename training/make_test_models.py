#!/usr/bin/env python3
"""Builds ONNX models of known effect: those of the tests, and the fixed filter of the demo.

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install onnx==1.23.2 numpy
    /tmp/venv/bin/python training/make_test_models.py

Writes tests/data/generators/*.onnx and assets/generators/demo_smooth/, each with its manifest and parity pair.
Nothing here is trained. Expected outputs come from ONNX's reference evaluator, not from the runtime under test.
"""

import hashlib
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator

from insonify_training.bytes import convert

ROOT = Path(__file__).resolve().parent.parent
TESTS = ROOT / "tests/data/generators"
DEMO = ROOT / "assets/generators/demo_smooth"
CLASSES = ["outside", "amniotic_fluid", "placenta", "skull"]
# 8-bit channels to -1..=1 and back, as in pix2pix.
SIGNED = {"scale": 2.0, "offset": -1.0}
SIGNED_OUTPUT = {"scale": 0.5, "offset": 0.5}
UNIT = {"scale": 1.0, "offset": 0.0}


class Graph:
    """Nodes and constants of a model with one input and one output."""

    def __init__(self):
        self.nodes, self.constants = [], []

    def floats(self, name, values):
        self.constants.append(numpy_helper.from_array(np.asarray(values, dtype=np.float32), name))
        return name

    def integers(self, name, values):
        self.constants.append(numpy_helper.from_array(np.asarray(values, dtype=np.int64), name))
        return name

    def node(self, operator, inputs, outputs, **attributes):
        outputs = [outputs] if isinstance(outputs, str) else outputs
        self.nodes.append(helper.make_node(operator, inputs, outputs, name=outputs[0], **attributes))
        return outputs[0]

    def channel(self, index, name):
        """Channel `index` of the input."""
        start, end = self.integers(f"{name}_start", [index]), self.integers(f"{name}_end", [index + 1])
        axis = self.integers(f"{name}_axis", [1])
        return self.node("Slice", ["input", start, end, axis], name)

    def model(self, channels, size=("height", "width")):
        value = helper.make_tensor_value_info
        graph = helper.make_graph(
            self.nodes,
            "generator",
            [value("input", TensorProto.FLOAT, [1, channels, *size])],
            [value("output", TensorProto.FLOAT, [1, 1, *size])],
            self.constants,
        )
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
        onnx.checker.check_model(model, full_check=True)
        return model


@dataclass
class Generator:
    """A model and the content of its manifest."""

    name: str
    description: str
    model: onnx.ModelProto
    channels: dict
    output: dict = field(default_factory=lambda: dict(UNIT))
    multiple: int = 1
    # Scanlines and length of a range cell in mm of a model in beam coordinates.
    beam: tuple = None
    encoding: str = "map"
    classes: list = field(default_factory=lambda: list(CLASSES))
    # Class of each tissue that has none of its own, and the class of all others.
    of: dict = field(default_factory=dict)
    other: str = ""
    parity: np.ndarray = None
    # Added to one expected level, so that the pair is wrong.
    parity_error: float = 0.0
    tolerance: float = 0.01
    # Whether its tensors are of bytes, and the graph does the mappings.
    of_bytes: bool = False

    @property
    def variant(self):
        if "image" not in self.channels:
            return "Maps"
        return "MSA" if "attenuation" in self.channels else "MS" if "segmentation" in self.channels else "M"


def identity():
    g = Graph()
    image = g.channel(0, "image")
    g.node("Identity", [image], "output")
    return g.model(2)


def brightness():
    g = Graph()
    image = g.channel(0, "image")
    g.node("Mul", [image, g.floats("gain", 1.25)], "scaled")
    g.node("Add", ["scaled", g.floats("lift", 0.1)], "output")
    return g.model(2)


def blur():
    """Mean of 3 x 3 pixels, zero beyond the tensor."""
    g = Graph()
    weights = np.zeros((1, 2, 3, 3))
    weights[0, 0] = 1 / 9
    g.node("Conv", ["input", g.floats("weights", weights)], "output", kernel_shape=[3, 3], pads=[1, 1, 1, 1])
    return g.model(2)


def block_mean():
    """Half of each pixel plus half of the mean of its 64 x 64 block; other sizes are errors."""
    g = Graph()
    image = g.channel(0, "image")
    g.node("AveragePool", [image], "means", kernel_shape=[64, 64], strides=[64, 64])
    g.floats("scales", [1, 1, 64, 64])
    g.node("Resize", ["means", "", "scales"], "blocks", mode="nearest", nearest_mode="floor",
           coordinate_transformation_mode="asymmetric")
    g.node("Add", [image, "blocks"], "sum")
    g.node("Mul", ["sum", g.floats("half", 0.5)], "output")
    return g.model(2)


def inverted_class():
    """Channels image, mask, segmentation: inverts the image in class 2."""
    g = Graph()
    image, classes = g.channel(0, "image"), g.channel(2, "classes")
    g.node("Equal", [classes, g.floats("two", 2.0)], "in_class")
    g.node("Sub", [g.floats("one", 1.0), image], "inverse")
    g.node("Where", ["in_class", "inverse", image], "output")
    return g.model(3)


def weighted_maps():
    """Channels attenuation, segmentation, image, mask: 0.5 image + 0.1 class + 0.2 attenuation."""
    g = Graph()
    weights = np.array([0.2, 0.1, 0.5, 0.0]).reshape(1, 4, 1, 1)
    g.node("Conv", ["input", g.floats("weights", weights)], "output", kernel_shape=[1, 1])
    return g.model(4)


def class_levels():
    """Channels mask, one per class, image: a level for each class, 0.2 apart, plus a tenth of the image."""
    g = Graph()
    weights = np.array([0.0, 0.1, 0.3, 0.5, 0.7, 0.1]).reshape(1, 6, 1, 1)
    g.node("Conv", ["input", g.floats("weights", weights)], "output", kernel_shape=[1, 1])
    return g.model(6)


def maps_only():
    """Channels one per class, attenuation, mask: a level for each class, 0.2 apart, plus 0.2 of the attenuation."""
    g = Graph()
    weights = np.array([0.0, 0.2, 0.4, 0.6, 0.2, 0.0]).reshape(1, 6, 1, 1)
    g.node("Conv", ["input", g.floats("weights", weights)], "output", kernel_shape=[1, 1])
    return g.model(6)


def not_a_number():
    """Square root of 0.9 minus the image: NaN where the image is brighter."""
    g = Graph()
    image = g.channel(0, "image")
    g.node("Sub", [g.floats("limit", 0.9), image], "rest")
    g.node("Sqrt", ["rest"], "output")
    return g.model(2)


def endless():
    """The image, after a loop whose count is the cube of its first pixel's level: 0 for 0, 16 million for 255."""
    g = Graph()
    image = g.channel(0, "image")
    g.integers("corner_start", [0, 0, 0, 0])
    g.integers("corner_end", [1, 1, 1, 1])
    g.node("Slice", [image, "corner_start", "corner_end"], "corner")
    g.node("Reshape", ["corner", g.integers("scalar", [])], "unit")
    g.node("Mul", ["unit", g.floats("levels", 255.0)], "level")
    g.node("Mul", ["level", "level"], "squared")
    g.node("Mul", ["squared", "level"], "cubed")
    g.node("Cast", ["cubed"], "turns", to=TensorProto.INT64)
    g.constants.append(numpy_helper.from_array(np.asarray(True), "always"))
    value = helper.make_tensor_value_info
    body = helper.make_graph(
        [helper.make_node("Identity", ["keep_in"], ["keep_out"]), helper.make_node("Neg", ["carried_in"], ["negated"]),
         helper.make_node("Neg", ["negated"], ["carried_out"])],
        "turn",
        [value("turn", TensorProto.INT64, []), value("keep_in", TensorProto.BOOL, []),
         value("carried_in", TensorProto.FLOAT, None)],
        [value("keep_out", TensorProto.BOOL, []), value("carried_out", TensorProto.FLOAT, None)],
    )
    g.node("Loop", ["turns", "always", image], "output", body=body)
    return g.model(2)


def slow():
    """The image, after convolutions of 16 channels without effect: some hundred milliseconds at 1386 x 1000."""
    g = Graph()
    rng = np.random.default_rng(1)
    first = np.zeros((16, 2, 3, 3))
    first[:, 0, 1, 1] = 1.0
    previous = g.node("Conv", ["input", g.floats("w0", first)], "c0", kernel_shape=[3, 3], pads=[1] * 4)
    for i in range(1, 5):
        # Rows sum to one at the centre, and all other taps cancel over equal channels.
        weights = rng.normal(scale=0.01, size=(16, 16, 3, 3))
        weights -= weights.mean(axis=1, keepdims=True)
        weights[:, :, 1, 1] += 1 / 16
        previous = g.node("Conv", [previous, g.floats(f"w{i}", weights)], f"c{i}", kernel_shape=[3, 3], pads=[1] * 4)
    g.node("ReduceMean", [previous, g.integers("axes", [1])], "output", keepdims=1)
    return g.model(2)


def demo_smooth():
    """Self-guided edge-preserving filter with statistics at a quarter of the resolution.

    He and Sun, Fast Guided Filter (arXiv:1505.00996), with means over the sector only: output = a image + b. In each
    neighbourhood of mean u and variance v, a = v / (v + 0.01) and b = (1 - a) u. Both are smoothed and brought to
    full resolution by bilinear interpolation.
    """
    g = Graph()
    image = g.channel(0, "image")
    box = np.zeros((2, 2, 4, 4))
    box[0, 0] = box[1, 1] = 1 / 16
    g.node("Conv", ["input", g.floats("box", box)], "low", kernel_shape=[4, 4], strides=[4, 4])
    g.node("Split", ["low"], ["low_image", "low_mask"], axis=1, num_outputs=2)
    g.node("Mul", ["low_image", "low_image"], "low_square")
    g.node("Concat", ["low_image", "low_mask", "low_square"], "low_maps", axis=1)

    def binomial(source, target, taps):
        kernel = np.array([1.0])
        for _ in range(taps - 1):
            kernel = np.convolve(kernel, [0.5, 0.5])
        half = taps // 2
        rows, columns = np.tile(kernel.reshape(1, 1, -1, 1), (3, 1, 1, 1)), np.tile(kernel, (3, 1, 1, 1))
        g.node("Conv", [source, g.floats(f"{target}_rows", rows)], f"{target}_half", group=3,
               kernel_shape=[taps, 1], pads=[half, 0, half, 0])
        g.node("Conv", [f"{target}_half", g.floats(f"{target}_columns", columns)], target, group=3,
               kernel_shape=[1, taps], pads=[0, half, 0, half])

    binomial("low_maps", "moments", 5)
    g.node("Split", ["moments"], ["sum_image", "weight", "sum_square"], axis=1, num_outputs=3)
    least = g.floats("least_weight", 1e-3)
    g.node("Max", ["weight", least], "safe_weight")
    g.node("Div", ["sum_image", "safe_weight"], "mean")
    g.node("Div", ["sum_square", "safe_weight"], "mean_square")
    g.node("Mul", ["mean", "mean"], "square_mean")
    g.node("Sub", ["mean_square", "square_mean"], "difference")
    g.node("Relu", ["difference"], "variance")
    g.node("Add", ["variance", g.floats("speckle_variance", 0.01)], "total")
    g.node("Div", ["variance", "total"], "a")
    g.node("Sub", [g.floats("one", 1.0), "a"], "not_a")
    g.node("Mul", ["mean", "not_a"], "b")
    g.node("Mul", ["a", "weight"], "a_weighted")
    g.node("Mul", ["b", "weight"], "b_weighted")
    g.node("Concat", ["a_weighted", "b_weighted", "weight"], "coefficients", axis=1)
    binomial("coefficients", "smooth", 3)
    g.node("Split", ["smooth"], ["a_sum", "b_sum", "smooth_weight"], axis=1, num_outputs=3)
    g.node("Max", ["smooth_weight", least], "divisor")
    g.floats("scales", [1, 1, 4, 4])
    for name in "ab":
        g.node("Div", [f"{name}_sum", "divisor"], f"{name}_low")
        g.node("Resize", [f"{name}_low", "", "scales"], f"{name}_full", mode="linear",
               coordinate_transformation_mode="half_pixel")
    g.node("Mul", ["a_full", image], "kept")
    g.node("Add", ["kept", "b_full"], "output")
    return g.model(2)


def parity_planes(height=40, width=36, brightest=255):
    """Image 0..=255, class, attenuation 0..=1, mask 0 or 255: speckle in a sector with two classes and a shadow."""
    rng = np.random.default_rng(7)
    y, x = np.mgrid[0:height, 0:width]
    mask = np.abs(x - width / 2) < 6 + 0.4 * y
    classes = np.where((x - width / 2) ** 2 + (y - 0.6 * height) ** 2 < 60, 2, 1)
    classes = np.where(y > 0.85 * height, 3, classes) * mask
    attenuation = np.exp(-y / height) * np.where(x > 0.6 * width, 0.5, 1.0) * mask
    speckle = rng.rayleigh(0.3, size=mask.shape) * (0.5 + 0.5 * (classes == 2))
    image = np.round(np.clip(speckle * 255, 0, brightest)) * mask
    image[0, 0] = 0
    return np.stack([image, classes, attenuation, mask * 255.0]).astype(np.float32)


def margins(n, multiple):
    """Padding of `n` pixels to a multiple, before and behind: equal halves, an odd pixel behind."""
    missing = -n % multiple
    return missing // 2, missing - missing // 2


def tensor(generator, planes):
    """Normalised input of the model, surrounded by the values of outside; these are zeros before normalisation."""
    padding = ((0, 0), *(margins(n, generator.multiple) for n in planes.shape[1:]))
    # The class `outside` is the first.
    image, classes, attenuation, mask = np.pad(planes.astype(np.float64), padding)
    raw = {"image": image / 255, "mask": mask / 255, "attenuation": attenuation, "segmentation": classes}
    channels = []
    for name, affine in generator.channels.items():
        maps = [raw[name]]
        if name == "segmentation" and generator.encoding == "classes":
            maps = [(classes == c).astype(np.float64) for c in range(len(generator.classes))]
        channels += [m * affine["scale"] + affine["offset"] for m in maps]
    return np.stack(channels)[None].astype(np.float32)


def levels(generator, planes):
    """Grey levels expected of the generator, not rounded; 0 outside the mask."""
    (output,) = ReferenceEvaluator(generator.model).run(None, {"input": tensor(generator, planes)})
    top, left = (margins(n, generator.multiple)[0] for n in planes.shape[1:])
    height, width = planes.shape[1:]
    unit = output[0, 0, top : top + height, left : left + width].astype(np.float64) * generator.output["scale"] + generator.output["offset"]
    return (np.clip(unit * 255, 0, 255) * (planes[3] > 0)).astype(np.float32)


def write(generator, directory):
    directory.mkdir(parents=True, exist_ok=True)
    stem = directory / generator.name
    planes = parity_planes() if generator.parity is None else generator.parity
    parity_input = "speckle.npy" if generator.parity is None else f"{generator.name}.parity_input.npy"
    expected = levels(generator, planes)
    assert np.isfinite(expected).all(), generator.name
    if generator.of_bytes:
        expected = np.rint(expected)
    if generator.parity_error:
        expected[20, 17] += generator.parity_error
    np.save(directory / parity_input, planes)
    np.save(f"{stem}.parity_output.npy", expected)
    names = ", ".join(f'"{name}"' for name in generator.channels)
    text = f"""# Written by training/make_test_models.py.
format = 1
name = "{generator.name}"
description = "{generator.description}"
kind = "fixed-filter"
variant = "{generator.variant}"
sha256 = "SUM"
padding_multiple = {generator.multiple}

[input]
name = "input"
channels = [{names}]
"""
    for name, affine in generator.channels.items():
        text += f"{name} = {{ scale = {affine['scale']}, offset = {affine['offset']} }}\n"
    if "segmentation" in generator.channels:
        classes = ", ".join(f'"{name}"' for name in generator.classes)
        text += f'\n[segmentation]\nencoding = "{generator.encoding}"\nclasses = [{classes}]\n'
        text += f'other = "{generator.other}"\n' if generator.other else ""
        text += "\n[segmentation.of]\n" if generator.of else ""
        text += "".join(f'{tissue} = "{name}"\n' for tissue, name in generator.of.items())
    if generator.beam:
        text += f"\n[beam]\nscanlines = {generator.beam[0]}\ncell_mm = {generator.beam[1]}\n"
    text += f"""
[output]
name = "output"
scale = {generator.output["scale"]}
offset = {generator.output["offset"]}

[parity]
input = "{parity_input}"
output = "{generator.name}.parity_output.npy"
tolerance = {generator.tolerance}
"""
    made = convert(generator.model, tomllib.loads(text)) if generator.of_bytes else generator.model
    model = made.SerializeToString(deterministic=True)
    stem.with_suffix(".onnx").write_bytes(model)
    stem.with_suffix(".toml").write_text(text.replace("SUM", hashlib.sha256(model).hexdigest()))


def main():
    m = {"image": UNIT, "mask": UNIT}
    signed = {"image": SIGNED, "mask": UNIT}
    msa = {"attenuation": UNIT, "segmentation": UNIT, "image": UNIT, "mask": UNIT}
    by_class = {"mask": UNIT, "segmentation": UNIT, "image": UNIT}
    generators = [
        Generator("identity", "Test: the image as it is, through -1..=1.", identity(), signed, output=SIGNED_OUTPUT),
        Generator("identity_beam", "Test: the image as it is, in beam coordinates.", identity(), signed,
                  output=SIGNED_OUTPUT, beam=(128, 0.25)),
        Generator("brightness", "Test: 1.25 times the image and 0.1.", brightness(), m),
        Generator("blur", "Test: the mean of 3 x 3 pixels.", blur(), m),
        Generator("blur_padded", "Test: the mean of 3 x 3 pixels, sizes in multiples of 16.", blur(), m, multiple=16),
        Generator("block_mean", "Test: blends each pixel with its block of 64 x 64.", block_mean(), m, multiple=64),
        Generator("inverted_class", "Test: inverts class 2.", inverted_class(), {**m, "segmentation": UNIT}),
        Generator("weighted_maps", "Test: a sum of image, class and attenuation.", weighted_maps(), msa),
        Generator("class_levels", "Test: a level for each class.", class_levels(), by_class, encoding="classes"),
        Generator("maps_only", "Test: a level for each group of tissues, and the attenuation.", maps_only(),
                  {"segmentation": UNIT, "attenuation": UNIT, "mask": UNIT}, encoding="classes",
                  classes=["outside", "fluid", "soft", "hard"],
                  of={"amniotic_fluid": "fluid", "skull": "hard", "calvaria": "hard"}, other="soft"),
        Generator("not_a_number", "Test: NaN where the image is brighter than 0.9.", not_a_number(), m,
                  parity=parity_planes(brightest=200)),
        Generator("endless", "Test: loops the longer, the brighter the first pixel is.", endless(), m),
        Generator("slow", "Test: the image, slowly.", slow(), m, tolerance=0.05),
        Generator("wrong_parity", "Test: the identity with a parity pair that is wrong at one pixel.", identity(),
                  signed, output=SIGNED_OUTPUT, parity_error=3.0),
    ]
    of_bytes = ("identity_beam", "weighted_maps", "class_levels")
    generators += [
        replace(one, name=f"{one.name}_bytes", description=f"{one.description[:-1]}, with tensors of bytes.", tolerance=1.0, of_bytes=True)
        for one in generators
        if one.name in of_bytes
    ]
    for generator in generators:
        write(generator, TESTS)
    demo = Generator(
        "demo_smooth",
        "Shows the stage, and is no trained generator: a fixed edge-preserving filter that calms speckle.",
        demo_smooth(), m, multiple=4, parity=parity_planes(96, 84), tolerance=0.05,
    )
    write(demo, DEMO)


if __name__ == "__main__":
    main()
