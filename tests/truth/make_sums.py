#!/usr/bin/env python3
"""Writes the fixtures that follow from the diffraction sums of shadow.py, elevation.py and point_spread.py.

usage: make_sums.py shadow|elevation|point_spread|convex > FIXTURE.csv
Needs NumPy. Progress goes to the standard error.
"""
import argparse
import sys
import numpy as np
import elevation
import point_spread
import shadow
import shadow_convex

BEHIND = (5, 10, 20, 40, 60)


def named_shadows():
    """Strips of 3 mm, plates of 8 mm and half-planes: (depth, half width, offset, frequency, aperture, focus)."""
    for focus in (60, 90, 120):
        yield 60, 1.5, 0, 5, 20, focus
    for focus in (60, 90):
        yield 40, 4, 0, 5, 20, focus
    for focus in (60, 90):
        for edge in (-3, -1.5, 0, 1.5, 3, 6):
            # A half-plane is opaque from its edge to 60 mm beside it.
            yield 60, 30, edge + 30, 5, 20, focus


def held_out_shadows(count=20, seed=2121):
    """Random strips, to try a model on cases that it was not made for."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        yield (int(random.integers(30, 81)), float(random.choice([1, 2, 3])), round(float(random.uniform(-4, 4)), 1),
               float(random.choice([3.5, 5, 8])), int(random.choice([14, 20])), int(random.integers(10, 25) * 5))


def write_shadows():
    print("# Speckle power behind an opaque strip over that without it, by tests/truth/shadow.py (make_sums.py shadow).")
    print("# Rows from 'held out' on: random cases of seed 2121.")
    print("depth_mm,half_width_mm,offset_mm,frequency_mhz,aperture_mm,focus_mm,behind_mm,level_db")
    named, held_out = list(named_shadows()), list(held_out_shadows())
    for number, case in enumerate(named + held_out):
        if number == len(named):
            print("# held out")
        depth, half_width, offset, frequency, aperture, focus = case
        for behind in BEHIND:
            level = shadow.shadow_db(behind, depth, half_width, frequency, aperture, focus, offset)
            print(",".join(f"{v:g}" for v in (*case, behind)) + f",{level:.2f}", flush=True)
        print(f"{number + 1} of {len(named) + len(held_out)}: {case}", file=sys.stderr)


def write_elevation():
    print("# Correlation of speckle after a slide across the slice, by tests/truth/elevation.py (make_sums.py elevation).")
    print("frequency_mhz,height_mm,focus_mm,depth_mm,slide_mm,correlation")
    # Steps of 0.02 mm up to 0.60 mm, then of 0.1 mm, and the slides of elevation.py.
    slides = sorted({round(0.02 * i, 2) for i in range(31)} | {0.7, 0.8, 0.9, 1.2} | set(elevation.SLIDES))
    for frequency in (5, 8):
        for depth in (30, 70, 120):
            step, rho = elevation.correlation(depth, frequency, 12, 70)
            for slide in slides:
                print(f"{frequency},12,70,{depth},{slide:g},{rho[round(slide / step)]:.4f}")


def write_point_spread():
    print("# -6 dB two-way lateral width of a point, by tests/truth/point_spread.py (make_sums.py point_spread).")
    print("# width_mm: band leaning to high frequencies, as in shadow.py.")
    print("# flat_width_mm: echo Gaussian about the nominal frequency.")
    print("# single_width_mm: nominal frequency alone.")
    print("apodization,frequency_mhz,aperture_mm,focus_mm,depth_mm,width_mm,flat_width_mm,single_width_mm")
    for frequency, focus in ((3.5, 70), (5, 40), (5, 70), (5, 100), (8, 70)):
        for apodization in point_spread.APODIZATIONS:
            for depth in range(20, 150, 10):
                case = (depth, frequency, 20, focus, apodization)
                widths = [point_spread.width(*case, band=band) for band in point_spread.BANDS]
                print(f"{apodization},{frequency:g},20,{focus},{depth}" + "".join(f",{w:.4f}" for w in widths), flush=True)
            print(f"{frequency} MHz, focus {focus} mm, {apodization}", file=sys.stderr)


def write_convex():
    print("# Speckle power behind an opaque strip, curved array, by tests/truth/shadow_convex.py (make_sums.py convex).")
    print("# Widths and offsets are arc lengths at the strip's depth. Half width 30: half-plane from offset - 30.")
    print("radius_mm,depth_mm,half_width_mm,offset_mm,frequency_mhz,aperture_mm,focus_mm,behind_mm,level_db")
    strips = [(half_width, 0) for half_width in (1.5, 2.5, 4)] + [(30, edge + 30) for edge in (-1.5, 0, 1.5)]
    for radius in (40, 60):
        for frequency, focus in ((3.5, 70), (5, 60), (5, 90), (8, 70)):
            for depth in (40, 60):
                groups = [shadow_convex.levels_db(b, depth, strips, frequency, 20, focus, radius) for b in BEHIND]
                for number, (half_width, offset) in enumerate(strips):
                    for behind, levels in zip(BEHIND, groups):
                        case = (radius, depth, half_width, offset, frequency, 20, focus, behind)
                        print(",".join(f"{v:g}" for v in case) + f",{levels[number]:.2f}", flush=True)
                print(f"radius {radius}, {frequency} MHz, focus {focus}, depth {depth}", file=sys.stderr)


WRITERS = {"shadow": write_shadows, "elevation": write_elevation, "point_spread": write_point_spread,
           "convex": write_convex}


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("fixture", choices=WRITERS)
    WRITERS[p.parse_args().fixture]()


if __name__ == "__main__":
    main()
