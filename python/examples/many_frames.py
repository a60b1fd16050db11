"""A sweep over a cyst of arrays, and how fast its frames come: python many_frames.py [FRAMES]"""

import sys
import time

import insonify
import numpy as np
from insonify.gym import reach_scene


def main(frames: int) -> float:
    """Volume of the cyst, ml, from a sweep along y."""
    station = insonify.Station.from_dict(
        {"probe": {"kind": "linear", "width_mm": 60, "depth_mm": 80}, "image": {"gain_db": 30}}, scene=reach_scene()
    )
    station.set(width=256, height=256, scanlines=96)
    sweep = [insonify.Pose((0, y, 0)) for y in np.linspace(-15, 15, frames)]
    cyst_mm2: list[float] = []
    started = time.monotonic()
    for frame in station.render_many(sweep, quality="4x3"):
        cyst_mm2.append(float(frame.tissue("amniotic_fluid").sum()) * frame.mm_per_pixel**2)
    rate = frames / (time.monotonic() - started)
    areas_mm2 = np.array(cyst_mm2)
    volume_ml = float((areas_mm2[1:] + areas_mm2[:-1]).sum()) / 2 * 30 / (frames - 1) / 1000
    print(f"{rate:.0f} frames a second; the cyst has {volume_ml:.2f} ml, a ball of 10 mm 4.19 ml")
    return volume_ml


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 120)
