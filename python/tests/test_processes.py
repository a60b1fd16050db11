"""Threads, forks, spawned processes, Ctrl-C, and silence under `-X dev -W error`."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import insonify
import numpy as np
import pytest
from conftest import SMALL

POSE = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)


def rendered(station: insonify.Station, seed: int) -> bytes:
    return station.render(POSE, seed=seed).bmode.tobytes()


def run(script: str, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *options, "-c", script]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


@pytest.mark.parametrize("method", ["fork", "spawn", "forkserver"])
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_processes_render_what_their_parent_renders(small: insonify.Station, method: str) -> None:
    expected = [rendered(small, seed) for seed in range(6)]
    with multiprocessing.get_context(method).Pool(2) as pool:
        jobs = [(small, seed) for seed in range(6)]
        assert pool.starmap_async(rendered, jobs).get(timeout=120) == expected


def fine_ball() -> insonify.Station:
    """A station of arrays with 7,200 triangles: its surface is repaired by several threads."""
    rows = np.linspace(0, np.pi, 62)[1:-1]
    turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(60)], axis=1)
    corners = [20 * np.sin(row) * ring + [0, 0, 60 + 20 * np.cos(row)] for row in rows]
    vertices = np.concatenate([*corners, [[0, 0, 80], [0, 0, 40]]])
    faces: list[list[int]] = []
    for n in range(60):
        m, last = (n + 1) % 60, 59 * 60
        faces += [[3600, n, m], [3601, last + m, last + n]]
        for row in range(0, 59 * 60, 60):
            faces += [[row + n, row + 60 + n, row + 60 + m], [row + n, row + 60 + m, row + m]]
    scene = insonify.Scene([(vertices, faces, "liver", 1)], background="water")
    return insonify.Station.from_dict({"image": {"width": 160, "height": 120}}, scene=scene)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_scenes_of_arrays_cross_a_fork() -> None:
    station = fine_ball()
    expected = rendered(station, 1)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.starmap_async(rendered, [(station, 1)] * 2).get(timeout=120) == [expected] * 2


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_a_fork_amid_frames_has_a_clear_error_or_goes_on() -> None:
    script = f"""
import os, sys, insonify
station = insonify.Station("sphere", **{SMALL!r})
frames = station.render_many([{POSE}] * 50)
next(frames)
process = os.fork()
if process == 0:
    try:
        next(frames)
    except insonify.RenderError as error:
        assert "forked" in str(error), error
        fresh = insonify.Station("sphere", **{SMALL!r})
        assert fresh.render({POSE}).bmode.any()
        os._exit(7)
    os._exit(1)
assert sum(1 for _ in frames) == 49
assert os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]) == 7
"""
    said = run(script)
    assert said.returncode == 0, said.stderr


def test_threads_share_a_station(small: insonify.Station) -> None:
    expected = [rendered(small, seed) for seed in range(16)]
    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(lambda seed: rendered(small, seed), range(16))) == expected


def test_other_threads_run_while_a_frame_is_made() -> None:
    station = insonify.Station("sphere", scanlines=128)
    station.prepare()
    done, counted = threading.Event(), 0

    def count() -> None:
        nonlocal counted
        while not done.is_set():
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    started = time.monotonic()
    station.render(POSE, quality="accurate")
    took = time.monotonic() - started
    done.set()
    thread.join()
    assert counted > 50 * took, (counted, took)


@pytest.mark.skipif(os.name == "nt", reason="signals of Unix")
@pytest.mark.parametrize(
    "work",
    [
        "for frame in station.render_many(itertools.repeat(pose)): pass",
        "while True: station.render(pose, quality='64x3')",
    ],
)
def test_ctrl_c_ends_rendering_at_once(work: str) -> None:
    script = f"""
import itertools, insonify
station = insonify.Station("sphere", scanlines=128)
pose = {POSE}
station.prepare()
print("ready", flush=True)
try:
    {work}
except KeyboardInterrupt:
    print("interrupted", flush=True)
    # The station is as good as before.
    station.set(scanlines=32)
    assert station.render(pose, quality="fast").bmode.any()
    print("goes on", flush=True)
"""
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        time.sleep(0.5)
        sent = time.monotonic()
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == "interrupted\n"
        assert time.monotonic() - sent < 2
        assert process.stdout.readline() == "goes on\n"
        assert process.wait(20) == 0


def test_nothing_is_said_under_the_strictest_python() -> None:
    script = f"""
import insonify, numpy
station = insonify.Station("sphere", **{SMALL!r})
frame = station.render({POSE})
for frame in station.render_many([{POSE}] * 3, lines=True):
    frame.png()
insonify.Scene([(numpy.eye(4, 3) * 10, [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]], "liver", 1)])
del frame, station
"""
    said = run(script, "-X", "dev", "-W", "error")
    assert (said.returncode, said.stderr) == (0, "")


def test_memory_of_a_scene_is_shared() -> None:
    script = f"""
import insonify
def resident():
    return int(open("/proc/self/statm").read().split()[1]) * 4096
station = insonify.Station("obstetric", **{SMALL!r})
before = resident()
station.prepare()
one = resident() - before
others = [station.copy(gain_db=20 + n) for n in range(7)]
for other in others:
    other.prepare()
further = (resident() - before - one) / 7
# Each has the buffers of a renderer, and the skin that its probe touches.
assert further < 0.45 * one, (one, further)
"""
    said = run(script)
    assert said.returncode == 0, said.stderr + said.stdout


def test_a_picture_is_the_same_with_one_thread(small: insonify.Station) -> None:
    script = f"""
import insonify, sys
station = insonify.Station("sphere", **{SMALL!r})
sys.stdout.buffer.write(station.render({POSE}, seed=4).bmode.tobytes())
"""
    command = [sys.executable, "-c", script]
    environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
    said = subprocess.run(command, capture_output=True, check=True, env=environment, timeout=60)
    assert said.stdout == rendered(small, 4) and np.frombuffer(said.stdout, np.uint8).any()
