#!/usr/bin/env python3
"""Writes assets/quality/texture64.onnx: 64 fixed texture statistics of a crop, for a Frechet distance.

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install onnx==1.23.2 numpy
    /tmp/venv/bin/python training/make_features.py

Nothing is trained or random: a bank of Gabor filters in quadrature (Daugman 1985) at 4 octaves and 4 orientations,
and the statistics of its magnitudes by which Portilla and Simoncelli (IJCV 2000) describe a texture. Distances over
these features are called `FD texture64`; they are not FID and can't be compared with it.

Input float32 [1, 1, 256, 256], grey level / 255; output float32 [1, 64]:

    0       mean grey level, x 4
    1       ln (standard deviation + 0.01)
    2, 3    skewness and kurtosis / 8, both damped where there is no contrast
    4..20   ln (mean magnitude + 0.001) of each filter: octave by octave, wavelengths 4, 8, 16, 32 pixels,
            in each 0, 45, 90, 135 degrees
    20..36  ln (deviation of the magnitude + 0.001) likewise; about half of the mean for speckle, more for edges
    36..48  correlation of magnitudes with those of the same orientation one octave coarser
    48..64  correlation of magnitudes within an octave: between neighbouring orientations (0-45, 45-90, 90-135, 135-0)

Factors are chosen so that features of B-mode crops vary by about 1.
"""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

ROOT = Path(__file__).resolve().parent.parent
TARGET = ROOT / "assets/quality/texture64.onnx"
SIDE, OCTAVES, ORIENTATIONS = 256, 4, 4
# Wavelength and standard deviation of the envelope, pixels of the octave; number of taps of a filter.
WAVELENGTH, SIGMA, TAPS = 4.0, 2.0, 11


class Graph:
    """Nodes and constants of an ONNX graph."""

    def __init__(self):
        self.nodes, self.constants = [], {}

    def const(self, name, values, dtype=np.float32):
        self.constants[name] = numpy_helper.from_array(np.asarray(values, dtype=dtype), name)
        return name

    def op(self, operator, inputs, output, **attributes):
        self.nodes.append(helper.make_node(operator, inputs, [output], name=output, **attributes))
        return output


def gabor_bank():
    """Even and odd filters of each orientation [2 x orientations, 1, taps, taps], even first, zero mean."""
    half = TAPS // 2
    y, x = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float64)
    envelope = np.exp(-(x**2 + y**2) / (2 * SIGMA**2))
    even, odd = [], []
    for k in range(ORIENTATIONS):
        angle = np.pi * k / ORIENTATIONS
        phase = 2 * np.pi * (x * np.cos(angle) + y * np.sin(angle)) / WAVELENGTH
        wave = np.cos(phase)
        wave -= (wave * envelope).sum() / envelope.sum()
        gain = 1.0 / (envelope * np.cos(phase) ** 2).sum()
        even.append(gain * envelope * wave)
        odd.append(gain * envelope * np.sin(phase))
    return np.stack(even + odd)[:, None]


