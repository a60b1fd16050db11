#!/usr/bin/env python3
"""Full-wave reference values by k-Wave (pseudo-spectral, two dimensions): a shadow and a refracted point.

shadow: an absorbing strip in a medium of 1540 m/s. Fields of the transmit aperture (fixed focus) and of the receive
apertures (focused at the scatterers' depth) are pulsed runs with the strip and without. Power ratio, weights, apertures
and band are those of shadow.py. The strip has no impedance of its own: it damps pressure and velocity alike, with a
graded edge, by about 55 dB one way.

refraction: a point target below a tilted plane boundary of two media. The wave from the target is run once and recorded
along the face. By reciprocity that gives the pulse echo of every pair of elements, from which the image is beamformed
for 1540 m/s: transmit focus at the target's true depth, dynamic receive focus with an F-number of at least 2. The
brightest pixel is the shown place. ray_*: the place by Snell's law and time of flight, along the ray that leaves the face
at a right angle.

The accuracy of the refracted case needs both media's speeds right to 0.1 %. So it runs without k-Wave's correction of the
time step, whose error then is a change of frequency, the same in all media, and is taken out exactly.

usage: full_wave.py shadow|refraction [--cell 0.16] [--cfl 0.4] > FIXTURE.csv
Needs NumPy and k-wave-python. Progress goes to the standard error.
"""
import argparse
import importlib.util
import sys
import time
from types import ModuleType, SimpleNamespace
import numpy as np
from scipy.fft import next_fast_len
import shadow as sums

# k-Wave downloads compiled programs when its package is imported. Only its Python solver is used, so this is left out.
package = ModuleType("kwave")
package.__path__ = list(importlib.util.find_spec("kwave").submodule_search_locations)
package.__version__ = "0.6.2"
sys.modules["kwave"] = package
from kwave.kgrid import kWaveGrid
from kwave.solvers.kspace_solver import Simulation

PML = 20
APERTURE = 20.0
F_NUMBER_MIN = 2.0
BEHIND = (10, 20, 40)
THICKNESSES = (1.2, 0.6)


def run(cell, duration, speed, sources, signals, sensors, damping=None, cfl=0.3, corrected=True):
    """Pressure at the sensors over time [sensor, time], and the time step, us.

    `speed` (mm/us) and `damping` (per us) are grids [lateral cell, depth cell]. `sources` and `sensors` are pairs of such
    indices. `signals` gives the sources' signals at times. `corrected` uses k-Wave's correction of the time step, which
    is exact for one speed alone.
    """
    shape = speed.shape
    dt = cfl * cell / speed.max()
    # Sizes that transform fast; the excess lies at the far ends.
    ends = [(PML, next_fast_len(n + 2 * PML) - n - PML) for n in shape]
    grid = kWaveGrid([n + sum(end) for n, end in zip(shape, ends)], [1e-3 * cell] * 2)
    grid.setTime(int(duration / dt), 1e-6 * dt)
    source = SimpleNamespace(p_mask=np.zeros(grid.N, bool), p=None)
    source.p_mask[sources[0] + PML, sources[1] + PML] = True
    source.p = signals(dt * np.arange(grid.Nt))
    sensor = SimpleNamespace(mask=np.zeros(grid.N, bool), record=("p",))
    sensor.mask[sensors[0] + PML, sensors[1] + PML] = True
    medium = SimpleNamespace(sound_speed=1e3 * np.pad(speed, ends, mode="edge"), density=1000.0)
    simulation = Simulation(grid, medium, source, sensor, pml_size=(PML, PML), pml_alpha=(2.0, 2.0), quiet=True,
                            dtype=np.float32, use_kspace=corrected)
    simulation.setup()
    if damping is not None:
        # k-Wave multiplies by these factors twice in each step, velocity and density alike.
        factor = np.exp(-0.5 * dt * np.pad(damping, ends)).astype(np.float32)
        simulation.pml_list = [factor * pml for pml in simulation.pml_list]
        simulation.pml_sg_list = [factor * pml for pml in simulation.pml_sg_list]
    started = time.time()
    while simulation.t < grid.Nt:
        simulation.step()
        if simulation.t % 200 == 0:
            print(f"\r  step {simulation.t} of {grid.Nt}, {time.time() - started:.0f} s ", end="", file=sys.stderr)
    print(file=sys.stderr)
    return simulation.sensor_data["p"], dt


