//! Transmission of the scan plane: for each cell and depth interval, the amplitude that passes, and its delay. Both
//! come from the paths.

use glam::DVec2;
use rayon::prelude::*;

use super::aperture::{Aperture, CellRays};
use super::inputs::Inputs;
use super::segment::{Path, segment_at};
use crate::constants::{DELAY_MIN, HARD_SPEED, TRANSMISSION_MIN};

/// Transmission of the scan plane.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Transmission {
    /// Complex transmission of each cell: amplitude relative to the greatest of its row, and phase of its delay
    /// relative to the middle cell [planes × cells].
    pub mask: Vec<DVec2>,
    /// Smallest loss of any cell in each plane, one-way nepers `[planes]`.
    pub row_np: Vec<f64>,
}

/// The transmission of every cell.
pub fn transmission(inputs: &Inputs, aperture: &Aperture, paths: &[Path]) -> Transmission {
    let row = |plane: usize| -> (Vec<DVec2>, f64) {
        let ends_mm = [plane, plane + 1].map(|boundary| boundary as f64 * aperture.plane_mm);
        let cells: Vec<f64> =
            (0..aperture.cells).map(|cell| transmitted(inputs, aperture, paths, cell, ends_mm)).collect();
        let greatest = cells.iter().copied().fold(TRANSMISSION_MIN, f64::max);
        let late_mm = |cell: usize| delayed_mm(inputs, aperture, paths, cell, ends_mm);
        let middle_mm = late_mm(aperture.cells / 2);
        let value = |(cell, passes): (usize, &f64)| {
            let turns = aperture.turns_per_mm * (late_mm(cell) - middle_mm);
            passes / greatest * DVec2::from_angle(std::f64::consts::TAU * turns)
        };
        (cells.iter().enumerate().map(value).collect(), -greatest.ln())
    };
    let rows: Vec<_> = (0..aperture.planes).into_par_iter().map(row).collect();
    Transmission {
        mask: rows.iter().flat_map(|(cells, _)| cells.iter().copied()).collect(),
        row_np: rows.iter().map(|(_, loss_np)| *loss_np).collect(),
    }
}

/// One-way amplitude that a cell passes between two depths: averaged as amplitude over the rays, as two-way power over
/// the layers.
fn transmitted(inputs: &Inputs, aperture: &Aperture, paths: &[Path], cell: usize, [from, to]: [f64; 2]) -> f64 {
    let passed = |path: &Path, axial_path: &Path, _stretch: f64| {
        (-(loss_np(path, axial_path, to) - loss_np(path, axial_path, from)).max(0.0)).exp()
    };
    let of_layer = |layer: usize| mean_over_rays(inputs, paths, &aperture.cell_rays[cell], layer, passed).powi(4);
    ((0..inputs.layers).map(of_layer).sum::<f64>() / inputs.layers as f64).powf(0.25)
}

/// Delay of a cell between two depths as mm at the assumed speed: mean over the rays and the layers.
fn delayed_mm(inputs: &Inputs, aperture: &Aperture, paths: &[Path], cell: usize, [from, to]: [f64; 2]) -> f64 {
    if !inputs.refraction {
        return 0.0;
    }
    let delayed = |path: &Path, axial_path: &Path, stretch: f64| {
        late_mm(path, axial_path, stretch, to) - late_mm(path, axial_path, stretch, from)
    };
    let of_layer = |layer: usize| mean_over_rays(inputs, paths, &aperture.cell_rays[cell], layer, delayed);
    (0..inputs.layers).map(of_layer).sum::<f64>() / inputs.layers as f64
}

/// Weighted mean over the rays of a cell of `value`, a function of path, axial path and stretch.
fn mean_over_rays(
    inputs: &Inputs,
    paths: &[Path],
    &CellRays { first, step, count, weights }: &CellRays,
    layer: usize,
    value: impl Fn(&Path, &Path, f64) -> f64,
) -> f64 {
    let weight_of = |ray: usize| {
        let of_first = if ray == 0 { weights[0] } else { 1.0 };
        of_first * if ray + 1 == count { weights[1] } else { 1.0 }
    };
    let weighted = |ray: usize| {
        let line_ray = first + ray * step;
        let path = layer * inputs.rays.len() + line_ray;
        let axial_path = &paths[inputs.axial_path_of(line_ray / inputs.rays_per_line)];
        weight_of(ray) * value(&paths[path], axial_path, inputs.elevation_of(path).stretch)
    };
    (0..count).map(weighted).sum::<f64>() / (0..count).map(weight_of).sum::<f64>()
}

/// Range minus depth of a path at `range_mm`, mm. After the first reflection, it rises as on the axial path.
fn late_mm(path: &Path, axial_path: &Path, stretch: f64, range_mm: f64) -> f64 {
    let reflection = path.segments.iter().find(|segment| segment.has_reflected);
    match reflection.filter(|segment| segment.start_mm <= range_mm) {
        None => late_between(path, stretch, 0.0, range_mm),
        Some(segment) => {
            late_between(path, stretch, 0.0, segment.start_mm)
                + late_between(axial_path, 1.0, segment.start_mm, range_mm)
        }
    }
}

/// Growth of the difference between range and depth, mm, along a path from one range to another. Stretches in hard
/// media add nothing.
fn late_between(path: &Path, stretch: f64, from: f64, to: f64) -> f64 {
    let gained = |at: usize| {
        let segment = &path.segments[at];
        let end = path.segments.get(at + 1).map_or(to, |next| next.start_mm.min(to));
        let rate = 1.0 - segment.step.length() / stretch;
        if (DELAY_MIN..=HARD_SPEED).contains(&rate.abs()) {
            rate * (end - segment.start_mm.max(from)).max(0.0)
        } else {
            0.0
        }
    };
    (0..path.segments.len()).map(gained).sum()
}

/// Loss of a path from the face to a range, one-way nepers. After the first reflection, it rises as on the axial path.
/// The coupling loss of the face counts in the first depth interval.
fn loss_np(path: &Path, axial_path: &Path, range_mm: f64) -> f64 {
    if range_mm == 0.0 {
        return 0.0;
    }
    let reflection = path.segments.iter().find(|segment| segment.has_reflected);
    match reflection.filter(|segment| segment.start_mm <= range_mm) {
        None => passed_np(path, range_mm),
        Some(segment) => {
            let beyond = passed_np(axial_path, range_mm) - passed_np(axial_path, segment.start_mm);
            -0.5 * segment.ln_passed_at_zero + beyond
        }
    }
}

/// Loss from the face to a range of a path that has not reflected, one-way nepers.
pub(super) fn passed_np(path: &Path, range_mm: f64) -> f64 {
    -0.5 * path.segments[segment_at(path, range_mm)].ln_passed(range_mm)
}
