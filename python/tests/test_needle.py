"""The tracked needle: frames, exercises, scores."""

from __future__ import annotations

import json
import pickle
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import insonify
import numpy as np
import pytest
from conftest import Program, turned, write_station
from test_frames import read_png

EXERCISES = ["needle_cyst", "needle_vessel"]
FAST: dict[str, Any] = {"width": 200, "height": 250, "scanlines": 64, "samples": 700}


@pytest.fixture
def cyst() -> insonify.Station:
    """A small picture of a needle in a cyst."""
    return insonify.Station("needle_cyst", **FAST)


def absolute(station: insonify.Station) -> dict[str, Any]:
    """Tables of a station whose scene is named from the root."""
    tables = station.to_dict()
    scene = dict(tables["scene"])
    scene["path"] = str((Path(station.path or ".").parent / scene["path"]).resolve())
    return {**tables, "scene": scene}


def test_the_package_has_the_exercises() -> None:
    assert {*EXERCISES, "needle_amniocentesis"} <= set(insonify.station_names())


def test_a_station_tells_its_needle(cyst: insonify.Station) -> None:
    needle = cyst.needle
    assert needle is not None and needle.pose is not None
    assert (needle.gauge, needle.diameter_mm, needle.length_mm, needle.kind) == (20, 0.91, 90.0, "plain")
    assert needle.pose.position_mm == (0.0, 0.0, 30.0)
    assert cyst.settings["needle"]["bevel_deg"] == needle.bevel_deg == 17.0
    moved = insonify.Pose((1, 2, 20))
    cyst.set(needle=moved)
    assert cyst.needle is not None and cyst.needle.pose == moved and cyst.needle.gauge == 20
    cyst.set(needle={"kind": "etched"})
    assert cyst.needle.kind == "etched" and cyst.needle.pose == moved
    assert insonify.Station("sphere").needle is None
    tracked = cyst.copy(tracker={"transport": "serial", "protocol": "liberty", "port": "/dev/null"}, needle=None)
    tracked.set(needle={"sensor": 2})
    assert tracked.needle is not None and tracked.needle.pose is None
    assert tracked.render().needle is None
    tip = (0, 0, 20)
    assert tracked.render(needle=insonify.Pose(tip)).tissue("needle").any(), "a tracked needle can be anywhere"


@pytest.mark.parametrize("case", range(8))
def test_frames_are_those_of_the_command(case: int, tmp_path: Path, run_program: Program) -> None:
    random = np.random.default_rng(100 + case)
    station = insonify.Station(EXERCISES[case % 2], **FAST)
    station.set(look={"angles": int(random.choice([1, 3]))})
    assert station.pose is not None and station.needle is not None and station.needle.pose is not None
    pose, needle = turned(station.pose, random, 1, 4), turned(station.needle.pose, random, 1, 10)
    placed = station.copy(needle=needle, pose=pose)
    file = write_station(tmp_path / "station.toml", absolute(placed))
    out = tmp_path / "out"
    said = run_program("render", file, "--quality", "2x3", "--seed", case, "--out", out)
    assert said.returncode == 0, said.stderr
    frame = station.render(pose, needle=needle, quality=(2, 3), seed=case)
    [of_many] = station.render_many([insonify.Job(pose, needle=needle)], quality=(2, 3), seed=case, lines=True)
    for made in (frame, placed.render(quality=(2, 3), seed=case), of_many):
        assert np.array_equal(made.bmode, read_png(out / "bmode.png"))
        assert np.array_equal(made.segmentation, read_png(out / "segmentation.png"))
        assert made.attenuation.tobytes() == np.load(out / "attenuation.npy").tobytes()
        assert made.lines.tobytes() == np.load(out / "lines.npy").tobytes()
        assert made.needle == needle
        record = json.loads((out / "frame.json").read_text())
        assert made.record["needle"] == record["needle"] and record["needle"]["position_mm"] == list(needle.position_mm)
    assert not np.array_equal(frame.bmode, station.render(pose, needle=False, quality=(2, 3), seed=case).bmode)


