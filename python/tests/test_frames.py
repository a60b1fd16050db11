"""Frames are those of the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import insonify
import numpy as np
import pytest
from conftest import Program, turned, write_station

STATIONS = ["sphere", "bone_plate", "slabs", "vessel_needle", "gallbladder_stones"]


def read_png(path: Path) -> Any:
    image = pytest.importorskip("PIL.Image")
    return np.asarray(image.open(path))


def drawn(case: int) -> tuple[insonify.Station, insonify.Pose, tuple[int, int], int, float]:
    """A station with settings, a pose, a quality, a seed and a time, of a seed."""
    random = np.random.default_rng(case)
    station = insonify.Station(STATIONS[case % len(STATIONS)])
    station.set(
        width=int(random.integers(120, 400)),
        height=int(random.integers(120, 300)),
        scanlines=int(random.integers(32, 128)),
        samples=int(random.integers(300, 1200)),
        depth_mm=float(random.uniform(60, 160)),
        frequency_mhz=float(random.uniform(2, 6)),
        gain_db=float(random.uniform(0, 40)),
        dynamic_range_db=float(random.uniform(40, 80)),
        look={"angles": int(random.choice([1, 1, 3])), "grey_map": str(random.choice(["linear", "soft"]))},
    )
    own = station.pose
    assert own is not None
    quality = (int(random.integers(1, 6)), int(random.choice([1, 3])))
    pose = turned(own, random, 6, 12)
    return station, pose, quality, int(random.integers(0, 2**32)), float(random.uniform(0, 5))


@pytest.mark.parametrize("case", range(20))
def test_arrays_equal_the_files_of_the_command(case: int, tmp_path: Path, run_program: Program) -> None:
    station, pose, quality, seed, time_s = drawn(case)
    tables = station.to_dict()
    scene = dict(tables["scene"])
    scene["path"] = str((Path(station.path or ".").parent / scene["path"]).resolve())
    file = write_station(tmp_path / "station.toml", {**tables, "scene": scene})
    numbers = ",".join(repr(number) for number in pose.components)
    rays, layers = quality
    said = run_program(
        "render", file, f"--pose={numbers}", "--quality", f"{rays}x{layers}", "--seed", seed, "--time", time_s,
        "--out", tmp_path / "out",
    )  # fmt: skip
    assert said.returncode == 0, said.stderr
    frame = station.render(pose, quality=quality, seed=seed, time_s=time_s)
    out = tmp_path / "out"
    assert np.array_equal(frame.bmode, read_png(out / "bmode.png"))
    assert np.array_equal(frame.mask, read_png(out / "mask.png"))
    assert np.array_equal(frame.segmentation, read_png(out / "segmentation.png"))
    # Bits, not values: a NaN would equal nothing.
    assert frame.attenuation.tobytes() == np.load(out / "attenuation.npy").tobytes()
    assert frame.lines.tobytes() == np.load(out / "lines.npy").tobytes()
    assert (frame.attenuation.dtype, frame.lines.dtype) == (np.float32, np.complex64)
    assert frame.bmode.std() > 1, "a black picture shows nothing"
    names = json.loads((out / "tissues.json").read_text())
    assert names == {str(number): name for number, name in enumerate(frame.tissues)}
    record = json.loads((out / "frame.json").read_text())
    for part in ("pose", "quality", "image", "probe", "simulated", "look", "attenuation_p98", "contact"):
        assert frame.record[part] == record[part], part
    assert frame.mm_per_pixel == record["image"]["pixel_mm"]


def test_arrays_own_the_renderers_memory(small: insonify.Station) -> None:
    frame = small.render()
    for array in (frame.bmode, frame.mask, frame.segmentation, frame.attenuation, frame.lines):
        owner = array.base
        assert array.flags.c_contiguous and array.flags.writeable and owner is not None
    kept = frame.bmode.copy()
    small.render(seed=5)
    assert np.array_equal(kept, frame.bmode), "a later frame must not write into an earlier one"


def test_a_frame_without_maps_or_lines_says_so(small: insonify.Station) -> None:
    frame = small.render(maps=False, lines=False)
    assert not frame.has_maps and not frame.has_lines
    for attribute, word in (("segmentation", "maps=True"), ("attenuation", "maps=True"), ("lines", "lines=True")):
        with pytest.raises(insonify.InputError, match=word):
            getattr(frame, attribute)
    assert np.array_equal(frame.bmode, small.render().bmode)


def test_a_frame_shows_itself(small: insonify.Station, tmp_path: Path) -> None:
    frame = small.render()
    assert frame._repr_png_()[:8] == b"\x89PNG\r\n\x1a\n"
    assert np.array_equal(read_png(frame.save_png(tmp_path / "frame.png")), frame.bmode)
    assert "160 x 120 pixels" in repr(frame)
    assert frame.tissue("liver").any() and frame.tissues[0] == "outside"
    with pytest.raises(insonify.InputError, match="no tissue `livre`"):
        frame.tissue("livre")


def test_seed_and_quality_change_the_frame_and_come_back(small: insonify.Station) -> None:
    first = small.render(quality="fast", seed=1)
    assert not np.array_equal(first.bmode, small.render(quality="fast", seed=2).bmode)
    assert not np.array_equal(first.bmode, small.render(quality="balanced", seed=1).bmode)
    assert np.array_equal(first.bmode, small.render(quality=(1, 1), seed=1).bmode)


def test_a_budget_chooses_a_quality() -> None:
    station = insonify.Station("sphere", frame_budget_ms=1000, width=200, height=150, scanlines=64)
    station.set(rays=None, layers=None, quality={"preset": None})
    frame = station.render()
    assert frame.chosen is not None and frame.record["chosen"] == frame.chosen
    assert station.render(quality="fast").chosen is None
