"""Frames of many poses: the same ones, in order, with the memory of a few."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import insonify
import numpy as np
import pytest
from conftest import turned


def resident_bytes() -> int:
    """Resident memory of this process."""
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * 4096


def poses(station: insonify.Station, count: int) -> list[insonify.Pose]:
    random = np.random.default_rng(7)
    assert station.pose is not None
    return [turned(station.pose, random, 8, 15) for _ in range(count)]


def test_frames_are_those_of_render_in_the_order_of_the_poses(small: insonify.Station) -> None:
    some = poses(small, 12)
    jobs = [insonify.Job(pose, seed=n, quality=(1 + n % 3, 1), time_s=0.1 * n) for n, pose in enumerate(some)]
    for job, frame in zip(jobs, small.render_many(jobs, lines=True), strict=True):
        alone = small.render(job.pose, seed=job.seed, quality=job.quality, time_s=job.time_s or 0.0)
        assert frame.pose == job.pose
        assert np.array_equal(frame.bmode, alone.bmode) and np.array_equal(frame.segmentation, alone.segmentation)
        assert frame.lines.tobytes() == alone.lines.tobytes()


def test_compounded_frames_are_those_of_render(small: insonify.Station) -> None:
    small.set(look={"angles": 3})
    for pose, frame in zip(poses(small, 4), small.render_many(poses(small, 4)), strict=True):
        assert np.array_equal(frame.bmode, small.render(pose).bmode)


def test_poses_are_taken_as_they_are_needed(small: insonify.Station) -> None:
    taken = 0

    def endless() -> Iterator[insonify.Pose]:
        nonlocal taken
        for pose in itertools.cycle(poses(small, 3)):
            taken += 1
            yield pose

    frames = small.render_many(endless(), ahead=2)
    for _ in range(5):
        next(frames)
    assert taken <= 5 + 3
    frames.close()
    assert taken <= 5 + 3


def test_settings_are_those_of_the_first_frame(small: insonify.Station) -> None:
    some = poses(small, 6)
    before = [small.render(pose).bmode for pose in some]
    frames = small.render_many(some)
    first = next(frames)
    small.set(gain_db=60)
    rest = [frame.bmode for frame in frames]
    assert all(np.array_equal(a, b) for a, b in zip(before, [first.bmode, *rest], strict=True))
    assert not np.array_equal(small.render(some[0]).bmode, before[0])


def test_an_error_ends_the_frames(small: insonify.Station) -> None:
    frames = small.render_many([*poses(small, 2), (0, 0, float("nan"), 1, 0, 0, 0)], ahead=1)
    with pytest.raises(insonify.PoseError, match="`z` is NaN"):
        list(frames)
    with pytest.raises(insonify.InputError, match="ahead is 0"):
        list(small.render_many(poses(small, 1), ahead=0))

    def failing() -> Iterator[insonify.Pose]:
        yield from poses(small, 2)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        list(small.render_many(failing()))


def test_memory_is_flat_over_many_frames() -> None:
    station = insonify.Station("sphere", width=96, height=80, scanlines=24, samples=256)
    pose = station.pose
    assert pose is not None

    def render(count: int) -> int:
        for frame in station.render_many(itertools.repeat(pose, count), quality="fast", lines=True):
            assert frame.bmode.shape == (80, 96)
        return resident_bytes()

    warm = render(1000)
    after = render(3000)
    # A frame that leaked would be 60 kB: 180 MB in all.
    assert after < 1.02 * warm + 2_000_000, (warm, after)