def test_a_frame_without_the_needle(cyst: insonify.Station) -> None:
    with_needle, without = cyst.render(), cyst.render(needle=False)
    assert with_needle.tissue("needle").any() and not without.tissue("needle").any()
    assert cyst.needle is not None and with_needle.needle == cyst.needle.pose is not None
    assert without.needle is None and "needle" not in without.record
    assert not np.array_equal(with_needle.bmode, without.bmode)
    bare = cyst.copy(needle=None)
    assert np.array_equal(bare.render().bmode, without.bmode)
    assert np.array_equal(bare.render(needle=False).bmode, without.bmode)
    assert pickle.loads(pickle.dumps(with_needle)).needle == with_needle.needle


def test_a_pointer_has_a_pose_and_no_echo(cyst: insonify.Station) -> None:
    without = cyst.render(needle=False)
    cyst.set(needle={"kind": "pointer"})
    frame = cyst.render()
    assert np.array_equal(frame.bmode, without.bmode) and not frame.tissue("needle").any()
    assert frame.needle is not None and frame.record["needle"]["position_mm"] == [0, 0, 30]


def test_jobs_have_needles_of_their_own(cyst: insonify.Station) -> None:
    assert cyst.pose is not None and cyst.needle is not None and cyst.needle.pose is not None
    own = cyst.needle.pose
    needles = [own @ insonify.Pose((0, 0, -2.0 * n)) for n in range(5)]
    jobs = [insonify.Job(cyst.pose, needle=needle) for needle in needles]
    jobs += [insonify.Job(cyst.pose, needle=False), insonify.Job(cyst.pose)]
    for angles in (1, 3):
        cyst.set(look={"angles": angles})
        for job, frame in zip(jobs, cyst.render_many(jobs), strict=True):
            assert np.array_equal(frame.bmode, cyst.render(needle=job.needle).bmode)
            assert frame.needle == (own if job.needle is None else None if job.needle is False else job.needle)
    hidden = list(cyst.render_many([cyst.pose, jobs[0]], needle=False))
    assert hidden[0].needle is None and hidden[1].needle == needles[0]


def test_wrong_needles_are_refused(cyst: insonify.Station) -> None:
    for needle, exception, words in (
        ((0, 0, float("nan"), 1, 0, 0, 0), insonify.PoseError, "`z` is NaN"),
        ((0, 0, 1), insonify.PoseError, "it must be a Pose, its seven numbers"),
        ((0, 0, 1, 2, 0, 0, 0), insonify.PoseError, "norm 2"),
        (True, insonify.InputError, "needle is True"),
    ):
        with pytest.raises(exception, match=words):
            cyst.render(needle=needle)  # type: ignore[arg-type]
        with pytest.raises(exception, match=words):
            list(cyst.render_many([insonify.Job((0, 0, 0, 1, 0, 0, 0), needle=needle)]))  # type: ignore[arg-type]
    sphere = insonify.Station("sphere")
    for render in (
        lambda: sphere.render(needle=(0, 0, 40, 1, 0, 0, 0)),
        lambda: list(sphere.render_many([(0, 0, 0, 1, 0, 0, 0)], needle=(0, 0, 40, 1, 0, 0, 0))),
    ):
        with pytest.raises(insonify.InputError, match=r"the station has no needle; station.set\(needle=pose\)"):
            render()
    with pytest.raises(insonify.PoseError, match="direction is"):
        insonify.Pose.looking((0, 0, 0), (0, 0, 0))
    with pytest.raises(insonify.PoseError, match="lateral has the shape"):
        insonify.Pose.looking((0, 0, 0), (0, 0, 1), (1, 0))