def pulse(t, frequency, bandwidth=0.6):
    """Pulse of a Gaussian spectrum, wide enough for all of the band. It begins at 0 and has its peak at 2 / frequency."""
    sigma = 1 / (2 * np.pi * frequency * bandwidth / 2.355) / 1.2
    t = t - 2 / frequency
    return np.exp(-0.5 * (t / sigma) ** 2) * np.cos(2 * np.pi * frequency * t)


def coverage(places, low, high, cell):
    """Part of each cell that lies between low and high."""
    return np.clip((np.minimum(places + cell / 2, high) - np.maximum(places - cell / 2, low)) / cell, 0, 1)


def write_shadow(a, frequency=2.5, strip_z=60.0, half_width=1.5, focus=90.0, c=1.54, side=17.0):
    cell = a.cell
    x = cell * np.arange(-round(side / cell), round(side / cell) + 1)
    source_row = round(1 / cell)
    z = cell * (np.arange(round((strip_z + max(BEHIND) + 1) / cell) + source_row) - source_row)
    def screen(thickness):
        """Damping of the strip: cos^2 over its thickness, e^-6.3 one way."""
        profile = np.where(np.abs(z - strip_z) < thickness / 2, np.cos(np.pi * (z - strip_z) / thickness) ** 2, 0)
        return coverage(x, -half_width, half_width, cell)[:, None] * profile[None] * 6.3 * c / (profile.sum() * cell)

    elements = np.flatnonzero(np.abs(x) <= APERTURE / 2)
    lines = np.flatnonzero(np.abs(x) <= 12)
    parts = np.linspace(0.7, 1.3, 9)
    print("# Speckle power behind an absorbing strip over that without it, by k-Wave (full_wave.py shadow).")
    print(f"# Cells of {cell:g} mm. thickness_mm: of the strip, whose middle lies at depth_mm.")
    print("# level_db: frequencies weighed as in shadow.py, whose sums carry about f^5.")
    print("# flat_db: unobstructed echo power Gaussian in frequency. shadow_py_*: the same by shadow.py (no thickness).")
    print("thickness_mm,depth_mm,half_width_mm,offset_mm,frequency_mhz,aperture_mm,focus_mm,behind_mm,"
          "level_db,shadow_py_db,flat_db,shadow_py_flat_db")

    def fields(aperture, focused, rows, damping):
        """Field of the band's frequencies at lateral places of each row: [row][frequency, place]."""
        depth = z[rows].max()
        last = np.searchsorted(z, depth + 1)
        used = elements[np.abs(x[elements]) <= aperture / 2 + 1e-9]
        weights = np.exp(-0.5 * (x[used] / (0.3 * aperture)) ** 2)
        delays = np.hypot(aperture / 2, focused) / c - np.hypot(x[used], focused) / c
        sensors = np.meshgrid(lines, rows, indexing="ij")
        duration = (depth + 6) / c + delays.max() + 4 / frequency
        p, dt = run(cell, duration, np.full((len(x), last), c), (used, source_row),
                    lambda t: weights[:, None] * pulse(t[None] - delays[:, None], frequency), sensors,
                    damping[:, :last] if damping is not None else None, a.cfl)
        # Sensors lie in the grid's order: all rows of one lateral place, then the next place.
        p = p.reshape(len(lines), len(rows), -1)
        t = dt * np.arange(p.shape[2])
        kernel = np.exp(-2j * np.pi * frequency * parts[:, None] * t[None])
        kernel /= (kernel @ pulse(t, frequency))[:, None]
        return [kernel @ p[:, row].T for row in range(len(rows))]

    rows = [int(np.argmin(np.abs(z - strip_z - b))) for b in BEHIND]
    weight = np.exp(-0.5 * ((parts - 1) / (0.6 / 2.355)) ** 2)
    without = {}
    for thickness in (None, *THICKNESSES):
        print(f"strip of {thickness} mm: transmit, then receive at {BEHIND} mm behind", file=sys.stderr)
        damping = screen(thickness) if thickness else None
        transmit = fields(APERTURE, focus, rows, damping)
        for row, t, b in zip(rows, transmit, BEHIND):
            receive = fields(min(APERTURE, z[row] / F_NUMBER_MIN), strip_z + b, [row], damping)[0]
            power = (np.abs(t * receive) ** 2).sum(1)
            if thickness is None:
                without[b] = power
                continue
            ours, theirs = power / without[b], shadow_parts(b, strip_z, half_width, frequency, focus, parts)
            levels = [10 * np.log10((w * p).sum() / w.sum()) for w in (weight * theirs[1], weight)
                      for p in (ours, theirs[0] / theirs[1])]
            case = (thickness, strip_z, half_width, 0, frequency, APERTURE, focus, b)
            print(",".join(f"{v:g}" for v in case) + "".join(f",{v:.2f}" for v in levels), flush=True)


