//! Transmission of the scan plane: what each cell of each interval lets pass, from the loss along the paths.

use rayon::prelude::*;

use super::constants::{ImageConstants, TRANSMISSION_MIN};
use super::interface::ln;
use super::paths::Paths;
use crate::render::aperture::{ApertureTables, CellRays, PLANES_MAX};
use crate::render::constants::DIVERTED;
use crate::render::params::Params;
use crate::simd::{at_least, at_most, exp, widened};

/// A number for each boundary of the intervals of a path.
pub(super) type Boundaries = [f32; PLANES_MAX + 1];

/// Outputs of the pass.
#[derive(Debug)]
pub(super) struct Transmission<'a> {
    /// Mean over the layers of the fourth power of a cell's transmission [cells × planes].
    pub(super) powers: &'a mut [f32],
    /// Transmission of a cell over the greatest of its row [planes × cells].
    pub(super) mask: &'a mut [f32],
    /// Loss of that greatest one, one-way nepers [planes].
    pub(super) row_np: &'a mut [f32],
}

/// Adds the paths of a batch; the last batch makes the mask.
pub(super) fn transmission(
    params: &Params,
    constants: ImageConstants,
    tables: &ApertureTables,
    paths: Paths<'_>,
    into: Transmission<'_>,
) {
    let Transmission { powers, mask, row_np } = into;
    let columns = powers.par_chunks_exact_mut(tables.planes).zip(&tables.cell_rays);
    columns.for_each(|(column, rays)| add_column(params, constants, tables, paths, *rays, column));
    if params.layer_first + params.layer_count < params.layers {
        return;
    }
    let rows = mask.par_chunks_exact_mut(tables.sampling.cells).zip(row_np).enumerate();
    rows.for_each(|(plane, (row, row_np))| {
        let mut greatest = TRANSMISSION_MIN;
        for (value, column) in row.iter_mut().zip(powers.chunks_exact(tables.planes)) {
            *value = column[plane].sqrt().sqrt();
            greatest = at_least(greatest, *value);
        }
        let scale = 1.0 / greatest;
        for value in row {
            *value *= scale;
        }
        *row_np = -ln(greatest);
    });
}

/// Adds a batch's part of the mean over the layers of a cell's transmission to the fourth power, for each interval: powers
/// of layers add, on both ways.
fn add_column(
    params: &Params,
    constants: ImageConstants,
    tables: &ApertureTables,
    paths: Paths<'_>,
    rays: CellRays,
    column: &mut [f32],
) {
    if params.layer_first == 0 {
        column.fill(0.0);
    }
    let (CellRays { first, step, count, .. }, parts) = (rays, rays.weights());
    let mut losses = [0.0; PLANES_MAX + 1];
    for layer in 0..params.layer_count {
        let mut sums = [0.0; PLANES_MAX + 1];
        let mut total = 0.0;
        for ray in 0..count {
            let of_first = if ray == 0 { parts[0] } else { 1.0 };
            let weight = of_first * if ray + 1 == count { parts[1] } else { 1.0 };
            paths.losses(params, tables, layer, first + ray * step, &mut losses);
            add_transmissions(constants, weight, &losses, &mut sums);
            total += weight;
        }
        for (power, &sum) in column.iter_mut().zip(&sums) {
            let mean = sum / total;
            *power += (mean * mean) * (mean * mean) / params.layers as f32;
        }
    }
}

impl Paths<'_> {
    /// Losses of a path at the boundaries of the intervals, one-way nepers; from its first reflection on, they rise as
    /// those of its scanline's guide. What the face does not couple is lost in the first interval.
    fn losses(&self, params: &Params, tables: &ApertureTables, layer: u32, line_ray: u32, losses: &mut Boundaries) {
        let (starts, segments) = self.of((layer * params.scanlines * params.rays + line_ray) as usize);
        let range_of = |boundary: usize| boundary as f32 * tables.plane_mm;
        let mut at = 0;
        for boundary in 0..=tables.planes {
            while starts[at + 1] <= range_of(boundary) && !diverted(&segments[at]) {
                at += 1;
            }
            if !diverted(&segments[at]) {
                losses[boundary] = if boundary == 0 { 0.0 } else { loss_np(&segments[at], range_of(boundary)) };
                continue;
            }
            let (reflected_mm, reflected_np) = (starts[at], -0.5 * segments[at][11]);
            let (starts, segments) = self.of(params.guide_of(line_ray / params.rays) as usize);
            let mut at = 0;
            while starts[at + 1] <= reflected_mm {
                at += 1;
            }
            let before_np = loss_np(&segments[at], reflected_mm);
            for (loss, boundary) in losses.iter_mut().zip(0..=tables.planes).skip(boundary) {
                while starts[at + 1] <= range_of(boundary) {
                    at += 1;
                }
                *loss = reflected_np + (loss_np(&segments[at], range_of(boundary)) - before_np);
            }
            return;
        }
    }
}

/// Whether a path came to a segment by a reflection.
#[inline(always)]
pub(super) fn diverted(segment: &[f32; 12]) -> bool {
    segment[10].to_bits() & DIVERTED != 0
}

/// Loss from the face to a range on a segment that no reflection came before, one-way nepers.
#[inline(always)]
pub(super) fn loss_np(segment: &[f32; 12], range_mm: f32) -> f32 {
    0.5 * (segment[7] * range_mm - segment[11])
}

widened! {
    /// Adds the transmission of each interval of a path.
    fn add_transmissions(
        constants: ImageConstants, weight: f32, losses: &Boundaries, sums: &mut Boundaries,
    ) = add_transmissions_body
}

#[inline(always)]
fn add_transmissions_body(constants: ImageConstants, weight: f32, losses: &Boundaries, sums: &mut Boundaries) {
    for i in 0..PLANES_MAX {
        sums[i] += weight * exp(-at_most(at_least(losses[i + 1] - losses[i], 0.0), constants.loss_max_np()));
    }
}
