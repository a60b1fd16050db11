//! Transmission of the scan plane: for each cell and depth interval, the amplitude that passes, and its delay. Both
//! come from the paths.

use insonify_core::simd::{at_least, at_most, exp, phasor, widened};
use rayon::prelude::*;

use crate::aperture::{ApertureTables, CellRays, PLANES_MAX};
use crate::constants::{DELAY_MIN, HARD_SPEED};
use crate::host::constants::{ImageConstants, TRANSMISSION_MIN};
use crate::host::paths::Paths;
use crate::host::trace::interface::ln;
use crate::params::Params;
use crate::segment::Segment;

/// One number per boundary of a path's depth intervals.
pub(in crate::host) type Boundaries = [f32; PLANES_MAX + 1];

/// Means over the layers: fourth power of the amplitude that a cell passes, and its delay as mm at the assumed speed.
pub(in crate::host) type CellMeans = [f32; 2];

/// Outputs of the pass.
#[derive(Debug)]
pub(in crate::host) struct Transmission<'a> {
    /// Means, summed up over the batches [cells × planes].
    pub(in crate::host) means: &'a mut [CellMeans],
    /// Complex transmission of each cell: amplitude relative to the greatest of its row, and phase of its delay
    /// relative to the middle cell [planes × cells].
    pub(in crate::host) mask: &'a mut [[f32; 2]],
    /// Smallest loss of any cell in each plane, one-way nepers `[planes]`.
    pub(in crate::host) row_np: &'a mut [f32],
}

/// Inputs of the pass.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct Inputs<'a> {
    pub(in crate::host) constants: ImageConstants,
    pub(in crate::host) tables: &'a ApertureTables,
    pub(in crate::host) paths: Paths<'a>,
    /// Elevational offset, slope and stretch of each path of a scanline [layers × rays]; `None` without refraction.
    pub(in crate::host) elevations: Option<&'a [[f32; 4]]>,
}

/// Adds the paths of a batch to the means. After the last batch, computes from them the mask of each cell and the loss
/// of each row.
pub(in crate::host) fn transmission(params: &Params, inputs: Inputs<'_>, into: Transmission<'_>) {
    let Transmission { means, mask, row_np } = into;
    let tables = inputs.tables;
    let columns = means.par_chunks_exact_mut(tables.planes).zip(&tables.cell_rays);
    columns.for_each(|(column, rays)| add_column(params, inputs, *rays, column));
    if params.layer_first + params.layer_count < params.layers {
        return;
    }
    let cells = tables.sampling.cells;
    let turns_per_mm = tables.turns_per_mm();
    let rows = mask.par_chunks_exact_mut(cells).zip(row_np).enumerate();
    rows.for_each(|(plane, (row, row_np))| {
        let mut greatest = TRANSMISSION_MIN;
        for (value, column) in row.iter_mut().zip(means.chunks_exact(tables.planes)) {
            let [power, late_mm] = column[plane];
            *value = [power.sqrt().sqrt(), late_mm];
            greatest = at_least(greatest, value[0]);
        }
        let (scale, middle_mm) = (1.0 / greatest, row[cells / 2][1]);
        for value in row {
            let [passes, late_mm] = *value;
            let [cos, sin] = phasor(turns_per_mm * (late_mm - middle_mm));
            *value = [passes * scale * cos, passes * scale * sin];
        }
        *row_np = -ln(greatest);
    });
}

/// Adds the layers of a batch to the means of each interval of a cell. Amplitudes enter to the fourth power, since
/// two-way powers add over layers.
fn add_column(params: &Params, inputs: Inputs<'_>, rays: CellRays, column: &mut [CellMeans]) {
    let Inputs { constants, tables, paths, elevations } = inputs;
    if params.layer_first == 0 {
        column.fill([0.0; 2]);
    }
    let (CellRays { first, step, count, .. }, parts) = (rays, rays.weights());
    let (mut losses, mut delays) = ([0.0; PLANES_MAX + 1], [0.0; PLANES_MAX + 1]);
    for layer in 0..params.layer_count {
        let (mut sums, mut late) = ([0.0; PLANES_MAX + 1], [0.0; PLANES_MAX + 1]);
        let mut total = 0.0;
        for ray in 0..count {
            let of_first = if ray == 0 { parts[0] } else { 1.0 };
            let weight = of_first * if ray + 1 == count { parts[1] } else { 1.0 };
            let line_ray = first + ray * step;
            paths.losses(params, tables, layer, line_ray, &mut losses);
            add_transmissions(constants, weight, &losses, &mut sums);
            if let Some(elevations) = elevations {
                let across = (params.layer_first + layer) * params.rays + line_ray % params.rays;
                paths.delays(params, tables, layer, line_ray, elevations[across as usize][2], &mut delays);
                for (late, ends) in late.iter_mut().zip(delays.windows(2)) {
                    *late += weight * (ends[1] - ends[0]);
                }
            }
            total += weight;
        }
        for (means, (&sum, &late)) in column.iter_mut().zip(sums.iter().zip(&late)) {
            let mean = sum / total;
            means[0] += (mean * mean) * (mean * mean) / params.layers as f32;
            means[1] += late / (total * params.layers as f32);
        }
    }
}

