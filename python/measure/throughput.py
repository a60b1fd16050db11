"""Frames a second of `render_many` against the Rust library's own, in turns: python throughput.py RUST-EXAMPLE [FRAMES]

RUST-EXAMPLE is target/release/examples/throughput (cargo build --release -p insonify-python --example throughput).
"""

import itertools
import statistics
import subprocess
import sys
import time

import insonify

CASES = [("obstetric", "1x1"), ("obstetric", "4x3"), ("sphere", "1x1"), ("lung_air", "2x3")]
TURNS = 5


def python_rate(station: insonify.Station, quality: str, frames: int, lines: bool) -> float:
    """Frames a second; the first tenth warms up."""
    pose = station.pose
    if pose is None:
        raise SystemExit("the station has no pose")
    warm, started, last = frames // 10, 0.0, 0.0
    for n, frame in enumerate(station.render_many(itertools.repeat(pose, frames + warm), quality=quality, lines=lines)):
        last = float(frame.bmode[0, 0])
        if n == warm - 1:
            started = time.monotonic()
    return frames / (time.monotonic() - started) + 0 * last


def main(rust: str, frames: int) -> None:
    """Prints a table of medians over turns."""
    print("| station, quality | Rust, frames/s | Python | ratio | with lines |\n|---|---:|---:|---:|---:|")
    for name, quality in CASES:
        station = insonify.Station(name, backend="host")
        rates: list[tuple[float, float, float]] = []
        for _ in range(TURNS):
            command = [rust, str(station.path), quality, str(frames)]
            own = float(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
            rates.append(
                (own, python_rate(station, quality, frames, False), python_rate(station, quality, frames, True))
            )
        own, python, lines = (statistics.median(rate[part] for rate in rates) for part in range(3))
        print(f"| {name}, {quality} | {own:.1f} | {python:.1f} | {python / own:.2f} | {lines / own:.2f} |", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 100)
