//! Gain along each scanline: what the aperture sees of the scatterers at a depth, over a medium without loss.
//!
//! A scanline follows the planes by its own loss: behind an obstacle it takes the plane behind it, before it the plane
//! before it, wherever in an interval the obstacle lies.

use rayon::prelude::*;

use super::constants::{TRACKED_NP, VISIBLE_MAX_NP, VISIBLE_MIN};
use super::interface::ln;
use super::paths::Paths;
use super::transmission::loss_np;
use super::wide::{at_least, at_most};
use crate::render::aperture::ApertureTables;
use crate::render::params::Params;

/// Numbers of a scanline at a boundary of the intervals: place among the planes, loss of the guide (one-way nepers),
/// gain at the plane before (nepers of amplitude, two-way), loss that all scanlines share (one-way nepers).
pub(super) type Boundary = [f32; 4];

/// Fills `lines`, the numbers of each scanline at each boundary [scanlines × (planes + 1)], from the power of the beams.
pub(super) fn visibility(
    params: &Params,
    tables: &ApertureTables,
    paths: Paths<'_>,
    powers: &[f32],
    row_np: &[f32],
    lines: &mut [Boundary],
) {
    lines.par_chunks_exact_mut(tables.planes + 1).enumerate().for_each(|(line, row)| {
        let guide = paths.of(params.guide_of(line as u32) as usize);
        place(tables, guide, row_np, row);
        gains(tables, line, powers, row);
    });
}

/// Fills in everything but the gains.
fn place(tables: &ApertureTables, (starts, segments): (&[f32], &[[f32; 12]]), row_np: &[f32], row: &mut [Boundary]) {
    let plane_mm = tables.plane_mm;
    // Place within the interval of the last loss, 0..=1.
    let mut last = 0.5;
    let (mut at, mut shared_np) = (0, 0.0);
    row[0] = [-0.5, loss_np(&segments[0], 0.0), 0.0, 0.0];
    for (interval, &row_np) in row_np.iter().enumerate() {
        let (from, to) = (interval as f32 * plane_mm, (interval + 1) as f32 * plane_mm);
        let begins_np = row[interval][1];
        // Trapezoids of the pieces of the interval.
        let (mut low, mut area) = (from, 0.0);
        loop {
            while starts[at + 1] <= low {
                at += 1;
            }
            let high = at_most(starts[at + 1], to);
            let of = |range_mm: f32| loss_np(&segments[at], range_mm) - begins_np;
            area += 0.5 * (of(low) + of(high)) * (high - low);
            low = high;
            if low >= to {
                break;
            }
        }
        while starts[at + 1] <= to {
            at += 1;
        }
        let ends_np = loss_np(&segments[at], to);
        let own_np = at_least(ends_np - begins_np - row_np, 0.0);
        let followed = own_np / (own_np + TRACKED_NP);
        let mean_np = area / plane_mm - 0.5 * row_np;
        let centre = (1.0 - mean_np / at_least(own_np, 1.0e-6)).clamp(0.0, 1.0);
        last = (1.0 - followed) * last + followed * centre;
        shared_np += row_np;
        row[interval + 1] = [(interval + 1) as f32 - (1.0 - followed) * last, ends_np, 0.0, shared_np];
    }
}

/// Fills in the gains, interpolated between the beams.
fn gains(tables: &ApertureTables, line: usize, powers: &[f32], row: &mut [Boundary]) {
    for (plane, boundary) in row[1..].iter_mut().enumerate() {
        let nodes = tables.nodes_at(plane);
        let at = tables.line_cells[line] / tables.node_cells_at(plane) as f32;
        let node = at_most(at_least(at, 0.0), nodes as f32 - 1.001);
        let low = node as usize;
        let powers = &powers[plane * tables.cells..][..nodes];
        let gain = |node: usize| at_most(0.5 * ln(at_least(powers[node], VISIBLE_MIN)), VISIBLE_MAX_NP);
        let part = node - low as f32;
        boundary[2] = gain(low) * (1.0 - part) + gain(low + 1) * part;
    }
}
