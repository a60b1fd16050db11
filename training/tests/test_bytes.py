"""Conversion of generators to tensors of bytes."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

onnx = pytest.importorskip("onnx")
onnxruntime = pytest.importorskip("onnxruntime")

from insonify_training.bytes import ConversionError, convert, convert_generator, normalisation, outside_of, parity_bytes  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
TESTS = ROOT / "tests/data/generators"


def manifest_of(path):
    return tomllib.loads(path.with_suffix(".toml").read_text(encoding="utf-8"))


def run(model, name, values):
    session = onnxruntime.InferenceSession(model.SerializeToString(), providers=["CPUExecutionProvider"])
    return session.run(None, {name: values})[0]


@pytest.mark.parametrize(
    "path", [ROOT / "assets/generators" / f"{name}/{name}.onnx" for name in ("beam_m_rolling", "beam_msa", "demo_smooth", "fast_msa")]
)
def test_a_converted_generator_gives_the_levels_that_the_station_rounds(path, tmp_path):
    manifest, model = manifest_of(path), onnx.load(path)
    planes = np.load(path.with_name(manifest["parity"]["input"]))[:, :64, :64]
    inputs, inside = parity_bytes(planes, manifest)
    scales, offsets = (values.reshape(1, -1, 1, 1) for values in normalisation(manifest))
    floats = run(model, manifest["input"]["name"], inputs.astype(np.float32) * scales + offsets)
    output = manifest["output"]
    scale, offset = (np.float32(output[key]) * np.float32(255) for key in ("scale", "offset"))
    expected = np.rint(np.clip(floats * scale + offset, 0, 255))
    found = run(convert(model, manifest), manifest["input"]["name"], inputs)
    assert found.dtype == np.uint8 and found.shape == floats.shape and inside.any() and len(np.unique(found)) > 16
    # The same operations in the same order: a runtime may still fuse some.
    differs = found.astype(float) != expected
    assert np.abs(found - expected).max() <= 1 and differs.mean() < 1e-3
    assert run(convert(model, manifest), manifest["input"]["name"], 255 - inputs).tolist() != found.tolist()


def test_folders_are_converted_whole(tmp_path):
    source = ROOT / "assets/generators/beam_msa"
    figures = convert_generator(source / "beam_msa.toml", tmp_path / "beam_msa")
    assert sorted(path.name for path in (tmp_path / "beam_msa").iterdir()) == sorted(path.name for path in source.iterdir())
    assert set(figures) == {"beam_msa.onnx", "beam_msa.int8.onnx"} and all(one["levels"] <= 1.0 for one in figures.values())
    before, after = (manifest_of(folder / "beam_msa.onnx") for folder in (source, tmp_path / "beam_msa"))
    assert after["parity"]["tolerance"] == 1.0 and after["precision"][0]["tolerance"] == before["precision"][0]["tolerance"]
    assert after["sha256"] != before["sha256"] and after["precision"][0]["sha256"] != before["precision"][0]["sha256"]
    same = {key: value for key, value in before.items() if key not in ("sha256", "parity", "precision")}
    assert same.items() <= after.items()
    levels = np.load(tmp_path / "beam_msa" / after["parity"]["output"])
    assert levels.dtype == np.float32 and (levels == np.rint(levels)).all()


def test_channels_have_the_mappings_of_the_manifest():
    manifest = manifest_of(TESTS / "weighted_maps.onnx")
    manifest["input"]["segmentation"] = {"scale": 0.5, "offset": -1.0}
    manifest["input"]["image"] = {"scale": 2.0, "offset": -1.0}
    scales, offsets = normalisation(manifest)
    assert scales == pytest.approx([1 / 255, 0.5, 2 / 255, 1 / 255]) and offsets.tolist() == [0, -1, -1, 0]
    assert outside_of(manifest).tolist() == [0, 0, 0, 0]
    manifest["segmentation"]["encoding"] = "classes"
    assert normalisation(manifest)[0] == pytest.approx([1 / 255, 0.5, 0.5, 0.5, 0.5, 2 / 255, 1 / 255])
    assert outside_of(manifest).tolist() == [0, 1, 0, 0, 0, 0, 0]
    planes = np.array([[[7, 8]], [[2, 0]], [[0.25, 1.0]], [[255, 0]]], np.float32)
    manifest["input"]["attenuation"]["power"] = 0.5
    inputs, inside = parity_bytes(planes, manifest)
    assert inputs[0, :, 0, 0].tolist() == [128, 0, 0, 1, 0, 7, 255] and inside.tolist() == [[True, False]]


def test_what_cannot_be_converted_is_explained(tmp_path):
    path = TESTS / "identity.onnx"
    made = convert(onnx.load(path), manifest_of(path))
    with pytest.raises(ConversionError, match="converted before"):
        convert(made, manifest_of(path))
    wrong = manifest_of(path)
    wrong["output"]["name"] = "other"
    with pytest.raises(ConversionError, match="no tensors input and other"):
        convert(onnx.load(path), wrong)
    with pytest.raises(ConversionError, match="name another folder"):
        convert_generator(path.with_suffix(".toml"), path.parent)