def test_a_pose_looks_along_a_direction() -> None:
    pose = insonify.Pose.looking((1, 2, 3), (1, 0, 1), (1, 0, 0))
    half = np.sqrt(0.5)
    assert np.allclose(pose.matrix[:3, 2], (half, 0, half)) and np.allclose(pose.matrix[:3, 0], (half, 0, -half))
    assert pose.position_mm == (1, 2, 3)
    parallel = insonify.Pose.looking((0, 0, 0), (5, 0, 0), (1, 0, 0))
    assert np.allclose(parallel.matrix[:3, 2], (1, 0, 0)), "any x axis will do"


def test_an_exercise_says_what_is_to_be_done(cyst: insonify.Station) -> None:
    exercise = cyst.exercise
    assert exercise is not None and exercise is cyst.exercise
    assert (exercise.target, exercise.entry, exercise.forbidden) == ("cyst", "skin", ("artery", "artery wall"))
    assert (exercise.approach, exercise.time_s, exercise.name) == ("in-plane", 30.0, "Puncture of a cyst, in-plane")
    plan = exercise.plan
    assert np.linalg.norm(np.array(plan.aim_mm) - (0, 0, 30)) < 8 and abs(plan.entry_mm[2]) < 5
    assert plan.needle.position_mm == plan.entry_mm
    way = np.array(plan.aim_mm) - plan.entry_mm
    assert np.allclose(plan.needle.matrix[:3, 2], way / np.linalg.norm(way))
    assert exercise.touch(plan.probe).on_skin
    ball = cyst.copy(exercise={"target": None, "target_mm": [0, 0, 30], "radius_mm": 4}).exercise
    assert ball is not None and ball.target == insonify.Ball((0.0, 0.0, 30.0), 4.0)
    assert insonify.Station("sphere").exercise is None
    for exercise_table, words in (
        ({"target": "cist"}, "`exercise.target` names the surface `cist`.*did you mean `cyst`"),
        ({"forbidden": ["vein"]}, "`exercise.forbidden`"),
    ):
        with pytest.raises(insonify.StationError, match=words):
            _ = cyst.copy(exercise=exercise_table).exercise
    with pytest.raises(insonify.InputError, match="no pose of its own"):
        _ = cyst.copy(pose=None).exercise.plan  # type: ignore[union-attr]


def straight(exercise: insonify.Exercise, speed_mm_s: float = 10.0) -> list[insonify.NeedleSample]:
    """A needle that goes straight from above the skin to the aim, at 50 Hz."""
    plan = exercise.plan
    length_mm = float(np.linalg.norm(np.array(plan.aim_mm) - plan.entry_mm))
    depths = np.arange(-10, length_mm, speed_mm_s / 50)
    needles = [plan.needle @ insonify.Pose((0, 0, depth)) for depth in depths]
    return [insonify.NeedleSample(n / 50, plan.probe, needle) for n, needle in enumerate(needles)]


@pytest.mark.parametrize("name", EXERCISES)
def test_a_straight_puncture_has_all_points_and_a_forbidden_one_costs(name: str) -> None:
    station = insonify.Station(name)
    exercise = station.exercise
    assert exercise is not None
    score = exercise.score(straight(exercise))
    assert score.points is not None and score.points > 90 and score.passes == 1, str(score)
    assert score.reached is not None and score.entry_surface == "skin" and score.right_entry
    assert score.final_mm == 0 and not score.forbidden and score.visible_at_end
    kinds = [(event.kind, event.surface) for event in score.events]
    assert kinds[0] == ("entered", "skin") and ("entered", exercise.target) in kinds
    assert all(a.time_s <= b.time_s for a, b in zip(score.events, score.events[1:], strict=False))
    assert f"{score.points:.0f} of 100 points" in str(score) and json.dumps(score.record)
    spared = station.copy(exercise={"forbidden": [exercise.target]}).exercise
    assert spared is not None
    worse = spared.score(straight(exercise))
    assert len(worse.forbidden) == 1 and worse.points == pytest.approx(score.points - 20)
    assert worse.deductions[-1].criterion == "forbidden" and worse.deductions[-1].points == 20
    crossing = worse.forbidden[0]
    assert crossing.surface == exercise.target and crossing.position_mm == pytest.approx(score.reached.position_mm)