/// Delay of a segment, mm per mm of range. 0 in hard media: the aperture's sound goes around them.
#[inline(always)]
fn delay_rate(segment: &Segment, stretch: f32) -> f32 {
    let [x, y, z] = segment.step;
    let rate = 1.0 - (x * x + y * y + z * z).sqrt() / stretch;
    let (none, hard) = (DELAY_MIN as f32, HARD_SPEED as f32);
    if (none..=hard).contains(&rate.abs()) { rate } else { 0.0 }
}

impl Paths<'_> {
    /// Range minus depth of a path at the boundaries of the intervals, mm. After the first reflection, it rises as on
    /// the scanline's axial path.
    fn delays(
        &self,
        params: &Params,
        tables: &ApertureTables,
        layer: u32,
        line_ray: u32,
        stretch: f32,
        delays: &mut Boundaries,
    ) {
        let (starts, segments) = self.of((layer * params.scanlines * params.rays + line_ray) as usize);
        let range_of = |boundary: usize| boundary as f32 * tables.plane_mm;
        // Delay at the start of the segment.
        let (mut at, mut late_mm) = (0, 0.0);
        let mut rate = delay_rate(&segments[0], stretch);
        for boundary in 0..=tables.planes {
            while starts[at + 1] <= range_of(boundary) && !segments[at].has_reflected() {
                late_mm += (starts[at + 1] - starts[at]) * rate;
                at += 1;
                rate = delay_rate(&segments[at], stretch);
            }
            if !segments[at].has_reflected() {
                delays[boundary] = late_mm + (range_of(boundary) - starts[at]) * rate;
                continue;
            }
            let reflected_mm = starts[at];
            let (starts, segments) = self.of(params.axial_path_of(line_ray / params.rays) as usize);
            let mut at = 0;
            while starts[at + 1] <= reflected_mm {
                at += 1;
            }
            let mut from_mm = reflected_mm;
            for (delay, boundary) in delays.iter_mut().zip(0..=tables.planes).skip(boundary) {
                while starts[at + 1] <= range_of(boundary) {
                    late_mm += (starts[at + 1] - from_mm) * delay_rate(&segments[at], 1.0);
                    from_mm = starts[at + 1];
                    at += 1;
                }
                *delay = late_mm + (range_of(boundary) - from_mm) * delay_rate(&segments[at], 1.0);
            }
            return;
        }
    }

    /// Losses of a path up to the boundaries of the intervals, one-way nepers. After the first reflection, they rise as
    /// on the scanline's axial path. The coupling loss of the face counts in the first interval.
    fn losses(&self, params: &Params, tables: &ApertureTables, layer: u32, line_ray: u32, losses: &mut Boundaries) {
        let (starts, segments) = self.of((layer * params.scanlines * params.rays + line_ray) as usize);
        let range_of = |boundary: usize| boundary as f32 * tables.plane_mm;
        let mut at = 0;
        for boundary in 0..=tables.planes {
            while starts[at + 1] <= range_of(boundary) && !segments[at].has_reflected() {
                at += 1;
            }
            if !segments[at].has_reflected() {
                losses[boundary] = if boundary == 0 { 0.0 } else { segments[at].loss_np(range_of(boundary)) };
                continue;
            }
            let (reflected_mm, reflected_np) = (starts[at], -0.5 * segments[at].ln_passed_at_zero);
            let (starts, segments) = self.of(params.axial_path_of(line_ray / params.rays) as usize);
            let mut at = 0;
            while starts[at + 1] <= reflected_mm {
                at += 1;
            }
            let before_np = segments[at].loss_np(reflected_mm);
            for (loss, boundary) in losses.iter_mut().zip(0..=tables.planes).skip(boundary) {
                while starts[at + 1] <= range_of(boundary) {
                    at += 1;
                }
                *loss = reflected_np + (segments[at].loss_np(range_of(boundary)) - before_np);
            }
            return;
        }
    }
}

widened! {
    /// Adds the amplitude that each interval of a path passes, times `weight`.
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
