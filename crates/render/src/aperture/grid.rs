//! Sizes of the aperture's grid: cells along the face, depth planes, modes (waves along the face).

use insonify_core::acoustics::beam::RECEIVE_F_NUMBER_MIN;
use insonify_core::acoustics::wavelength_mm;
use insonify_core::transducer::Probe;
use rustfft::num_complex::Complex64;

use super::geometry::Face;
use super::sampling::{CellRays, Sampling};
use crate::constants::CELLS_MAX;

/// Number of modes that are computed together.
pub(crate) const MODE_LANES: usize = 8;
/// Most beams in a period, the distance along the face after which the sums of all modes repeat.
pub(crate) const BEAMS_MAX: usize = 256;
/// Fewest cells in a period.
const CELLS_MIN: usize = 64;
/// Grids of 2ⁿ periods are tried, for each n below this number.
const PERIODS_LOG2_END: u32 = 8;
/// Longest beam profile: one value per cell, from the axis to half a period.
pub(crate) const OFFSETS_MAX: usize = BEAMS_MAX;
/// Most modes: one for each cell of a period, and the padding of two groups to [`MODE_LANES`].
pub(crate) const MODES_MAX: usize = BEAM_CELLS_MAX * BEAMS_MAX + 2 * MODE_LANES;
/// Most depth planes of a frame.
pub(crate) const PLANES_MAX: usize = 128;

/// Largest distance between depth planes, mm, unless the image is deeper than [`PLANES_MAX`] such distances.
const PLANE_MM: f64 = 3.33;
/// Largest cell along the face, mm: on flat faces, then on curved faces. Cells of a curved face widen with depth, and
/// rays leave the face at steep angles.
const CELL_MM: [f64; 2] = [0.28125, 0.135];
/// Largest distance between beams along the face, mm: on flat faces, then on curved faces.
const BEAM_MM: [f64; 2] = [0.5625, 0.45];
/// Largest cell and largest distance between beams of phased arrays, mm, on the arc where their waves begin. From there a
/// sector widens by ten times and more.
const PHASED_MM: (f64, f64) = (0.15, 0.3);
/// Radius of the arc from which the waves of a phased array are computed, relative to its aperture. The arc is about the
/// middle of the array, and encloses both ends of the aperture.
const PHASED_RADIUS: f64 = 0.625;
/// Angle, radians, by which the beams of a phased array reach beyond their axis at that arc.
const PHASED_REACH: f64 = 0.96;
/// Largest angle from the axis of a phased array's beam within which its echo power is summed, radians.
const PHASED_SPAN: f64 = 0.25;
/// Narrowest phased aperture, wavelengths: narrower ones send one wave everywhere.
const PHASED_WAVELENGTHS: f64 = 8.0;
/// Most cells from one beam's axis to the next.
const BEAM_CELLS_MAX: usize = 4;
/// Least width of the grid beyond either end of the array, mm.
const MARGIN_MM: f64 = 3.0;
/// Width over which the array's sensitivity falls at its ends, mm. A sharp end would scatter the beams' periodic
/// copies.
const FACE_EDGE_MM: f64 = 2.0;
/// Beams have modes up to the sine of the aperture's steepest ray plus this margin.
pub(super) const SLOPE_MARGIN: f64 = 0.06;
/// Bounds of the distance from a beam's axis within which its echo power is summed, mm at the scatterers.
const REACH_MM: [f64; 2] = [7.0, 13.0];
/// Ratio of this distance to the image's depth, before the bounds apply: refracted beams stray farther at larger
/// depths.
const REACH_PER_DEPTH: f64 = 0.11;
/// Spread of a curved face ([`Face::spread`]) beyond which odd modes are left out.
const HALVING_SPREAD: f64 = 2.0;
/// Most rays of a layer (elevational part of the beam) that are taken for one cell.
const CELL_RAYS_MAX: u32 = 32;
/// A ray counts in a cell only if at least this fraction of its part of the face lies there.
const CELL_PART_MIN: f64 = 1.0e-3;

