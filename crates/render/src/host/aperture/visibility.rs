//! The aperture's gain along each scanline: amplitude received from scatterers at a depth, relative to a medium without
//! loss.
//!
//! A scanline's position is the fractional index of the depth plane whose gain applies. It follows the scanline's own
//! loss. The position is the preceding plane ahead of an obstacle, and the following plane behind it, wherever the
//! obstacle lies in its interval.

use insonify_core::simd::{at_least, at_most, exp, widened};
use rayon::prelude::*;

use super::gain::ApertureGain;
use crate::aperture::ApertureTables;
use crate::boundary::Boundary;
use crate::constants::DEPTH_BLOCK;
use crate::host::constants::{ImageConstants, TRACKED_NP, VISIBLE_MIN, VISIBLE_MIN_NP};
use crate::host::paths::{Paths, range_mm};
use crate::host::trace::interface::ln;
use crate::params::Params;
use crate::segment::Segment;

/// Two-way amplitude gain of a block of samples, without the loss that all scanlines share, and the block's position.
pub(in crate::host) type BlockGain = [f32; 2];

/// Gains along the scanlines, by boundary and by block.
#[derive(Debug)]
pub(in crate::host) struct Gains<'a> {
    /// Gain and losses at the boundaries of the depth intervals [scanlines × (planes + 1)].
    pub(in crate::host) lines: &'a mut [Boundary],
    /// Gain and position of each block of samples [scanlines × blocks].
    pub(in crate::host) blocks: &'a mut [BlockGain],
}

/// Inputs of the pass.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct Inputs<'a> {
    pub(in crate::host) constants: ImageConstants,
    pub(in crate::host) tables: &'a ApertureTables,
    pub(in crate::host) paths: Paths<'a>,
    /// Echo power of the beams [planes × cells].
    pub(in crate::host) powers: &'a [f32],
    /// Loss that the scanlines share in each depth interval, one-way nepers.
    pub(in crate::host) row_np: &'a [f32],
}

/// Fills in the gains along each scanline.
pub(in crate::host) fn visibility(params: &Params, inputs: Inputs<'_>, into: Gains<'_>) {
    let boundaries = into.lines.par_chunks_exact_mut(inputs.tables.planes + 1);
    let blocks = into.blocks.par_chunks_exact_mut((params.row_samples / DEPTH_BLOCK) as usize);
    boundaries.zip(blocks).enumerate().for_each(|(line, (row, blocks))| see_line(params, inputs, line, row, blocks));
}

widened! {
    /// Fills in the gains along one scanline.
    fn see_line(
        params: &Params, inputs: Inputs<'_>, line: usize, row: &mut [Boundary], blocks: &mut [BlockGain],
    ) = see_line_body
}

#[inline(always)]
fn see_line_body(params: &Params, inputs: Inputs<'_>, line: usize, row: &mut [Boundary], blocks: &mut [BlockGain]) {
    let Inputs { constants, tables, paths, powers, row_np } = inputs;
    let axial_path = paths.of(params.axial_path_of(line as u32) as usize);
    positions(tables, axial_path, row_np, row);
    gains(constants, tables, line, powers, row);
    // At the first sample of each block: a surface within the block counts as not yet crossed.
    let along = ApertureGain::new(tables, row);
    let (starts, segments) = axial_path;
    let mut at = 0;
    for (block, gain) in (0_u32..).zip(&mut *blocks) {
        let range_mm = range_mm(params, block.wrapping_mul(DEPTH_BLOCK));
        while starts[at + 1] <= range_mm {
            at += 1;
        }
        *gain = along.without_shared(range_mm, segments[at].loss_np(range_mm));
    }
    for [gain, _] in blocks {
        *gain = exp(*gain);
    }
}

/// Fills in the positions and losses of `row`, a scanline's boundaries.
#[inline(always)]
fn positions(tables: &ApertureTables, (starts, segments): (&[f32], &[Segment]), row_np: &[f32], row: &mut [Boundary]) {
    let plane_mm = tables.plane_mm;
    // Position of the last loss within its interval, 0..=1.
    let mut last = 0.5;
    let (mut at, mut shared_np) = (0, 0.0);
    let uncoupled_np = segments[0].loss_np(0.0);
    let ln_gain = at_least(-2.0 * uncoupled_np, VISIBLE_MIN_NP);
    row[0] = Boundary { position: -0.5, loss_np: uncoupled_np, ln_gain, shared_np: 0.0 };
    for (interval, &row_np) in row_np.iter().enumerate() {
        let (from, to) = (interval as f32 * plane_mm, (interval + 1) as f32 * plane_mm);
        let begins_np = row[interval].loss_np;
        // Integral over the interval of the loss since its start, by trapezoids over the path's segments.
        let (mut low, mut area) = (from, 0.0);
        loop {
            while starts[at + 1] <= low {
                at += 1;
            }
            let high = at_most(starts[at + 1], to);
            let of = |range_mm: f32| segments[at].loss_np(range_mm) - begins_np;
            area += 0.5 * (of(low) + of(high)) * (high - low);
            low = high;
            if low >= to {
                break;
            }
        }
        while starts[at + 1] <= to {
            at += 1;
        }
        let ends_np = segments[at].loss_np(to);
        let own_np = at_least(ends_np - begins_np - row_np, 0.0);
        let followed = own_np / (own_np + TRACKED_NP);
        let mean_np = area / plane_mm - 0.5 * row_np;
        let centre = (1.0 - mean_np / at_least(own_np, 1.0e-6)).clamp(0.0, 1.0);
        last = (1.0 - followed) * last + followed * centre;
        shared_np += row_np;
        let position = (interval + 1) as f32 - (1.0 - followed) * last;
        row[interval + 1] = Boundary { position, loss_np: ends_np, ln_gain: 0.0, shared_np };
    }
}

/// Fills in the gains of `row`, a scanline's boundaries, interpolated between the beams.
#[inline(always)]
fn gains(constants: ImageConstants, tables: &ApertureTables, line: usize, powers: &[f32], row: &mut [Boundary]) {
    for (plane, boundary) in row[1..].iter_mut().enumerate() {
        let nodes = tables.sampling.nodes_at(plane);
        let at = tables.line_cells[line] / tables.sampling.node_cells_at(plane) as f32;
        let node = at_most(at_least(at, 0.0), nodes as f32 - 1.001);
        let low = node as usize;
        let powers = &powers[plane * tables.sampling.cells..][..nodes];
        // Between beams, the fourth root follows the edge of a shadow better than the power or its logarithm.
        let root = |node: usize| at_least(powers[node], VISIBLE_MIN).sqrt().sqrt();
        let part = node - low as f32;
        let between = root(low) * (1.0 - part) + root(low + 1) * part;
        boundary.ln_gain = at_most(2.0 * ln(between), constants.visible_max_np());
    }
}
