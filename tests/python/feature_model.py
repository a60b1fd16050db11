#!/usr/bin/env python3
"""Builds a feature extractor of known features: means of 8 x 8 blocks, channel c times c + 1.

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install onnx==1.23.2 numpy
    /tmp/venv/bin/python tests/python/feature_model.py tests/data/quality/block_means.onnx
"""

import sys

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper


def main(path):
    gains = numpy_helper.from_array(np.array([1, 2, 3], np.float32).reshape(1, 3, 1, 1), "gains")
    nodes = [
        helper.make_node("AveragePool", ["input"], ["means"], kernel_shape=[8, 8], strides=[8, 8]),
        helper.make_node("Mul", ["means", "gains"], ["scaled"]),
        helper.make_node("Flatten", ["scaled"], ["features"]),
    ]
    graph = helper.make_graph(
        nodes,
        "block means",
        [helper.make_tensor_value_info("input", TensorProto.FLOAT, [1, 3, 16, 16])],
        [helper.make_tensor_value_info("features", TensorProto.FLOAT, [1, 12])],
        [gains],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.checker.check_model(model, full_check=True)
    with open(path, "wb") as file:
        file.write(model.SerializeToString(deterministic=True))


if __name__ == "__main__":
    main(sys.argv[1])