/// Sizes of the grid, in the terms of [`ApertureTables`](super::ApertureTables).
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub(super) shape: Face,
    /// Wave number, radians per mm.
    pub(super) wave_number: f64,
    /// Width of the array along the face, mm.
    pub(super) width_mm: f64,
    /// Distance along the face after which the sums of all modes repeat, mm.
    pub(super) period_mm: f64,
    pub(super) sampling: Sampling,
    pub(super) cell_mm: f64,
    pub(super) planes: usize,
    pub(super) plane_samples: u32,
    pub(super) plane_mm: f64,
    /// Distance from a beam's axis within which its echo power is summed, mm at the scatterers.
    pub(super) reach_mm: f64,
    pub(super) modes: Vec<Option<i32>>,
}

impl Grid {
    /// Sizes for a probe; `None` for a face that is too wide or a phased array that is too narrow.
    pub(super) fn new(probe: &Probe) -> Option<Self> {
        let wavelength_mm = wavelength_mm(probe.frequency_mhz);
        let shape = match probe.face_radius_mm() {
            None => Face::of_radius(f64::INFINITY),
            Some(radius_mm) if radius_mm > 0.0 => Face::of_radius(radius_mm),
            Some(_) if probe.aperture_mm < PHASED_WAVELENGTHS * wavelength_mm => return None,
            Some(_) => Face::phased(PHASED_RADIUS * probe.aperture_mm),
        };
        let curved = shape.radius_mm.is_finite();
        let width_mm = 2.0 * probe.half_extent() * if curved { shape.radius_mm } else { 1.0 };
        let wave_number = std::f64::consts::TAU / wavelength_mm;

        // The period is the distance between a beam's copies. The copies must lie outside the aperture and the reach.
        let reach_mm = (REACH_PER_DEPTH * probe.depth_mm).clamp(REACH_MM[0], REACH_MM[1]);
        // A curved face spreads the copies with depth.
        let period_min_mm = match curved {
            true if shape.is_phased() => 0.7 * probe.aperture_mm,
            true => (0.7 * probe.aperture_mm).max(2.0 * REACH_MM[0]),
            false => (0.9 * probe.aperture_mm).max(2.0 * reach_mm),
        };
        let (cell_max_mm, beam_max_mm) = match shape.is_phased() {
            true => PHASED_MM,
            false => (CELL_MM[usize::from(curved)], BEAM_MM[usize::from(curved)]),
        };
        // Numbers of periods and cells are powers of two. The fewest cells win, then the shortest period.
        let margin_mm = if shape.is_phased() { PHASED_REACH * shape.radius_mm } else { MARGIN_MM };
        let domain_mm = width_mm + 2.0 * margin_mm;
        let sizes = (0..PERIODS_LOG2_END).map(|log2| {
            let periods = 1_usize << log2;
            let period_mm = period_min_mm.max(domain_mm / periods as f64);
            let cells = (period_mm / cell_max_mm - 1e-9).ceil() as usize;
            (periods, cells.next_power_of_two().max(CELLS_MIN), period_mm)
        });
        let (periods, period_cells, period_mm) =
            sizes.min_by(|a, b| (a.0 * a.1).cmp(&(b.0 * b.1)).then(a.2.total_cmp(&b.2)))?;
        let (cells, cell_mm) = (periods * period_cells, period_mm / period_cells as f64);
        let fits = |node_cells: &usize| cell_mm * *node_cells as f64 <= beam_max_mm;
        let node_cells = [BEAM_CELLS_MAX, 2].into_iter().find(fits).unwrap_or(2);
        let beams = period_cells / node_cells;
        if cells > CELLS_MAX as usize || period_cells / 2 > OFFSETS_MAX || beams > BEAMS_MAX {
            return None;
        }

        let (plane_samples, planes) = planes(probe);
        let plane_mm = f64::from(plane_samples) * probe.sample_spacing_mm();
        let depth_of = |plane: usize| (plane as f64 + 0.5) * plane_mm;
        let halves_at = match curved {
            false => planes,
            true => (0..planes).find(|&p| shape.spread(depth_of(p)) >= HALVING_SPREAD).unwrap_or(planes),
        };
        let far_mm = |p: usize| depth_of(p).max(shape.start_mm);
        let slopes = (0..planes).map(|p| shape.slope(0.5 * receive_mm(probe, depth_of(p)), far_mm(p)));
        let steepest = slopes.fold(shape.slope(0.5 * probe.aperture_mm, probe.focus_mm), f64::max) + SLOPE_MARGIN;
        let highest = (wave_number * period_mm * steepest / std::f64::consts::TAU) as usize;
        let highest = highest.min((beams * node_cells - 1) / 2) as i32;
        let (modes, lasting_modes) = ordered(highest, halves_at < planes);
        Some(Self {
            shape,
            wave_number,
            width_mm,
            period_mm,
            sampling: Sampling { cells, beams, node_cells, halves_at, modes: modes.len(), lasting_modes },
            cell_mm,
            planes,
            plane_samples,
            plane_mm,
            reach_mm,
            modes,
        })
    }