def test_a_session_step_by_step_is_judged_as_a_whole(cyst: insonify.Station) -> None:
    exercise = cyst.exercise
    assert exercise is not None
    session, samples = exercise.session(), straight(exercise)
    steps = [session.add(*sample) for sample in samples]
    assert session.score() == exercise.score(samples)
    distances = [step.distance_mm for step in steps if step.distance_mm is not None]
    assert distances[0] > 30 and distances[-1] == 0 and all(np.diff(distances) <= 1e-9)
    assert not steps[0].in_tissue and steps[-1].in_tissue and steps[0].reached is None
    assert steps[-1].visible and steps[-1].offset_mm is not None and steps[-1].offset_mm < 1e-6
    events = [event for step in steps for event in step.events]
    assert tuple(events) == session.score().events and steps[-1].reached == session.score().reached
    lost = session.add(samples[-1].time_s, None, None)
    assert lost.distance_mm is None and lost.angle_deg is None and not lost.visible and not lost.in_tissue
    with pytest.raises(insonify.InputError, match="times must not fall"):
        session.add(0.0, None, None)


def test_simulated_hands_are_scored() -> None:
    exercise = insonify.Station("needle_cyst").exercise
    assert exercise is not None
    points: dict[str, float] = {}
    for skill in ("expert", "novice"):
        samples = exercise.hand(skill, seed=3)
        assert samples == exercise.hand(skill, seed=3) != exercise.hand(skill, seed=4)
        assert samples[1].time_s == 1 / 60
        found = exercise.score(samples).points
        assert found is not None
        points[skill] = found
    assert points["expert"] > 80 and points["novice"] < points["expert"] - 5, points


def test_wrong_samples_are_refused(cyst: insonify.Station) -> None:
    exercise = cyst.exercise
    assert exercise is not None
    pose = insonify.Pose()
    for samples, words in (
        ([(0.0, pose)], "it must be .time_s, pose of the probe"),
        ([(-1.0, pose, pose)], "time_s of a sample is -1"),
        ([(float("nan"), pose, pose)], "time_s of a sample is NaN"),
        ([("soon", pose, pose)], "time_s of a sample is 'soon'"),
        ([(1.0, pose, pose), (0.5, pose, pose)], "is 0.5, before the last one's 1"),
        ([(0.0, pose, (0, 0, float("inf"), 1, 0, 0, 0))], "`z` is inf"),
    ):
        with pytest.raises(insonify.InputError, match=words):
            exercise.score(samples)  # type: ignore[arg-type]
    with pytest.raises(insonify.InputError, match="skill is `master`; it must be novice, trained or expert"):
        exercise.hand("master")
    with pytest.raises(insonify.InputError, match="seed is -1"):
        exercise.hand(seed=-1)
    empty = exercise.score([])
    assert empty.points is None and empty.not_judged == "the session has no pose of the needle"
    outside = exercise.score([(0.0, pose, insonify.Pose((0, 0, -50)))])
    assert outside.points is None and "never in a surface" in str(outside)


def recorded(file: Path) -> Iterator[tuple[str, int, dict[str, Any]]]:
    """Topic, time and content of the JSON messages of a recording: MCAP without compression."""
    topics: dict[int, str] = {}

    def records(data: bytes) -> Iterator[tuple[str, int, dict[str, Any]]]:
        at = 0
        while at + 9 <= len(data):
            opcode, length = struct.unpack_from("<BQ", data, at)
            body = data[at + 9 : at + 9 + length]
            at += 9 + length
            if opcode == 4:
                number, _, size = struct.unpack_from("<HHI", body)
                topics[number] = body[8 : 8 + size].decode()
            elif opcode == 5:
                channel, _, time_ns = struct.unpack_from("<HIQ", body)
                if topics[channel].endswith("/pose"):
                    yield topics[channel], time_ns, json.loads(body[22:])
            elif opcode == 6:
                (size,) = struct.unpack_from("<I", body, 28)
                assert size == 0, "compressed"
                yield from records(body[40:])

    yield from records(file.read_bytes()[8:])


