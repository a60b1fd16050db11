//! Tables of the aperture: waves along the face, their propagation, and the beams that they make up.
//!
//! All transmit and receive beams of a frame are sums of a few waves e^(iqx) on the face, the modes. The pass
//! `propagate` sends each mode through the losses in the scan plane, the pass `beams` sums modes into beams. The method
//! is an angular spectrum on a coarse grid; docs/notes/aperture.md derives it and compares it with diffraction sums.
//!
//! x is the position along the face, mm; along a curved face, the arc length. A mode's lateral wave number at depth z
//! is q/ρ. On a curved face, ρ = 1 + z/radius; on a flat one, ρ = 1.
//!
//! The beams of a phased array all leave one aperture, and differ by a turn about its middle. Waves begin at an arc about
//! the middle, a little beyond the aperture's ends, with the field that the aperture has there; ρ = z/radius. Nearer,
//! losses count along straight rays. The aperture turns with the beam: it isn't narrower for steered beams.

mod beams;
mod geometry;
mod grid;
mod sampling;
#[cfg(feature = "gpu")]
mod shape;
mod unobstructed;

use grid::Grid;
pub(crate) use grid::{BEAMS_MAX, MODE_LANES, MODES_MAX, OFFSETS_MAX, PLANES_MAX};
use insonify_core::settings::Quality;
use insonify_core::transducer::Probe;
pub(crate) use sampling::{CellRays, Sampling};
#[cfg(feature = "gpu")]
pub(crate) use shape::{ApertureShape, MODE_NONE};
use unobstructed::unobstructed;

use crate::constants::DEPTH_BLOCK;

/// Complex number, real part first.
pub(crate) type Complex = [f32; 2];

/// Tables of the aperture for one probe and one quality.
#[derive(Debug, Clone)]
pub(crate) struct ApertureTables {
    pub(crate) sampling: Sampling,
    /// Number of depth planes, one in the middle of each interval of `plane_samples` samples.
    pub(crate) planes: usize,
    pub(crate) plane_samples: u32,
    pub(crate) plane_mm: f32,
    /// Mode number in each slot. Even modes come first if odd modes end at a depth. `None` pads to whole groups of
    /// [`MODE_LANES`].
    pub(crate) modes: Vec<Option<i32>>,
    /// Factor by which each spatial frequency propagates from one plane to the next, divided by the number of cells
    /// [planes × cells].
    pub(crate) steps: Vec<Complex>,
    /// Weight of each mode in the transmit beam whose axis is at x = 0 `[modes]`.
    pub(crate) transmit: Vec<Complex>,
    /// Weight of each mode in the receive beam at x = 0 that is focused at each plane [planes × modes].
    pub(crate) receive: Vec<Complex>,
    /// Sensitivity of the face: 1 within the array, 0 beyond it `[cells]`.
    pub(crate) face: Vec<f32>,
    /// Distance from a beam's axis within which its echo power is summed, in cells `[planes]`.
    pub(crate) reach_cells: Vec<f32>,
    /// Greatest echo power of any beam without obstacles `[planes]`.
    pub(crate) greatest: Vec<f32>,
    /// Echo power of each beam without obstacles, relative to `greatest` [planes × cells]. Each row begins with one
    /// value per beam axis (node); the rest is 0.
    pub(crate) shares: Vec<f32>,
    /// Two-way amplitude of an unobstructed beam at offsets from its axis, one cell apart [planes × offsets].
    pub(crate) profiles: Vec<f32>,
    /// Wave number, radians per mm.
    pub(crate) wave_number: f32,
    /// Rays that cross each cell `[cells]`.
    pub(crate) cell_rays: Vec<CellRays>,
    /// Position of each scanline along the face, in cells `[scanlines]`.
    pub(crate) line_cells: Vec<f32>,
    /// Distance between neighbouring scanlines, in cells.
    pub(crate) line_spacing_cells: f32,
}

impl ApertureTables {
    /// Whether a probe has tables. Very wide faces and very narrow phased arrays have none.
    pub(crate) fn possible(probe: &Probe) -> bool {
        Grid::new(probe).is_some()
    }

    /// Tables of a probe; `None` unless they are [`possible`](Self::possible).
    pub(crate) fn new(probe: &Probe, quality: Quality) -> Option<Self> {
        let grid = Grid::new(probe)?;
        let beams = beams::Beams::new(probe, &grid);
        let steps = grid.steps();
        let face = grid.face();
        let unobstructed = unobstructed(&grid, &beams, &steps, &face);
        let narrow = |values: &[f64]| -> Vec<f32> { values.iter().map(|&v| v as f32).collect() };
        let single = |values: &[rustfft::num_complex::Complex64]| -> Vec<Complex> {
            values.iter().map(|v| [v.re as f32, v.im as f32]).collect()
        };
        let scale = 1.0 / grid.sampling.cells as f64;
        Some(Self {
            sampling: grid.sampling,
            planes: grid.planes,
            plane_samples: grid.plane_samples,
            plane_mm: grid.plane_mm as f32,
            steps: steps.iter().map(|h| [(h.re * scale) as f32, (h.im * scale) as f32]).collect(),
            transmit: single(&beams.transmit),
            receive: single(&beams.receive),
            face: narrow(&face),
            reach_cells: (0..grid.planes).map(|plane| grid.reach_cells(plane) as f32).collect(),
            greatest: narrow(&unobstructed.greatest),
            shares: narrow(&unobstructed.shares),
            profiles: narrow(&unobstructed.profiles),
            wave_number: grid.wave_number as f32,
            cell_rays: grid.cell_rays(probe, quality.rays),
            line_cells: (0..probe.scanlines).map(|line| grid.line_cell(probe, line) as f32).collect(),
            line_spacing_cells: (grid.width_mm / f64::from(probe.scanlines) / grid.cell_mm) as f32,
            modes: grid.modes,
        })
    }

