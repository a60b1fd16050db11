#!/usr/bin/env python3
"""Lateral width of a point's image, by diffraction sums, for several apodizations.

The same sums, medium and band as shadow.py, without an obstacle: a fixed transmit focus, a receive aperture focused
at the point's depth with an F-number of at least 2, both with the same weights. The power |transmit field x receive
field|^2 is summed over a Gaussian band. By Parseval it is the energy of a scanline's echo, summed over range. The
width is that between the points where its root has fallen to a half (-6 dB).

Elements lie a part of the wavelength apart, so a sum over them grows with frequency: the band's power carries a factor
f^4, as in shadow.py, and its mean lies about 9 % above the nominal frequency. --band flat takes this factor out: the
echo's power is then Gaussian about the nominal frequency. --band single takes the nominal frequency alone.

usage: point_spread.py DEPTH_MM [--frequency 8] [--aperture 20] [--focus 70] [--apodization rectangular]
                       [--band leaning]
Needs NumPy.
"""
import argparse
import numpy as np

SPEED_MM_US = 1.54
F_NUMBER_MIN = 2.0
BANDS = ("leaning", "flat", "single")
APODIZATIONS = {
    "rectangular": lambda a: np.ones_like(a),
    "hann": lambda a: np.cos(np.pi * a) ** 2,
    "gaussian": lambda a: np.exp(-0.5 * (a / 0.3) ** 2),
}


def field(wavelength, aperture, focus, apodization, x, z, per_wavelength=8):
    """Field of a focused aperture at the lateral places x (mm) in the depth z."""
    k = 2 * np.pi / wavelength
    count = int(np.ceil(aperture * per_wavelength / wavelength))
    part = (np.arange(count) + 0.5) / count - 0.5
    element = aperture * part
    weights = APODIZATIONS[apodization](part) * np.exp(-1j * k * np.hypot(element, focus))
    r = np.hypot(x[:, None] - element[None], z)
    return (np.exp(1j * k * r) / np.sqrt(r)) @ weights


def half_width(x, amplitude):
    """Place where the amplitude falls below half of its maximum for good; x starts at 0."""
    part = amplitude / amplitude.max()
    last = np.flatnonzero(part >= 0.5)[-1]
    return x[last] + (x[last + 1] - x[last]) * (part[last] - 0.5) / (part[last] - part[last + 1])


def profile(depth, frequency, aperture, focus, apodization, x, band="leaning", bandwidth=0.6, bands=9, per_wavelength=8):
    """Root of the echo energy of a point at the lateral places x."""
    power = 0.0
    for part in [1.0] if band == "single" else np.linspace(1 - bandwidth / 2, 1 + bandwidth / 2, bands):
        wavelength = SPEED_MM_US / (frequency * part)
        weight = np.exp(-0.5 * ((part - 1) / (bandwidth / 2.355)) ** 2)
        if band == "flat":
            weight /= part**4
        transmit = field(wavelength, aperture, focus, apodization, x, depth, per_wavelength)
        receive = field(wavelength, min(aperture, depth / F_NUMBER_MIN), depth, apodization, x, depth, per_wavelength)
        power = power + weight * np.abs(transmit * receive) ** 2
    return np.sqrt(power)


def width(depth, frequency, aperture, focus, apodization, **sums):
    """-6 dB two-way lateral width, mm."""
    x = np.arange(0, 12, 0.02)
    coarse = half_width(x, profile(depth, frequency, aperture, focus, apodization, x, **sums))
    x = np.linspace(0, 2 * coarse, 200)
    return 2 * half_width(x, profile(depth, frequency, aperture, focus, apodization, x, **sums))


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("depth", type=float)
    p.add_argument("--frequency", type=float, default=8.0)
    p.add_argument("--aperture", type=float, default=20.0)
    p.add_argument("--focus", type=float, default=70.0)
    p.add_argument("--apodization", choices=APODIZATIONS, default="rectangular")
    p.add_argument("--band", choices=BANDS, default="leaning")
    a = p.parse_args()
    print(f"{width(a.depth, a.frequency, a.aperture, a.focus, a.apodization, band=a.band):.4f} mm")


if __name__ == "__main__":
    main()
