#!/usr/bin/env python3
"""Correlation of speckle between steered angles and the SNR of their mean, flat or curved array, by a two-way array simulation.

The array looks at a point on its axis with its beam steered by each angle through that point: the aperture's centre moves along
the face. On a curved face the angle is that to the face's normal; at depth, beams differ by less. Each angle's point spread is the
sum over the band of transmit field (fixed focus on the beam) times receive field (focus at the point, F-number at least 2). Both
apertures have Gaussian weights of sigma 0.3 of their width. The normalised inner product of two point spreads is the correlation of
their complex signals; that of amplitudes follows for Rayleigh statistics. SNR of the mean of n angles: 1.913 n / sqrt(sum of all
amplitude correlations). Printed are means over the depths.

usage: compounding.py [--radius 40] [--depths 66,68,70,72,74] [--span 30] [--angles 9] [--frequency 8] [--aperture 20] [--focus 70]
Needs NumPy. A depth takes some ten seconds.
"""
import argparse
import numpy as np

SPEED_MM_US = 1.54
# Places about the point, mm.
LATERAL = np.arange(-4, 4.001, 0.05)
AXIAL = np.arange(-1.5, 1.501, 0.03)


def amplitude_correlation(r):
    """Correlation of Rayleigh amplitudes whose complex signals correlate by r: the series of 2F1(-1/2, -1/2; 1; r^2)."""
    square, term, total = min(abs(r) ** 2, 1.0), 1.0, 0.0
    for n in range(400):
        total += term
        term *= ((n - 0.5) / (n + 1)) ** 2 * square
    return (np.pi / 4) * (total - 1) / (1 - np.pi / 4)


def point_spread(depth, angle, a):
    """Point spread, of norm 1, of the beam that is steered by `angle` to the normal of the face where it starts."""
    x, z = np.meshgrid(LATERAL, depth + AXIAL)
    if a.radius:
        # The beam's angle to the axis, and the place along the face where it starts.
        tilt = np.arcsin(a.radius * np.sin(angle) / (a.radius + depth))
        start = a.radius * (tilt - angle)
        on_face = lambda s: (a.radius * np.sin(s / a.radius), a.radius * (np.cos(s / a.radius) - 1))
    else:
        tilt, start = angle, -depth * np.tan(angle)
        on_face = lambda s: (s, 0.0 * s)
    x0, z0 = on_face(start)
    along = np.hypot(x0, depth - z0)

    def side(width, focus, k):
        e = np.arange(-width / 2, width / 2 + 1e-9, 0.1)
        weights = np.exp(-0.5 * (e / (0.3 * width)) ** 2)
        ex, ez = on_face(start + e)
        delays = np.hypot(ex - x0 - focus * np.sin(tilt), ez - z0 - focus * np.cos(tilt)) - focus
        return sum(w * np.exp(1j * k * (np.hypot(x - u, z - v) - d)) for w, u, v, d in zip(weights, ex, ez, delays))

    spread = 0
    for part in np.linspace(0.7, 1.3, 7):
        k = 2 * np.pi * a.frequency * part / SPEED_MM_US
        weight = np.exp(-0.5 * ((part - 1) / (0.6 / 2.355)) ** 2)
        received = side(min(a.aperture, depth / 2), along, k)
        spread = spread + weight * side(a.aperture, a.focus, k) * received * np.exp(-2j * k * along)
    return spread / np.linalg.norm(spread)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, value in (("radius", 0.0), ("span", 30.0), ("frequency", 8.0), ("aperture", 20.0), ("focus", 70.0)):
        p.add_argument(f"--{name}", type=float, default=value)
    p.add_argument("--angles", type=int, default=9)
    p.add_argument("--depths", default="66,68,70,72,74")
    a = p.parse_args()
    angles = np.linspace(-a.span / 2, a.span / 2, a.angles)
    middle, correlations, snrs = a.angles // 2, [], []
    for depth in map(float, a.depths.split(",")):
        spreads = [point_spread(depth, np.radians(t), a) for t in angles]
        rho = np.array([[amplitude_correlation(np.vdot(g, h)) for h in spreads] for g in spreads])
        correlations.append(rho[middle, middle:])
        snrs.append(1.913 * a.angles / np.sqrt(rho.sum()))
    print("angle from the middle, degrees: " + " ".join(f"{t - angles[middle]:6.2f}" for t in angles[middle:]))
    print("amplitude correlation:          " + " ".join(f"{r:6.3f}" for r in np.mean(correlations, axis=0)))
    print(f"SNR of the mean of {a.angles}: {np.mean(snrs):.2f}")


if __name__ == "__main__":
    main()
