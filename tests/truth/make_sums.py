#!/usr/bin/env python3
"""Writes the fixtures that follow from the diffraction sums of shadow.py, elevation.py, point_spread.py, refraction.py and
edge.py.

usage: make_sums.py shadow|elevation|point_spread|convex|refraction|edges|leaving|wires > FIXTURE.csv
Needs NumPy. Progress goes to the standard error.
"""
import argparse
import sys
import numpy as np
import edge
import elevation
import point_spread
import refraction
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


def refraction_cases():
    """Speed maps of refraction.py: (name, size, offsets)."""
    yield from (("tilt", size, [0]) for size in (15, 30))
    yield from (("wavy", period, np.arange(5) * period / 5) for period in (12, 14, 20))
    yield "cylinder", 7, np.arange(7)
    yield "recti", 6, np.arange(0, 13, 2)


def write_refraction():
    print("# Two-way beam behind a speed map, by tests/truth/refraction.py (make_sums.py refraction), flat array of 8 MHz,")
    print("# aperture 20 mm, focus 70 mm: shift and RMS width of its power, its level over that of the homogeneous medium.")
    print("case,size,offset_mm,depth_mm,shift_mm,spread_mm,level_db")
    depths = [60.0, 95.0, 120.0]
    plain, x = refraction.two_way(lambda x, z: np.full_like(x, refraction.C0), depths, 8, 20, 70)
    for name, size, offsets in refraction_cases():
        for offset in offsets:
            power, _ = refraction.two_way(lambda x, z: refraction.CASES[name](x, z, size, offset), depths, 8, 20, 70)
            for depth, bent, straight in zip(depths, power, plain):
                shift, spread, _, level = refraction.measures(bent, straight, x)
                print(f"{name},{size},{offset:g},{depth:g},{shift:.3f},{spread:.3f},{level:.2f}", flush=True)
        print(f"{name} {size}", file=sys.stderr)


def write_edges():
    print("# Speckle near the ends of the apertures of a linear array, by tests/truth/edge.py (make_sums.py edges).")
    print("# rim: distance from the array's end, level over a scanline with whole apertures.")
    print("# contact: elements at x < 0 are not coupled; x of the scanline, level over full contact. -inf: no elements are left.")
    print("case,frequency_mhz,aperture_mm,focus_mm,place_mm,depth_mm,level_db")
    places = {"rim": (0, 0.125, 0.5, 1, 2, 4, 6, 10), "contact": (-8, -6, -5, -4, -3, -2, -1, 0, 1, 2, 3, 4, 6, 8, 10, 12)}
    for beam in ((8, 20, 70), (5, 14, 60)):
        for case in places:
            for place in places[case]:
                for depth in (30, 60, 100):
                    level = edge.level_db(place, depth, *beam)
                    print(f"{case},{beam[0]},{beam[1]},{beam[2]},{place:g},{depth},{level:.2f}", flush=True)
            print(f"{case}, {beam[0]} MHz", file=sys.stderr)


def two_way_at_end(speed, depths, side, place):
    """refraction.two_way of a scanline `place` mm from the array's right end, or its left one if `side` is negative.

    Elements beyond the end are missing; the others keep their weights. No end if `side` is 0.
    """
    whole = refraction.aperture

    def cut(x, width, focus, k):
        return whole(x, width, focus, k) * (side * x <= place + 1e-9)

    refraction.aperture = cut
    try:
        power, x = refraction.two_way(speed, depths, 8, 20, 70)
    finally:
        refraction.aperture = whole
    # two_way divides by the weights of the receive aperture.
    weights = [(np.abs(cut(x, min(20, depth / 2), depth, 1.0)) ** 2).sum() for depth in depths]
    return power * np.array(weights)[:, None], x


def write_leaving():
    print("# Two-way beams near the ends of a flat array of 8 MHz behind a tilted plane (1450 over 1580 m/s, 20 mm deep at the end), by")
    print("# tests/truth/refraction.py without the elements beyond the end (make_sums.py leaving). Aperture 20 mm, focus 70 mm.")
    print("# side: 1 is the right end, beams bend outwards; -1 the left one. Level over whole apertures in a homogeneous medium;")
    print("# beyond_part: part of the power that returns from beyond the end.")
    print("tilt_deg,side,place_mm,depth_mm,shift_mm,level_db,beyond_part")
    depths = [60.0, 95.0, 120.0]
    plain, x = two_way_at_end(lambda x, z: np.full_like(x, refraction.C0), depths, 0, 0)
    for tilt in (15, 30):
        for side in (1, -1):
            for place in (0.125, 1, 2, 4, 6, 10):
                tilted = lambda x, z: refraction.CASES["tilt"](x, z, tilt, side * place)
                power, _ = two_way_at_end(tilted, depths, side, place)
                for depth, bent, straight in zip(depths, power, plain):
                    shift, level = (bent * x).sum() / bent.sum(), 10 * np.log10(bent.sum() / straight.sum())
                    beyond = bent[side * x > place].sum() / bent.sum()
                    print(f"{tilt},{side},{place:g},{depth:g},{shift:.3f},{level:.2f},{beyond:.3f}", flush=True)
            print(f"tilt {tilt}, side {side}", file=sys.stderr)


def write_wires(period=20, depth=95.0, reach=7.5, step=0.25):
    print("# Image of a wire behind the wavy border of refraction.py (period 20 mm), by tests/truth/refraction.py (make_sums.py wires):")
    print("# power of the scanlines within 7.5 mm of it, its centroid less the wire's place and its RMS width. 8 MHz, aperture 20 mm,")
    print("# focus 70 mm. The wave rises from x = 0.")
    print("wire_mm,depth_mm,shift_mm,spread_mm")
    for wire in (-15, 0, 15):
        lines = wire + np.arange(-reach, reach + step / 2, step)
        powers = []
        for line in lines:
            wavy = lambda x, z: refraction.CASES["wavy"](x, z, period, -line)
            (power,), x = refraction.two_way(wavy, [depth], 8, 20, 70)
            powers.append(np.interp(wire - line, x, power))
        powers = np.array(powers)
        shown = (powers * lines).sum() / powers.sum()
        spread = np.sqrt((powers * (lines - shown) ** 2).sum() / powers.sum())
        print(f"{wire},{depth:g},{shown - wire:.3f},{spread:.3f}", flush=True)
        print(f"wire at {wire} mm", file=sys.stderr)


WRITERS = {"shadow": write_shadows, "elevation": write_elevation, "point_spread": write_point_spread,
           "convex": write_convex, "refraction": write_refraction, "edges": write_edges, "leaving": write_leaving,
           "wires": write_wires}


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("fixture", choices=WRITERS)
    WRITERS[p.parse_args().fixture]()


if __name__ == "__main__":
    main()
