"""Stations: settings, their checks, plans, planes and tissues."""

from __future__ import annotations

import logging
import pickle
from pathlib import Path
from typing import Any

import insonify
import numpy as np
import pytest
from conftest import SMALL, Program
from insonify._data import data_directory


SMALL_IMAGE = {"width": 160, "height": 120}


def test_settings_are_those_of_station_files(small: insonify.Station) -> None:
    small.set(gain_db=30, probe={"frequency_mhz": 5}, **{"image.dynamic_range_db": np.float64(55)})
    settings = small.settings
    assert (settings["image"]["gain_db"], settings["probe"]["frequency_mhz"]) == (30.0, 5.0)
    assert settings["image"]["dynamic_range_db"] == 55.0 and small.to_dict()["image"]["gain_db"] == 30
    small.set(gain_db=None)
    default = next(key.default for key in insonify.station_keys() if key[:2] == ("image", "gain_db"))
    assert small.settings["image"]["gain_db"] == float(default)
    small.set(pose=insonify.Pose((1, 2, 3)))
    assert small.pose == insonify.Pose((1, 2, 3))


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"gain_bd": 3}, "did you mean `gain_db`"),
        ({"gain_db": 1e9}, r"`image.gain_db` is 1000000000.0; it must be a number in"),
        ({"gain_db": float("nan")}, "`image.gain_db` is nan"),
        ({"gain_db": "loud"}, "it must be a number"),
        ({"rays": 2.5}, "it must be a whole number"),
        ({"rays": 2**70}, "beyond 64 bits"),
        ({"preset": "fast"}, "a key of several tables"),
        ({"probe": {"kind": "bogus"}}, "one of .*convex"),
        ({"probe": {"kind": "linear", "fov_deg": 60}}, "does not apply"),
        ({"background": "livr"}, "did you mean `liver`"),
        ({"gain_db": object()}, "of the type object"),
        ({"tgc_sliders_db": [1, None]}, "holds None"),
        ({"tissues": {"jelly": {"speed_m_s": 1500.0}}}, "must give"),
    ],
)
def test_wrong_settings_are_refused_and_change_nothing(
    small: insonify.Station, settings: dict[str, Any], words: str
) -> None:
    before = small.to_dict()
    with pytest.raises(insonify.InputError, match=words):
        small.set(**settings)
    assert small.to_dict() == before


def test_words_are_those_of_the_command_line(tmp_path: Path, run_program: Program) -> None:
    file = tmp_path / "wrong.toml"
    for text in (
        "[scene]\npath = 'nothing.glb'\n[image]\ngain_db = 900\n",
        "[scene]\npath = 'nothing.glb'\n",
        "[scene\n",
        "[scene]\nphantom = 'obstetric'\n[prob]\n",
    ):
        file.write_text(text)
        with pytest.raises(insonify.InsonifyError) as caught:
            insonify.Station(file).render((0, 0, 0, 1, 0, 0, 0))
        said = run_program("render", file, "--pose=0,0,0,1,0,0,0", "--out", tmp_path / "out")
        assert said.returncode == 2 and " ".join(said.stderr.split()) == " ".join(f"error: {caught.value}".split())


def test_missing_files_are_missing_files(tmp_path: Path) -> None:
    for exception in (FileNotFoundError, insonify.StationError.__mro__[1], ValueError):
        with pytest.raises(exception, match="nothing.toml"):
            insonify.Station(tmp_path / "nothing.toml")
    with pytest.raises(insonify.MissingFileError, match="no station of the package is called obstetrics.*obstetric,"):
        insonify.Station("obstetrics")
    broken = tmp_path / "broken.glb"
    broken.write_bytes(b"glTF\x02\x00\x00\x00 and no more")
    station = insonify.Station.from_dict({"scene": {"path": broken}})
    with pytest.raises(insonify.SceneError, match="not a whole glTF file"):
        station.render((0, 0, 0, 1, 0, 0, 0))
    with pytest.raises(insonify.InputError, match="no pose of its own"):
        station.render()


def test_a_scene_of_arrays_takes_the_place_of_the_table() -> None:
    ball = np.array([[x, y, z] for x in (-9, 9) for y in (-9, 9) for z in (50, 68)])
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    scene = insonify.Scene([(ball, faces, "liver", 1)], background="water")
    station = insonify.Station.from_dict({"scene": {"phantom": "obstetric"}, "image": SMALL_IMAGE}, scene=scene)
    assert "liver" in station.render((0, 0, 0, 1, 0, 0, 0)).tissues
    with pytest.raises(insonify.StationError, match="made of arrays"):
        station.set(scene={"phantom": "obstetric"})
    with pytest.raises(insonify.InputError, match="frames is -1"):
        insonify.make_dataset("sphere", "nowhere", frames=-1)


