//! Cells of the scatterer sheets.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use glam::DVec2;
use insonify_core::simd::pcg3d;
use insonify_core::transducer::Probe;

use super::constants::{CELL_MM, CELL_QUARTERS, SHEET_CELL_MAX_MM, SHEET_CELL_PER_SPACING};

/// Number of distances at which the chance of a shared scatterer is estimated, and the largest distance in sides of a
/// cell.
const STEPS: u32 = 24;
const DISTANCE_MAX: f64 = 1.2;
/// Random cells drawn at each distance.
const DRAWS: u32 = 20_000;

/// Square cells into which the scatterer sheets are divided.
///
/// A scanline meets the scatterers of the cells that it crosses. If cells were narrower than the spacing of scanlines,
/// the scanlines of another steering angle would cross other cells. Speckle of two angles would then be less correlated
/// than in reality. So on probes that steer, cells are as wide as the spacing.
///
/// To keep speckle grains short along the scanline, a wide cell has several scatterers, each in its own quarter. A
/// sample takes the scatterer whose range is nearest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SheetCells {
    /// Side, mm.
    pub(crate) side_mm: f64,
    /// Scatterers of a cell, 1 to [`CELL_QUARTERS`].
    pub(crate) scatterers: u32,
}

impl SheetCells {
    pub(crate) fn new(probe: &Probe) -> Self {
        let spacing_mm = probe.line_spacing_mm(probe.focus_mm.min(probe.depth_mm));
        let wanted_mm = if probe.kind.steers() { SHEET_CELL_PER_SPACING * spacing_mm } else { CELL_MM };
        let side_mm = wanted_mm.clamp(CELL_MM, SHEET_CELL_MAX_MM);
        Self { side_mm, scatterers: ((side_mm / CELL_MM).round() as u32).clamp(1, CELL_QUARTERS) }
    }

    /// Probability that two points of a sheet lie in one cell, from their distance along both axes of the cells, mm.
    pub(crate) fn chance_of_same(self, distance_mm: [f64; 2]) -> f64 {
        distance_mm.map(|mm| (1.0 - mm.abs() / self.side_mm).max(0.0)).iter().product()
    }

    /// Probability that two points of one cell take the same scatterer, from their distance in the sheet along the
    /// direction of the range, mm.
    pub(crate) fn chance_of_same_nearest(self, distance_mm: f64) -> f64 {
        static CHANCES: [LazyLock<Vec<f64>>; 3] =
            [LazyLock::new(|| drawn(2)), LazyLock::new(|| drawn(3)), LazyLock::new(|| drawn(4))];
        let Some(chances) = CHANCES.get((self.scatterers as usize).wrapping_sub(2)) else { return 1.0 };
        let place = distance_mm.abs() / self.side_mm * f64::from(STEPS) / DISTANCE_MAX;
        let of = |step: usize| chances.get(step).copied().unwrap_or(0.0);
        of(place as usize) * (1.0 - place.fract()) + of(place as usize + 1) * place.fract()
    }
}

/// Table of [`SheetCells::chance_of_same_nearest`] at each distance, for cells of `scatterers` scatterers.
fn drawn(scatterers: u32) -> Vec<f64> {
    (0..=STEPS).map(|step| drawn_at(scatterers, DISTANCE_MAX * f64::from(step) / f64::from(STEPS))).collect()
}

/// Estimates [`SheetCells::chance_of_same_nearest`] at a distance in cell sides, from random cells and directions.
fn drawn_at(scatterers: u32, distance: f64) -> f64 {
    let [mut both, mut same] = [0u32; 2];
    for draw in 0..DRAWS {
        let random = |number: u32| pcg3d([draw, number, 0]).map(|bits| f64::from(bits) / 2f64.powi(32));
        let [x, y, turn] = random(0);
        let way = DVec2::from_angle(TAU * turn);
        let points = [DVec2::new(x, y), DVec2::new(x, y) + distance * way];
        if points[1].min_element() < 0.0 || points[1].max_element() > 1.0 {
            continue;
        }
        let scatterer = |quarter: u32| {
            let [x, y, _] = random(1 + quarter);
            let corner = [(quarter ^ quarter >> 1) & 1, quarter & 1].map(f64::from);
            0.5 * DVec2::new(corner[0] + x, corner[1] + y)
        };
        let off = |point: DVec2, quarter: u32| (scatterer(quarter) - point).dot(way).abs();
        let nearest = |point: DVec2| (0..scatterers).min_by(|&a, &b| off(point, a).total_cmp(&off(point, b)));
        both += 1;
        same += u32::from(nearest(points[0]) == nearest(points[1]));
    }
    if both > 0 { f64::from(same) / f64::from(both) } else { 0.0 }
}
