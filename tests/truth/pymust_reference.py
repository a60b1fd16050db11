#!/usr/bin/env python3
"""Point spread and speckle by PyMUST's SIMUS, for the flat arrays of point_spread.py.

width: the echo of a point on all elements (half a wavelength apart) of the transmit aperture, with the point at several
places beside the scanline. A sum over the elements, focused at the point's depth with an F-number of at least 2 and the
transmit aperture's weights, makes the scanline. Its spectrum is brought to the bands of point_spread.py: flat and leaning.
width_mm, flat_width_mm: -6 dB width of the root of the line's energy. flat_peak_width_mm: that of the envelope's peak.

speckle: mean over standard deviation of the envelope of independent scatterers (Rayleigh: 1.913).

usage: pymust_reference.py width > pymust_point_spread.csv; pymust_reference.py speckle
Needs NumPy and PyMUST. Progress goes to the standard error.
"""
import argparse
import sys
import numpy as np
import pymust
import point_spread as sums

BANDWIDTH = 0.6


class Probe:
    """A flat array of SIMUS with a fixed transmit focus."""

    def __init__(self, frequency, aperture, focus, apodization):
        self.frequency, self.apodization = frequency, sums.APODIZATIONS[apodization]
        self.count = int(round(aperture / (sums.SPEED_MM_US / frequency / 2)))
        self.pitch = aperture / self.count
        part = (np.arange(self.count) + 0.5) / self.count - 0.5
        self.elements, self.aperture = aperture * part, aperture
        param = pymust.utils.Param()
        param.fc, param.pitch, param.kerf, param.c = 1e6 * frequency, 1e-3 * self.pitch, 0.0, 1e3 * sums.SPEED_MM_US
        param.radius = np.inf
        param.Nelements, param.bandwidth, param.TXnow, param.fs = self.count, 100.0, 1, 8e6 * frequency
        param.TXapodization = self.apodization(part)
        law = -np.hypot(self.elements, focus) / sums.SPEED_MM_US
        self.delays = law - law.min()
        self.param = param
        # The middle of the aperture fires this much after time 0.
        self.start = focus / -sums.SPEED_MM_US - law.min()
        pulse, t = pymust.getpulse(param, 2)
        self.pulse = (np.asarray(pulse).ravel(), 1e6 * np.asarray(t).ravel())

    def echoes(self, x, z, strength):
        """RF signals of scatterers [element, sample], and the time step, us."""
        rf, _ = pymust.simus(1e-3 * x, 1e-3 * z, strength, 1e-6 * self.delays[None], self.param)
        return np.asarray(rf).T, 1e6 / self.param.fs

    def line(self, x, z, strength, depth):
        """Spectrum of the scanline on the axis, focused at `depth`: flat band, leaning band, and times after inversion."""
        rf, dt = self.echoes(x, z, strength)
        # One length for all places of the point.
        count = 2 * int((2 * depth / sums.SPEED_MM_US + 30) / dt)
        f = np.fft.rfftfreq(count, dt)
        part = f / self.frequency
        band = np.abs(part - 1) <= BANDWIDTH / 2
        pulse, t = self.pulse
        spectrum = np.abs(np.exp(-2j * np.pi * f[band, None] * t[None]) @ pulse)
        weight = np.exp(-0.25 * ((part[band] - 1) / (BANDWIDTH / 2.355)) ** 2)
        aperture = min(self.aperture, depth / sums.F_NUMBER_MIN)
        used = np.abs(self.elements) <= aperture / 2
        law = (np.hypot(self.elements[used], depth) - depth) / sums.SPEED_MM_US
        weights = self.apodization(self.elements[used] / aperture)
        phases = np.exp(2j * np.pi * law[:, None] * f[None, band])
        flat = np.zeros(count, complex)
        flat[: len(f)][band] = (weights[:, None] * phases * np.fft.rfft(rf[used], count)[:, band]).sum(0) * weight / spectrum
        leaning = flat.copy()
        leaning[: len(f)] *= part**2
        return flat, leaning, dt * np.arange(count)


def write_widths():
    print("# -6 dB two-way lateral width of a point by PyMUST (pymust_reference.py width). sums_*: point_spread.py.")
    print("apodization,frequency_mhz,aperture_mm,focus_mm,depth_mm,width_mm,sums_width_mm,flat_width_mm,sums_flat_width_mm,"
          "flat_peak_width_mm")
    for frequency in (3.5, 5, 8):
        for apodization in sums.APODIZATIONS:
            probe = Probe(frequency, 20.0, 70.0, apodization)
            for depth in (30, 70, 120):
                expected = [sums.width(depth, frequency, 20, 70, apodization, band=band) for band in ("leaning", "flat")]
                x = max(expected) * np.linspace(0.25, 0.65, 9)
                x[0] = 0
                lines = [probe.line(np.array([v]), np.array([float(depth)]), np.ones(1), depth)[:2] for v in x]
                flat, leaning = (np.array([line[i] for line in lines]) for i in (0, 1))
                energy = [2 * sums.half_width(x, np.linalg.norm(s, axis=1)) for s in (leaning, flat)]
                peak = 2 * sums.half_width(x, np.abs(np.fft.ifft(flat)).max(1))
                values = (energy[0], expected[0], energy[1], expected[1], peak)
                print(f"{apodization},{frequency:g},20,70,{depth}" + "".join(f",{v:.4f}" for v in values), flush=True)
            print(f"{frequency} MHz, {apodization}", file=sys.stderr)


def print_speckle(seed=21, lines=60, per_mm2=30):
    """Lines far apart see unrelated scatterers: each line has scatterers of its own."""
    random = np.random.default_rng(seed)
    probe = Probe(3.5, 14.0, 50.0, "gaussian")
    samples = []
    for number in range(lines):
        count = int(per_mm2 * 12 * 16)
        x, z = random.uniform(-6, 6, count), random.uniform(42, 58, count)
        spectrum, _, t = probe.line(x, z, random.normal(size=count), 50)
        signal = np.fft.ifft(spectrum)
        depth = sums.SPEED_MM_US / 2 * (t - probe.start)
        samples.append(np.abs(signal[(depth > 46) & (depth < 54)]))
        if number % 10 == 9:
            # Depth changes the mean: each depth is divided by its own.
            part = np.array(samples) / np.mean(samples, axis=0)
            print(f"{number + 1} lines: speckle SNR {np.mean(samples) / np.std(samples):.3f}, "
                  f"depth by depth {1 / part.std():.3f}", flush=True)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("case", choices=("width", "speckle"))
    {"width": write_widths, "speckle": print_speckle}[p.parse_args().case]()


if __name__ == "__main__":
    main()
