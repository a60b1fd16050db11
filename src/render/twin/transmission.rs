//! Transmission of the scan plane: what each cell of each interval lets pass, from the loss along the paths.

use rayon::prelude::*;

use super::aperture::{Aperture, CellRays};
use super::inputs::Inputs;
use super::trace::{Path, segment_at};
use crate::render::constants::TRANSMISSION_MIN;

/// Transmission of the scan plane.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Transmission {
    /// Transmission of a cell over the greatest of its row [planes × cells].
    pub mask: Vec<f64>,
    /// Loss of that greatest one, one-way nepers `[planes]`.
    pub row_np: Vec<f64>,
}

/// The transmission of every cell.
pub fn transmission(inputs: &Inputs, aperture: &Aperture, paths: &[Path]) -> Transmission {
    let row = |plane: usize| -> (Vec<f64>, f64) {
        let ends_mm = [plane, plane + 1].map(|boundary| boundary as f64 * aperture.plane_mm);
        let cells: Vec<f64> =
            (0..aperture.cells).map(|cell| transmitted(inputs, aperture, paths, cell, ends_mm)).collect();
        let greatest = cells.iter().copied().fold(TRANSMISSION_MIN, f64::max);
        (cells.iter().map(|value| value / greatest).collect(), -greatest.ln())
    };
    let rows: Vec<_> = (0..aperture.planes).into_par_iter().map(row).collect();
    Transmission {
        mask: rows.iter().flat_map(|(cells, _)| cells.iter().copied()).collect(),
        row_np: rows.iter().map(|(_, loss_np)| *loss_np).collect(),
    }
}

/// Transmission of a cell between two depths: mean amplitude over the rays, mean power of both ways over the layers.
fn transmitted(inputs: &Inputs, aperture: &Aperture, paths: &[Path], cell: usize, [from, to]: [f64; 2]) -> f64 {
    let CellRays { first, step, count, weights } = aperture.cell_rays[cell];
    let weight_of = |ray: usize| {
        let of_first = if ray == 0 { weights[0] } else { 1.0 };
        of_first * if ray + 1 == count { weights[1] } else { 1.0 }
    };
    let total: f64 = (0..count).map(weight_of).sum();
    let of_layer = |layer: usize| -> f64 {
        let passed = |ray: usize| {
            let line_ray = first + ray * step;
            let path = &paths[layer * inputs.rays.len() + line_ray];
            let guide = &paths[inputs.guide_of(line_ray / inputs.rays_per_line)];
            weight_of(ray) * (-(loss_np(path, guide, to) - loss_np(path, guide, from)).max(0.0)).exp()
        };
        (0..count).map(passed).sum::<f64>() / total
    };
    ((0..inputs.layers).map(|layer| of_layer(layer).powi(4)).sum::<f64>() / inputs.layers as f64).powf(0.25)
}

/// Loss of a path from the face to a range, one-way nepers; from its first reflection on, it rises as that of the guide.
/// What the face does not couple is lost in the first interval.
fn loss_np(path: &Path, guide: &Path, range_mm: f64) -> f64 {
    if range_mm == 0.0 {
        return 0.0;
    }
    let reflection = path.segments.iter().find(|segment| segment.diverted);
    match reflection.filter(|segment| segment.start_mm <= range_mm) {
        None => passed_np(path, range_mm),
        Some(segment) => {
            let beyond = passed_np(guide, range_mm) - passed_np(guide, segment.start_mm);
            -0.5 * segment.ln_passed_at_zero + beyond
        }
    }
}

/// Loss of a path that has not reflected, one-way nepers.
pub(super) fn passed_np(path: &Path, range_mm: f64) -> f64 {
    -0.5 * path.segments[segment_at(path, range_mm)].ln_passed(range_mm)
}