    /// Depth of a depth plane, mm.
    pub(super) fn depth_mm(&self, plane: usize) -> f64 {
        (plane as f64 + 0.5) * self.plane_mm
    }

    /// Wave number of a mode along the face, radians per mm.
    pub(super) fn mode_wave_number(&self, mode: i32) -> f64 {
        std::f64::consts::TAU * f64::from(mode) / self.period_mm
    }

    /// Distance from a beam's axis within which its echo power is summed at a plane, in cells: at most half a period.
    pub(super) fn reach_cells(&self, plane: usize) -> f64 {
        let half_period = (0.5 * self.sampling.beams as f64 - 1.0) * self.sampling.node_cells_at(plane) as f64;
        let narrow_mm = self.reach_mm / self.shape.spread(self.depth_mm(plane));
        let reach_mm =
            if self.shape.is_phased() { narrow_mm.min(PHASED_SPAN * self.shape.radius_mm) } else { narrow_mm };
        (reach_mm / self.cell_mm).min(half_period)
    }

    /// Depth of a depth plane, mm; at least that from which waves are computed.
    pub(super) fn wave_depth_mm(&self, plane: usize) -> f64 {
        self.depth_mm(plane).max(self.shape.start_mm)
    }

    /// Factor by which each spatial frequency propagates from the previous plane, or from the face, to each plane
    /// [planes × cells]; 0 for evanescent waves. Near a phased array, where waves are not computed, it is 1.
    pub(super) fn steps(&self) -> Vec<Complex64> {
        let mut steps = Vec::with_capacity(self.planes * self.sampling.cells);
        for plane in 0..self.planes {
            let to = self.wave_depth_mm(plane);
            let from = if plane == 0 { self.shape.start_mm } else { self.wave_depth_mm(plane - 1) };
            for cell in 0..self.sampling.cells {
                let cycles = if cell <= self.sampling.cells / 2 {
                    cell as f64
                } else {
                    cell as f64 - self.sampling.cells as f64
                };
                let q = std::f64::consts::TAU * cycles / (self.sampling.cells as f64 * self.cell_mm);
                steps.push(self.phase(q, from, to).map_or(Complex64::ZERO, |phase| Complex64::from_polar(1.0, phase)));
            }
        }
        steps
    }

    /// Phase ∫(√(k² − q²/ρ²) − k)dz between two depths, by four-point Gauss quadrature; `None` for an evanescent wave.
    fn phase(&self, q: f64, from_mm: f64, to_mm: f64) -> Option<f64> {
        const NODES: [(f64, f64); 2] =
            [(0.339_981_043_584_856_3, 0.652_145_154_862_546_1), (0.861_136_311_594_052_6, 0.347_854_845_137_453_9)];
        let (middle, half) = (0.5 * (from_mm + to_mm), 0.5 * (to_mm - from_mm));
        let mut sum = 0.0;
        for (node, weight) in NODES {
            for at in [middle - half * node, middle + half * node] {
                let across = q / self.shape.spread(at);
                let along2 = self.wave_number * self.wave_number - across * across;
                if along2 <= 0.0 {
                    return None;
                }
                // √(k² − q²) − k without cancellation.
                sum -= weight * across * across / (along2.sqrt() + self.wave_number);
            }
        }
        Some(half * sum)
    }

    /// Sensitivity of the face at each cell: 1 within the array, 0 beyond it, smooth at its ends. The cells of a phased
    /// array are angles, and its beams reach beyond the sector.
    pub(super) fn face(&self) -> Vec<f64> {
        if self.shape.is_phased() {
            return vec![1.0; self.sampling.cells];
        }
        let at = |cell: usize| {
            let across = (cell as f64 - 0.5 * self.sampling.cells as f64) * self.cell_mm;
            let inside = (0.5 * self.width_mm - across.abs()) / FACE_EDGE_MM + 0.5;
            (std::f64::consts::FRAC_PI_2 * inside.clamp(0.0, 1.0)).sin().powi(2)
        };
        (0..self.sampling.cells).map(at).collect()
    }