def build():
    g = Graph()
    space = g.const("space", [2, 3], np.int64)
    edge = g.const("edge", [0, 0, TAPS // 2, TAPS // 2] * 2, np.int64)
    edge_low = g.const("edge_low", [0, 0, 2, 2] * 2, np.int64)
    bank = g.const("bank", gabor_bank())
    binomial = np.outer([1, 4, 6, 4, 1], [1, 4, 6, 4, 1]) / 256
    low = g.const("binomial", binomial[None, None])
    small = g.const("small", 1e-3)
    tiny = g.const("tiny", 1e-6)

    def mean(name, value):
        return g.op("ReduceMean", [value, space], name, keepdims=1)

    def centred(name, value):
        return g.op("Sub", [value, mean(f"{name}_mean", value)], f"{name}_centred")

    def square_mean(name, a, b):
        return mean(name, g.op("Mul", [a, b], f"{name}_product"))

    def log(name, value, floor):
        return g.op("Log", [g.op("Add", [value, floor], f"{name}_above")], name)

    features = []
    # Levels.
    grey = centred("grey", "input")
    variance = square_mean("variance", grey, grey)
    deviation = g.op("Sqrt", [variance], "deviation")
    floored = g.op("Add", [variance, g.const("least_variance", 1e-4)], "floored")
    squares = g.op("Mul", [grey, grey], "squares")
    third, fourth = square_mean("third", squares, grey), square_mean("fourth", squares, squares)
    power = g.op("Mul", [floored, g.op("Sqrt", [floored], "floored_deviation")], "cubed_deviation")
    features.append(g.op("Mul", ["grey_mean", g.const("four", 4.0)], "feature_mean"))
    features.append(log("feature_deviation", deviation, g.const("least_deviation", 1e-2)))
    features.append(g.op("Div", [third, power], "feature_skewness"))
    kurtosis = g.op("Div", [fourth, g.op("Mul", [floored, floored], "squared_variance")], "kurtosis")
    features.append(g.op("Mul", [kurtosis, g.const("eighth", 0.125)], "feature_kurtosis"))

    # Magnitudes of the bank on a pyramid.
    image, magnitudes = "input", []
    for octave in range(OCTAVES):
        padded = g.op("Pad", [image, edge], f"padded_{octave}", mode="reflect")
        g.op("Conv", [padded, bank], f"bands_{octave}", kernel_shape=[TAPS, TAPS])
        parts = [f"even_{octave}", f"odd_{octave}"]
        g.nodes.append(helper.make_node("Split", [f"bands_{octave}"], parts, name=f"parts_{octave}", axis=1, num_outputs=2))
        power = [g.op("Mul", [p, p], f"{p}_power") for p in parts]
        total = g.op("Add", [g.op("Add", power, f"power_{octave}"), tiny], f"total_{octave}")
        magnitudes.append(g.op("Sqrt", [total], f"magnitude_{octave}"))
        padded = g.op("Pad", [image, edge_low], f"low_padded_{octave}", mode="reflect")
        image = g.op("Conv", [padded, low], f"image_{octave + 1}", kernel_shape=[5, 5], strides=[2, 2])

    centres = [centred(m, m) for m in magnitudes]
    variances = [square_mean(f"{m}_variance", c, c) for m, c in zip(magnitudes, centres)]
    deviations = [g.op("Sqrt", [v], f"{v}_root") for v in variances]
    features += [log(f"feature_{m}", f"{m}_mean", small) for m in magnitudes]
    features += [log(f"feature_{d}", d, small) for d in deviations]

    def correlation(name, a, b, deviations):
        product = g.op("Mul", deviations, f"{name}_deviations")
        divisor = g.op("Add", [product, tiny], f"{name}_divisor")
        return g.op("Div", [square_mean(f"{name}_covariance", a, b), divisor], name)

    for octave in range(OCTAVES - 1):
        # The finer magnitudes, resampled to the coarser grid.
        finer = g.op("AveragePool", [magnitudes[octave]], f"finer_{octave}", kernel_shape=[2, 2], strides=[2, 2])
        finer = centred(finer, finer)
        own = g.op("Sqrt", [square_mean(f"finer_variance_{octave}", finer, finer)], f"finer_deviation_{octave}")
        pair = (own, deviations[octave + 1])
        features.append(correlation(f"feature_octaves_{octave}", finer, centres[octave + 1], pair))
    turn = g.const("turn", [1, 2, 3, 0], np.int64)
    for octave in range(OCTAVES):
        turned = g.op("Gather", [centres[octave], turn], f"turned_{octave}", axis=1)
        spread = g.op("Gather", [deviations[octave], turn], f"turned_deviation_{octave}", axis=1)
        pair = (deviations[octave], spread)
        features.append(correlation(f"feature_orientations_{octave}", centres[octave], turned, pair))

    g.op("Concat", features, "all", axis=1)
    g.op("Reshape", ["all", g.const("shape", [1, 64], np.int64)], "features")
    value = helper.make_tensor_value_info
    graph = helper.make_graph(
        g.nodes, "texture64",
        [value("input", TensorProto.FLOAT, [1, 1, SIDE, SIDE])],
        [value("features", TensorProto.FLOAT, [1, 64])],
        list(g.constants.values()),
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.checker.check_model(model, full_check=True)
    return model


if __name__ == "__main__":
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    TARGET.write_bytes(build().SerializeToString(deterministic=True))
    print(TARGET, TARGET.stat().st_size, "bytes")
