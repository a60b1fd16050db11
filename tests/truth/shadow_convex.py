#!/usr/bin/env python3
"""Depth of the shadow behind a thin opaque strip, seen by a curved array: shadow.py with elements on an arc.

The elements of a scanline's aperture lie on an arc of the given radius, with the scanline along its middle radius. The
strip lies on a concentric arc, and so do the scatterers behind it. Depths are measured from the face along the
scanline; lateral places and widths are lengths along their own arc. Medium, apertures, weights, band and the printed
power ratio are those of shadow.py. A radius of 10 m gives its values.

usage: shadow_convex.py STRIP_DEPTH_MM HALF_WIDTH_MM RADIUS_MM [--frequency 5] [--aperture 20] [--focus 90] [--offset 0]
                        [--behind 5,10,20,40,60]
Needs NumPy.
"""
import argparse
import numpy as np

SPEED_MM_US = 1.54
F_NUMBER_MIN = 2.0


def arc(radius, depth, lateral):
    """Places on the arc at a depth, as complex numbers about the middle of the face (real: lateral, imaginary: depth)."""
    angle = lateral / (radius + depth)
    # sin(angle / 2) keeps the depth exact for very large radii.
    return (radius + depth) * np.sin(angle) + 1j * (depth - 2 * (radius + depth) * np.sin(angle / 2) ** 2)


def at_strip(k, aperture, focus, radius, elements, places):
    """Field of a focused aperture at places of the strip's arc."""
    lateral = np.arange(-aperture / 2, aperture / 2, 2 * np.pi / k / elements)
    element = arc(radius, 0, lateral)
    weights = np.exp(-0.5 * (lateral / (0.3 * aperture)) ** 2) * np.exp(-1j * k * np.abs(element - 1j * focus))
    r = np.abs(places[:, None] - element[None])
    return (np.exp(1j * k * r) / np.sqrt(r)) @ weights


def levels_db(behind, strip_z, strips, frequency, aperture, focus, radius, bandwidth=0.6, bands=9,
              window=30.0, elements=4, places=5):
    """Levels of several strips, each a pair of half width and offset."""
    z = strip_z + behind
    points = arc(radius, z, np.linspace(-12, 12, 97))
    power = np.zeros(1 + len(strips))
    for part in np.linspace(1 - bandwidth / 2, 1 + bandwidth / 2, bands):
        wavelength = SPEED_MM_US / (frequency * part)
        k = 2 * np.pi / wavelength
        weight = np.exp(-0.5 * ((part - 1) / (bandwidth / 2.355)) ** 2)
        lateral = np.arange(-window, window, wavelength / places)
        strip = arc(radius, strip_z, lateral)
        normal = np.exp(1j * (np.pi / 2 - lateral / (radius + strip_z)))
        way = points[:, None] - strip[None]
        r = np.abs(way)
        # Places whose outward side does not face the point send nothing to it.
        facing = np.maximum((way * normal.conj()[None]).real / r, 0)
        green = np.exp(1j * k * r) / np.sqrt(r) * facing
        clear = [np.ones(len(lateral))] + [np.abs(lateral - offset) > half_width for half_width, offset in strips]
        clear = np.stack(clear, 1)
        transmit = green @ (clear * at_strip(k, aperture, focus, radius, elements, strip)[:, None])
        receive = green @ (clear * at_strip(k, min(aperture, z / F_NUMBER_MIN), z, radius, elements, strip)[:, None])
        power += weight * (np.abs(transmit * receive) ** 2).sum(0)
    return 10 * np.log10(power[1:] / power[0])


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("strip_depth", type=float)
    p.add_argument("half_width", type=float)
    p.add_argument("radius", type=float)
    p.add_argument("--frequency", type=float, default=5.0)
    p.add_argument("--aperture", type=float, default=20.0)
    p.add_argument("--focus", type=float, default=90.0)
    p.add_argument("--offset", type=float, default=0.0, help="lateral place of the strip's middle along its arc, mm")
    p.add_argument("--behind", default="5,10,20,40,60")
    a = p.parse_args()
    for behind in map(float, a.behind.split(",")):
        strips = [(a.half_width, a.offset)]
        level = levels_db(behind, a.strip_depth, strips, a.frequency, a.aperture, a.focus, a.radius)[0]
        print(f"{behind:6.1f} mm behind: {level:6.1f} dB")


if __name__ == "__main__":
    main()