def shadow_parts(behind, strip_z, half_width, frequency, focus, parts):
    """Powers with the strip and without it at each frequency of the band, by shadow.py."""
    z, points, powers = strip_z + behind, np.linspace(-12, 12, 97), []
    for wavelength in sums.SPEED_MM_US / (frequency * parts):
        xs = np.arange(-30, 30, wavelength / 5)
        opaque = np.abs(xs) <= half_width
        ways = [sums.fields(2 * np.pi / wavelength, wavelength, aperture, focused, strip_z, xs, opaque, points, z)
                for aperture, focused in ((APERTURE, focus), (min(APERTURE, z / F_NUMBER_MIN), z))]
        powers.append([(np.abs(t * r) ** 2).sum() for t, r in zip(*ways)])
    return np.array(powers).T


def snell(target, depth, tilt, near, far):
    """Place at which the ray through the target is shown: lateral place and depth, mm."""
    slope, normal = np.tan(tilt), np.array([-np.sin(tilt), np.cos(tilt)])
    # Refraction of the direction (0, 1) at a boundary whose normal points down.
    ratio, cosine = far / near, np.cos(tilt)
    ray = ratio * np.array([0, 1.0]) + (np.sqrt(1 - ratio**2 * (1 - cosine**2)) - ratio * cosine) * normal
    # Scanline x: it meets the boundary at depth + x slope. The refracted ray runs through the target.
    x = (target[0] - (target[1] - depth) * ray[0] / ray[1]) / (1 - slope * ray[0] / ray[1])
    meets = depth + x * slope
    flight = meets / near + (target[1] - meets) / ray[1] / far
    return x, 1.54 * flight


# Speeds near and far (mm/us), depth and tilt of the boundary, target. The last one shows the program's own error.
REFRACTIONS = ((1.45, 1.58, 25, 20, 0, 60), (1.45, 1.58, 25, 30, 0, 50), (1.60, 1.45, 25, 20, 0, 60),
               (1.45, 1.60, 15, 20, 3, 70), (1.54, 1.54, 25, 0, 0, 60))


