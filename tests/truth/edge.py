#!/usr/bin/env python3
"""Speckle of a linear array near the ends of its apertures, by wave theory: the array's rim, and half a face in contact.

Two-dimensional Huygens sums in a lossless medium of 1540 m/s, as in shadow.py. The transmit aperture is focused at a fixed
depth, the receive aperture at the scatterer's depth (F-number at least 2). Both are centred on the scanline, have Gaussian
weights of sigma 0.3 of their width, and are cut at their ends. Elements that are missing send and receive nothing; the
weights of the others stay as they are. Speckle power is the sum over lateral scatterers of |transmit field x receive
field|^2, over a Gaussian band. Scatterers lie on both sides of the scanline, also beyond the array.

rim:     the array ends; PLACE is the distance of the scanline from its end, inward. Level over a scanline whose apertures
         are whole, dB.
contact: elements at x < 0 are not coupled; PLACE is the x of the scanline. Level over full contact, dB.

usage: edge.py rim|contact PLACE_MM [--frequency 8] [--aperture 20] [--focus 70] [--depths 30,60,100]
Needs NumPy. A line takes about a second.
"""
import argparse
import numpy as np

SPEED_MM_US = 1.54
F_NUMBER_MIN = 2.0
# Scatterers lie within this distance of the scanline, this far apart, mm.
WINDOW_MM = 24.0
STEP_MM = 0.125


def field(k, wavelength, aperture, focus, first, points, z, per_wavelength=4):
    """Field of a focused aperture about 0, without its elements at x < `first`, at `points` (lateral, mm) in the depth z."""
    start, end = max(-aperture / 2, first), aperture / 2
    if start >= end:
        return np.zeros(len(points), complex)
    # Elements in the middle of equal parts, a fraction of a wavelength wide; their number leans the band as in shadow.py.
    width = wavelength / per_wavelength
    count = int(np.ceil((end - start) / width))
    xa = start + (np.arange(count) + 0.5) * (end - start) / count
    weights = np.exp(-0.5 * (xa / (0.3 * aperture)) ** 2) * np.exp(-1j * k * np.hypot(xa, focus))
    r = np.hypot(points[:, None] - xa[None], z)
    return (np.exp(1j * k * r) / np.sqrt(r)) @ weights * ((end - start) / (count * width))


def power(place, z, frequency, aperture, focus, bandwidth=0.6, bands=9, window=WINDOW_MM, step=STEP_MM, per_wavelength=4):
    """Speckle power of a scanline whose elements start `place` mm before it."""
    points = np.arange(-window, window + step / 2, step)
    total = 0.0
    for part in np.linspace(1 - bandwidth / 2, 1 + bandwidth / 2, bands):
        wavelength = SPEED_MM_US / (frequency * part)
        k = 2 * np.pi / wavelength
        weight = np.exp(-0.5 * ((part - 1) / (bandwidth / 2.355)) ** 2)
        sent = field(k, wavelength, aperture, focus, -place, points, z, per_wavelength)
        heard = field(k, wavelength, min(aperture, z / F_NUMBER_MIN), z, -place, points, z, per_wavelength)
        total += weight * (np.abs(sent * heard) ** 2).sum()
    return total


def level_db(place, z, frequency, aperture, focus, **sums):
    """Level of a scanline `place` mm from the first element that is there, over that of whole apertures, dB.

    -inf if an aperture has no elements at all. The same sum for the rim (the array ends) and for half contact (the face
    is not coupled): what is missing is missing, whatever the reason.
    """
    cut = power(place, z, frequency, aperture, focus, **sums)
    whole = power(aperture, z, frequency, aperture, focus, **sums)
    return 10 * np.log10(cut / whole) if cut > 0 else -np.inf


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("case", choices=["rim", "contact"])
    p.add_argument("place", type=float)
    p.add_argument("--frequency", type=float, default=8.0)
    p.add_argument("--aperture", type=float, default=20.0)
    p.add_argument("--focus", type=float, default=70.0)
    p.add_argument("--depths", default="30,60,100")
    a = p.parse_args()
    if a.case == "rim" and a.place < 0:
        p.error("the array has no scanline beyond its end")
    for z in map(float, a.depths.split(",")):
        print(f"{z:6.1f} mm: {level_db(a.place, z, a.frequency, a.aperture, a.focus):6.1f} dB")


if __name__ == "__main__":
    main()