    /// Position of a scanline along the face, in cells.
    pub(super) fn line_cell(&self, probe: &Probe, line: u32) -> f64 {
        self.cell_of((f64::from(line) + 0.5) / f64::from(probe.scanlines))
    }

    /// Position along the face, in cells, at a fraction of the sector's width.
    fn cell_of(&self, fraction: f64) -> f64 {
        (fraction - 0.5) * self.width_mm / self.cell_mm + 0.5 * self.sampling.cells as f64
    }

    /// Rays of a layer that cross each cell: at most [`CELL_RAYS_MAX`] per cell, spread evenly.
    pub(super) fn cell_rays(&self, probe: &Probe, rays_per_line: u32) -> Vec<CellRays> {
        let all = f64::from(probe.scanlines * rays_per_line);
        // Ray i stands for the i-th of `all` equal parts of the face.
        let ray_of = |cell: f64| ((cell - 0.5 * self.sampling.cells as f64) * self.cell_mm / self.width_mm + 0.5) * all;
        let of_cell = |cell: usize| {
            let (from, to) = (ray_of(cell as f64 - 0.5).max(0.0), ray_of(cell as f64 + 0.5).min(all));
            if to - from < CELL_PART_MIN {
                return CellRays::single((0.5 * (from + to)).floor().clamp(0.0, all - 1.0) as u32);
            }
            // A ray that hardly overlaps the cell is left out.
            let (first, end) = ((from + CELL_PART_MIN).floor().min(all - 1.0), (to - CELL_PART_MIN).ceil());
            let crossing = (end - first).max(1.0) as u32;
            if crossing == 1 {
                return CellRays::single(first as u32);
            }
            if crossing <= CELL_RAYS_MAX {
                let parts = [(first + 1.0 - from).min(1.0), (to - (end - 1.0)).min(1.0)];
                return CellRays { first: first as u32, step: 1, count: crossing, parts: parts.map(CellRays::packed) };
            }
            let step = crossing.div_ceil(CELL_RAYS_MAX);
            let count = crossing.div_ceil(step);
            // Centred: the rays that the steps leave over are split between both ends.
            let first = first as u32 + (crossing - 1 - (count - 1) * step) / 2;
            CellRays { first, step, count, ..CellRays::single(0) }
        };
        (0..self.sampling.cells).map(of_cell).collect()
    }
}

/// Width of the receive aperture focused at a depth, mm.
pub(super) fn receive_mm(probe: &Probe, depth_mm: f64) -> f64 {
    probe.aperture_mm.min(depth_mm / RECEIVE_F_NUMBER_MIN)
}

/// Samples per depth interval, and the number of intervals. An interval's samples are rounded by an eighth at most, to
/// a multiple of up to 8, or to a power of two below 16.
fn planes(probe: &Probe) -> (u32, usize) {
    let apart_mm = PLANE_MM.max(probe.depth_mm / (PLANES_MAX as f64 - 1.0));
    let samples = ((apart_mm / probe.sample_spacing_mm()) as u32).max(1);
    let deep = probe.depth_mm / (PLANES_MAX as f64 - 1.0) > PLANE_MM;
    let step = 1 << samples.ilog2().saturating_sub(3).min(3);
    let rounded = match samples {
        // Rounded up if the number of planes is at its limit.
        16.. if deep => samples.next_multiple_of(step),
        16.. => samples / step * step,
        _ if deep => samples.next_power_of_two(),
        _ => 1 << samples.ilog2(),
    };
    (rounded, probe.sample_count().div_ceil(rounded) as usize)
}

/// Mode numbers from −`highest` to `highest`, padded to whole groups, and the number of modes that reach the last
/// plane. With `halving`, even modes come first, and only even modes reach it.
fn ordered(highest: i32, halving: bool) -> (Vec<Option<i32>>, usize) {
    let group = |stride: i32, first: i32| {
        let numbers = (-highest..=highest).filter(|m| (m - first).rem_euclid(stride) == 0).map(Some);
        let mut modes: Vec<_> = numbers.collect();
        modes.resize(modes.len().next_multiple_of(MODE_LANES), None);
        modes
    };
    if !halving {
        let modes = group(1, 0);
        let count = modes.len();
        return (modes, count);
    }
    let mut modes = group(2, 0);
    let lasting = modes.len();
    modes.extend(group(2, 1));
    (modes, lasting)
}