def test_a_folder_of_a_stations_name_is_no_station_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sphere").mkdir()
    monkeypatch.chdir(tmp_path)
    assert insonify.Station("sphere", **SMALL).render().bmode.any()


def test_a_scene_in_use_outlives_its_file(tmp_path: Path) -> None:
    copied = tmp_path / "scene.glb"
    copied.write_bytes((data_directory() / "assets/scenes/sphere.glb").read_bytes())
    tables = {"scene": {"path": copied, "background": "liver"}, "image": {"width": 160, "height": 120}}
    station = insonify.Station.from_dict(tables)
    pose = (0, 0, 0, 1, 0, 0, 0)
    before = station.render(pose).bmode
    copied.unlink()
    assert np.array_equal(station.render(pose).bmode, before)
    copied.write_bytes(b"no scene")
    with pytest.raises(insonify.SceneError):
        station.render(pose)


def test_wrong_frames_are_refused(small: insonify.Station) -> None:
    for keywords, words in (
        ({"quality": "best"}, "balanced"),
        ({"quality": (0, 1)}, "rays x layers"),
        ({"quality": 3}, "must be a str or"),
        ({"seed": -1}, "seed is -1"),
        ({"seed": 2**32}, "seed is 4294967296"),
        ({"seed": 1.5}, "seed is 1.5"),
        ({"time_s": -1}, "time_s is -1"),
        ({"time_s": float("nan")}, "time_s is NaN"),
    ):
        with pytest.raises(insonify.InputError, match=words):
            small.render(**keywords)  # type: ignore[arg-type]
    with pytest.raises(insonify.InputError, match="backend"):
        insonify.Station("sphere", backend="quantum")


def test_copies_and_pickles_render_the_same(small: insonify.Station) -> None:
    small.set(gain_db=22)
    picture = small.render(seed=3).bmode
    for other in (small.copy(), pickle.loads(pickle.dumps(small)), insonify.Station.from_dict(
        small.to_dict(), directory=(small.path or Path()).parent
    )):  # fmt: skip
        assert np.array_equal(other.render(seed=3).bmode, picture)
    changed = small.copy(gain_db=40)
    assert changed.settings["image"]["gain_db"] == 40 and small.settings["image"]["gain_db"] == 22
    frame = small.render(seed=3)
    again = pickle.loads(pickle.dumps(frame))
    assert np.array_equal(again.lines, frame.lines) and again.record == frame.record and again.pose == frame.pose


def test_stations_show_their_settings(small: insonify.Station) -> None:
    shown = small._repr_html_()
    assert "frequency_mhz" in shown and "<script" not in shown
    assert "convex" in repr(small)


def test_a_plan_says_why(small: insonify.Station) -> None:
    plan = small.plan(quality="balanced")
    assert "aperture" in plan.effects and len(plan) > 10
    assert plan[0].reason in str(plan) and isinstance(plan[:2], list)
    small.set(effects={"refraction": "off"})
    assert next(decision for decision in small.plan() if decision.effect == "refraction").on is False


def test_what_a_plan_warns_of_is_logged(small: insonify.Station, caplog: pytest.LogCaptureFixture) -> None:
    small.set(effects={"refraction": "off"})
    with caplog.at_level(logging.WARNING, logger="insonify"):
        small.render()
        small.render(seed=9)
    assert len([record for record in caplog.records if "refraction" in record.message]) == 1


def test_tissues_have_properties() -> None:
    station = insonify.Station("sphere", tissues={"liver": {"speed_m_s": 1600.0}})
    assert station.tissues["liver"]["speed_m_s"] == 1600.0
    assert insonify.tissues()["liver"]["speed_m_s"]["value"] == 1575.0
    assert station.tissue_names[0] == "outside" and "liver" in station.tissue_names


def test_planes_of_a_phantom_have_poses_and_offsets() -> None:
    station = insonify.Station.obstetric(**SMALL)
    planes = station.planes
    assert list(planes)[0] == "head" and len(planes) == len(list(planes))
    head = planes["head"]
    offset = head.offset(head.pose)
    assert offset.shown and offset.angle_deg < 0.1 and offset.distance_mm < 0.1
    tilted = head.pose @ insonify.Pose((0, 0, 0), (np.cos(0.1), np.sin(0.1), 0, 0))
    assert abs(head.offset(tilted).angle_deg - np.rad2deg(0.2)) < 0.1
    assert planes.touch(head.pose).part > 0.5
    far = insonify.Pose((0, 0, -5000))
    assert planes.touch(far).press_mm is None and not head.offset(far).shown
    with pytest.raises(KeyError, match="the planes are head"):
        planes["foot"]


def test_a_scene_without_planes_says_so() -> None:
    with pytest.raises(insonify.StationError, match="planes.json is not there"):
        _ = insonify.Station("sphere").planes