def write_refraction(a, frequency=2.5, side=16.0):
    cell = a.cell
    print("# A point below a tilted boundary, shown by a scanner for 1540 m/s, by k-Wave (full_wave.py refraction).")
    print(f"# Cells of {cell:g} mm. The boundary lies at boundary_depth_mm on the axis. It is deeper by tan(tilt) a mm towards")
    print("# positive lateral places. ray_*: Snell's law and time of flight.")
    print("frequency_mhz,aperture_mm,speed_near_m_s,speed_far_m_s,boundary_depth_mm,tilt_deg,target_lateral_mm,"
          "target_depth_mm,shown_lateral_mm,shown_depth_mm,ray_lateral_mm,ray_depth_mm")
    x = cell * np.arange(-round(side / cell), round(side / cell) + 1)
    for near, far, depth, tilt, *target in REFRACTIONS:
        row = round(1 / cell)
        z = cell * (np.arange(round((target[1] + 3) / cell) + row) - row)
        tangent = np.tan(np.radians(tilt))
        # Cells on the boundary take a mean of the slownesses by the part of the cell on either side.
        distance = (z[None] - depth - x[:, None] * tangent) * np.cos(np.radians(tilt))
        below = np.clip(distance / cell + 0.5, 0, 1)
        speed = 1 / (below / far + (1 - below) / near)
        place = (int(np.argmin(np.abs(x - target[0]))), int(np.argmin(np.abs(z - target[1]))))
        target = (x[place[0]], z[place[1]])
        print(f"{near} over {far} mm/us, tilt {tilt}", file=sys.stderr)
        p, dt = run(cell, target[1] / min(near, far) + 12, speed, place, lambda t: pulse(t, frequency)[None],
                    (np.arange(len(x)), np.full(len(x), row)), None, a.cfl, False)
        shown = beamform(x, p, dt, frequency, target)
        ray = snell(target, depth, np.radians(tilt), near, far)
        values = (frequency, APERTURE, 1e3 * near, 1e3 * far, depth, tilt, *np.round(target, 4))
        print(",".join(f"{v:g}" for v in values) + ",%.3f,%.3f,%.3f,%.3f" % (*shown, *ray), flush=True)


def beamform(x, p, dt, frequency, target):
    """Brightest place of the target's image: lateral place and depth, mm."""
    # One-way spectra over the pulse's; the echo of a pair is the product of the two ways and the pulse.
    count = 2 * p.shape[1]
    f = np.fft.rfftfreq(count, dt)
    band = (f > 0.3 * frequency) & (f < 1.7 * frequency)
    t = dt * np.arange(p.shape[1])
    spectrum = np.fft.rfft(pulse(t, frequency), count)[band]
    # k-Wave's pressure is half a time step early (seen in a uniform medium at any step).
    ways = np.fft.rfft(p, count)[:, band] / spectrum * np.abs(spectrum) * np.exp(-1j * np.pi * f[band] * dt)
    # Without k-Wave's correction, waves of each frequency run exactly as those of a slightly lower one, in all media.
    omega = 2 / dt * np.sin(np.pi * f[band] * dt)

    def weights(lateral, aperture):
        """Of a mean: as the line moves, elements that enter or leave do not change the brightness."""
        taken = np.where(np.abs(lateral) <= aperture / 2, np.exp(-0.5 * (lateral / (0.3 * aperture)) ** 2), 0)
        return taken[:, None] / taken.sum()

    def image(laterals, depths):
        out = np.zeros((len(laterals), len(depths)))
        for i, line in enumerate(laterals):
            beside = x - line
            focus = target[1]
            law = (np.hypot(beside, focus) - focus) / 1.54
            send = (weights(beside, APERTURE) * np.exp(1j * omega * law[:, None]) * ways).sum(0)
            for j, depth in enumerate(depths):
                law = (depth + np.hypot(beside, depth)) / 1.54
                aperture = min(APERTURE, depth / F_NUMBER_MIN)
                heard = (weights(beside, aperture) * np.exp(1j * omega * law[:, None]) * ways).sum(0)
                out[i, j] = np.abs((send * heard).sum())
        return out

    place = np.array(target, float)
    for step in (0.4, 0.1, 0.02):
        offsets = step * np.arange(-8, 9)
        values = image(place[0] + offsets, place[1] + (2 if step == 0.4 else 1) * offsets)
        i, j = np.unravel_index(values.argmax(), values.shape)
        place = place + [offsets[i], (2 if step == 0.4 else 1) * offsets[j]]
    return place


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("case", choices=("shadow", "refraction"))
    p.add_argument("--cell", type=float, default=0.16, help="grid step, mm")
    p.add_argument("--cfl", type=float, default=0.4, help="Courant number")
    a = p.parse_args()
    {"shadow": write_shadow, "refraction": write_refraction}[a.case](a)


if __name__ == "__main__":
    main()
