"""Generators: the command line's pictures, and what is said without ONNX Runtime."""

from __future__ import annotations

import os
import subprocess
import sys

import insonify
import numpy as np
import pytest

# Earlier ones lack what the library asks for; Python 3.10 has no later one.
pytest.importorskip("onnxruntime", minversion="1.24")


@pytest.fixture(scope="module")
def frame() -> tuple[insonify.Station, insonify.Frame]:
    station = insonify.Station("sphere", width=320, height=240, scanlines=96)
    return station, station.render(quality="fast", lines=False)


def test_a_model_that_comes_with_the_package_translates_a_frame(
    frame: tuple[insonify.Station, insonify.Frame],
) -> None:
    station, picture = frame
    generator = insonify.Generator("demo_smooth", station=station, threads=1)
    translated = generator.run(picture)
    assert translated.shape == picture.bmode.shape and translated.dtype == np.uint8
    assert not np.array_equal(translated, picture.bmode) and not translated[picture.mask == 0].any()
    assert np.array_equal(translated, generator.run(picture))
    assert generator.precision == "float32" and "demo_smooth" in repr(generator)


def test_wrong_models_and_frames_are_refused(frame: tuple[insonify.Station, insonify.Frame]) -> None:
    station, _ = frame
    with pytest.raises(insonify.InsonifyError, match="nothing.onnx|nothing.toml"):
        insonify.Generator("nothing.onnx", station=station)
    with pytest.raises(insonify.InputError, match="precision is `int3`"):
        insonify.Generator("demo_smooth", station=station, precision="int3")
    generator = insonify.Generator("demo_smooth", station=station, threads=1)
    with pytest.raises(insonify.InputError, match="without segmentation"):
        generator.run(station.render(maps=False))


def test_without_onnx_runtime_the_error_says_what_to_install() -> None:
    script = """
import sys
sys.modules["onnxruntime"] = None
import importlib.util
find = importlib.util.find_spec
importlib.util.find_spec = lambda name, *rest: None if name == "onnxruntime" else find(name, *rest)
import insonify
insonify.Generator("demo_smooth", station=insonify.Station("sphere"))
"""
    # The library of a repository's own folder must not help.
    environment = {**os.environ, "ORT_DYLIB_PATH": ""}
    command = [sys.executable, "-c", script]
    said = subprocess.run(command, capture_output=True, text=True, check=False, env=environment, timeout=60)
    if said.returncode == 0:
        pytest.skip("an ONNX Runtime of the repository was found")
    assert "pip install 'insonify[generator]'" in said.stderr and "GeneratorError" in said.stderr