def pose_of(message: dict[str, Any]) -> insonify.Pose:
    p, q = message["pose"]["position"], message["pose"]["orientation"]
    return insonify.Pose([1e3 * p[axis] for axis in "xyz"], [q[axis] for axis in "wxyz"])


def assert_same_numbers(found: Any, expected: Any) -> None:
    """The poses were written and read as text, in metres, so the last digits may differ."""
    assert type(found) is type(expected)
    if isinstance(expected, dict):
        assert found.keys() == expected.keys()
        for key in expected:
            assert_same_numbers(found[key], expected[key])
    elif isinstance(expected, list):
        assert len(found) == len(expected)
        for a, b in zip(found, expected, strict=True):
            assert_same_numbers(a, b)
    elif isinstance(expected, float):
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)
    else:
        assert found == expected


def test_a_recorded_session_has_the_score_of_the_command(tmp_path: Path, run_program: Program) -> None:
    station = insonify.Station("needle_cyst", **FAST)
    # At the border of the cyst, where the mock's needle goes in and out.
    station.set(tracker={"transport": "mock"}, needle={"position_mm": [0.0, 0.0, 22.0]})
    file = write_station(tmp_path / "station.toml", absolute(station))
    recording = tmp_path / "session.mcap"
    said = run_program("run", file, "--duration", "4", "--sink", "null", "--record", recording)
    assert said.returncode == 0, said.stderr
    said = run_program("score", recording, file, "--json")
    assert said.returncode == 0, said.stderr
    expected = json.loads(said.stdout)["needle"]
    samples: list[insonify.NeedleSample] = []
    # The recording's metadata have the start of the session.
    start = re.search(rb"start_time_ns.{4}(\d+)", recording.read_bytes(), re.DOTALL)
    assert start is not None
    first_ns, needle = int(start[1]), (0, insonify.Pose())
    for topic, time_ns, message in sorted(recorded(recording), key=lambda entry: (entry[1], entry[0])):
        if message["state"] in ("stale", "lost"):
            continue
        if topic == "/needle/pose":
            needle = (time_ns, pose_of(message))
        else:
            # A pose of the needle counts for half a second.
            held = needle[1] if time_ns - needle[0] <= 500_000_000 else None
            samples.append(insonify.NeedleSample(1e-9 * (time_ns - first_ns), pose_of(message), held))
    assert len(samples) > 30 and len(expected["events"]) > 1
    exercise = insonify.Station(file).exercise
    assert exercise is not None
    assert_same_numbers(exercise.score(samples).record, expected)


def test_a_scene_of_arrays_has_exercises() -> None:
    corners = np.array([[x, y, z] for x in (-40, 40) for y in (-40, 40) for z in (0, 80)])
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    block = insonify.Surface(corners, faces, "liver", 1, name="block")
    inner = insonify.Surface(corners * 0.1 + (0, 0, 26), faces, "water", 2, name="core")
    scene = insonify.Scene([block, inner], background="gel")
    tables = {"exercise": {"target": "core"}, "needle": {"position_mm": [0, 0, 10]}, "pose": {"position_mm": [0, 0, 0]}}
    station = insonify.Station.from_dict(tables, scene=scene)
    exercise = station.exercise
    assert exercise is not None
    down = [(0.02 * n, insonify.Pose(), insonify.Pose((0.3, 0.2, 0.5 * n - 5))) for n in range(80)]
    score = exercise.score(down)
    assert score.reached is not None and score.reached.position_mm == pytest.approx((0.3, 0.2, 26), abs=0.01)
    with pytest.raises(insonify.StationError, match="`exercise.target` names the surface `kern`"):
        _ = station.copy(exercise={"target": "kern"}).exercise
