#!/usr/bin/env python3
"""Contrast of stripes of scatterers behind a map of speeds, by wave theory, for tests/simulation/walls.rs.

usage: INSONIFY_WRITE_SPEEDS=DIR cargo test --release --test simulation walls::stripes; tests/truth/stripes.py DIR/*.f32

Two-dimensional angular spectrum, split step, at three frequencies about 8 MHz: each row of the map delays the field. The
transmit aperture of 20 mm is focused at 70 mm, the receive aperture at the depth (F-number at least 2); both have Gaussian
weights of sigma 0.3 of their width. Stripes are 4 mm wide, 8 mm apart; power is summed over beams about their middles and
about the gaps' middles, at four depths from 95 to 120 mm. Lossless. Needs NumPy; a map takes some ten seconds.
"""
import sys

import numpy as np

C0 = 1540.0
PIXEL_MM, ROWS, COLUMNS = 0.125, 1040, 512
DEPTHS_MM = [95.0, 103.0, 112.0, 120.0]
DX_MM, N = 0.1, 1024
X = (np.arange(N) - N / 2) * DX_MM
EDGE = np.exp(-((X / (0.45 * N * DX_MM)) ** 20))
STRIPES = (np.abs((X + 4) % 8 - 4) < 2) & (np.abs(X) < 18)


def aperture(x, width, focus, k):
    lens = np.exp(-1j * k * (np.hypot(x, focus) - focus))
    return np.exp(-0.5 * (x / (0.3 * width)) ** 2) * (np.abs(x) <= width / 2) * lens


def contrast_db(path):
    speeds = np.fromfile(path, dtype="<f4").reshape(ROWS, COLUMNS).astype(float)
    last = np.where(np.any(np.abs(speeds - C0) > 0.5, axis=1))[0].max() + 1
    columns = np.clip(np.round(X / PIXEL_MM + COLUMNS / 2 - 0.5).astype(int), 0, COLUMNS - 1)
    beams = [(middle + off, on) for on, middles in ((True, (-8, 0, 8)), (False, (-12, -4, 4, 12)))
             for middle in middles for off in (-0.3, 0.0, 0.3)]
    power = np.zeros(len(beams))
    for part in (0.8, 1.0, 1.2):
        omega = 2 * np.pi * 8.0 * part
        k = omega / (C0 / 1000)
        kx = 2 * np.pi * np.fft.fftfreq(N, DX_MM)
        hop = lambda mm: np.exp(1j * mm * (np.sqrt(np.maximum(k * k - kx * kx, 0)) - k)) * (np.abs(kx) < 0.8 * k)  # noqa: E731
        field = np.array([aperture(X - at, *face, k) for at, _ in beams
                          for face in [(20.0, 70.0)] + [(min(20.0, z / 2), z) for z in DEPTHS_MM]])
        step = hop(PIXEL_MM)
        for row in range(last):
            screen = EDGE * np.exp(1j * omega * PIXEL_MM * 1000 * (1 / speeds[row, columns] - 1 / C0))
            field = np.fft.ifft(np.fft.fft(field, axis=1) * step, axis=1) * screen
        spectrum = np.fft.fft(field, axis=1)
        weight = np.exp(-0.5 * ((part - 1) / (0.6 / 2.355)) ** 2)
        for number, depth in enumerate(DEPTHS_MM):
            there = np.fft.ifft(spectrum * hop(depth - last * PIXEL_MM), axis=1).reshape(len(beams), -1, N)
            two_way = np.abs(there[:, 0] * there[:, 1 + number]) ** 2
            power += weight * (two_way * STRIPES).sum(axis=1)
    on = np.array([on for _, on in beams])
    return 10 * np.log10(power[on].mean() / power[~on].mean())


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    for path in sys.argv[1:]:
        print(f"{path}: {contrast_db(path):.1f} dB")