    /// Copy of these tables for another number of rays per scanline.
    pub(crate) fn with_rays(&self, probe: &Probe, rays: u32) -> Self {
        let cell_rays = Grid::new(probe).map_or_else(Vec::new, |grid| grid.cell_rays(probe, rays));
        Self { cell_rays, ..self.clone() }
    }

    /// Phase per mm of delay, turns.
    pub(crate) fn turns_per_mm(&self) -> f32 {
        self.wave_number * (1.0 / std::f32::consts::TAU)
    }

    /// Index of the block of samples in the middle of a plane's interval; the last block for a plane beyond the
    /// samples.
    pub(crate) fn block_of(&self, plane: usize, samples: u32) -> usize {
        let sample = (2 * plane as u32 + 1) * self.plane_samples / 2;
        (sample.min(samples - 1) / DEPTH_BLOCK) as usize
    }

    /// Number of scanlines to either side of a scanline that its beam may reach.
    pub(crate) fn reach_lines(&self) -> u32 {
        let furthest = self.reach_cells.iter().copied().fold(0.0, f32::max);
        (furthest / self.line_spacing_cells.max(1.0e-6)).ceil() as u32
    }
}

#[cfg(test)]
mod tests {
    use insonify_core::settings::ProbeKind;

    use super::*;

    fn tables(probe: &Probe) -> ApertureTables {
        ApertureTables::new(probe, Quality { rays: 1, layers: 1, seed: 0 }).unwrap()
    }

    fn linear(width_mm: f64) -> Probe {
        Probe { kind: ProbeKind::Linear { width_mm }, ..Probe::default() }
    }

    #[test]
    fn grids_hold_the_face_and_are_fine_enough() {
        for probe in [Probe::default(), linear(40.0), linear(80.0), linear(12.0)] {
            let grid = Grid::new(&probe).unwrap();
            assert!(grid.sampling.cells.is_power_of_two() && grid.sampling.beams.is_power_of_two(), "{probe:?}");
            assert!(grid.sampling.cells as f64 * grid.cell_mm >= grid.width_mm + 6.0 - 1e-9, "{probe:?}");
            let finest = if probe.face_radius_mm().is_some() { 0.1351 } else { 0.2813 };
            assert!(grid.cell_mm <= finest, "{} mm", grid.cell_mm);
            assert!(grid.plane_mm <= 3.34 && grid.planes <= PLANES_MAX, "{} mm", grid.plane_mm);
            assert_eq!(grid.modes.len() % MODE_LANES, 0);
        }
        // No number of samples rounds to more than an eighth more planes.
        for samples in [1000, 1536, 2048, 2512, 3072, 5000] {
            let grid = Grid::new(&Probe { samples: samples.into(), ..Probe::default() }).unwrap();
            assert!((0.875 * 3.33 - 0.25..=3.34).contains(&grid.plane_mm), "{samples}: {} mm", grid.plane_mm);
        }
        let phased = Probe { kind: ProbeKind::Phased { fov_deg: 90.0 }, ..Probe::default() };
        assert!(Grid::new(&Probe { aperture_mm: 1.0, ..phased }).is_none());
        let grid = Grid::new(&phased).unwrap();
        // The beams at the ends of the sector don't meet each other's around the grid.
        assert!(grid.sampling.cells as f64 * grid.cell_mm >= 12.5 * (0.5 * std::f64::consts::PI + 1.9), "{grid:?}");
    }

    #[test]
    fn every_cell_has_rays_of_the_array() {
        for (probe, rays) in
            [(Probe::default(), 1), (Probe::default(), 32), (Probe { scanlines: 40, ..linear(40.0) }, 1)]
        {
            let tables = ApertureTables::new(&probe, Quality { rays, layers: 1, seed: 0 }).unwrap();
            let all = probe.scanlines * rays;
            let mut parts = vec![0.0; all as usize];
            for rays in &tables.cell_rays {
                let &CellRays { first, step, count, .. } = rays;
                assert!(count >= 1 && step >= 1 && first + (count - 1) * step < all);
                let [of_first, of_last] = rays.weights();
                assert!(of_first > 0.0 && of_first <= 1.0 && of_last > 0.0 && of_last <= 1.0);
                if count > 1 {
                    parts[first as usize] += of_first;
                    parts[(first + (count - 1) * step) as usize] += of_last;
                }
            }
            // Cells share the rays on their borders.
            assert!(rays > 1 || parts.iter().all(|part| *part < 1.01), "{parts:?}");
        }
    }

    #[test]
    fn beams_of_a_linear_array_are_alike_in_its_middle() {
        let tables = tables(&linear(60.0));
        let nodes = tables.sampling.nodes_at(10);
        let row = &tables.shares[10 * tables.sampling.cells..][..nodes];
        for share in &row[nodes / 2 - 8..nodes / 2 + 8] {
            assert!((share - 1.0).abs() < 0.01, "{share}");
        }
    }
}
