"""Memory over many frames and steps: python memory.py [FRAMES] [STEPS]"""

import itertools
import sys
import time

import gymnasium
import insonify
import insonify.gym
import numpy as np

gymnasium.register_envs(insonify.gym)


def resident_mb() -> float:
    """Resident memory of this process."""
    with open("/proc/self/statm") as statm:
        return int(statm.read().split()[1]) * 4096e-6


def frames_of(count: int) -> None:
    """Frames of a small scene."""
    station = insonify.Station("sphere", width=128, height=96, scanlines=32, samples=256)
    pose = station.pose
    if pose is None:
        raise SystemExit("the station has no pose")
    started, warm = time.monotonic(), 0.0
    for n, frame in enumerate(station.render_many(itertools.repeat(pose, count), quality="fast", lines=True), 1):
        if n == count // 10:
            warm = resident_mb()
        if frame.overflows or n == count:
            print(f"frame {n}: {resident_mb():.1f} MB, {warm:.1f} MB after a tenth, {time.monotonic() - started:.0f} s")


def steps_of(count: int) -> None:
    """Steps of an environment."""
    environment = gymnasium.make("insonify/StandardPlane-v0")
    environment.reset(seed=1)
    random = np.random.default_rng(1)
    started, warm = time.monotonic(), 0.0
    for n in range(1, count + 1):
        _, _, terminated, truncated, _ = environment.step(random.uniform(-1, 1, 6).astype(np.float32))
        if terminated or truncated:
            environment.reset()
        if n == count // 10:
            warm = resident_mb()
    print(f"step {count}: {resident_mb():.1f} MB, {warm:.1f} MB after a tenth, {time.monotonic() - started:.0f} s")


if __name__ == "__main__":
    frames_of(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
    steps_of(int(sys.argv[2]) if len(sys.argv) > 2 else 10_000)
