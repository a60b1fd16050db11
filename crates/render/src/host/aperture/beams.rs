//! Beams at each depth plane: their two-way amplitude at every cell, and their echo power relative to unobstructed
//! beams.

use insonify_core::simd::widened_to_eight;
use rayon::prelude::*;

use super::fourier::{LANES, Roots, Wide, reversed};
use super::propagate::FIELDS;
use crate::aperture::{ApertureTables, BEAMS_MAX, MODES_MAX};
use crate::host::constants::ImageConstants;

/// Number of cells whose amplitudes are written together: a cache line.
const TOGETHER: usize = 2 * LANES;

/// Outputs of the pass.
#[derive(Debug)]
pub(in crate::host) struct Beams<'a> {
    /// Two-way amplitude of each beam of a period at each cell [planes × beams × cells]. Planes before the first
    /// obstacle are not filled.
    pub(in crate::host) amplitudes: &'a mut [f32],
    /// Echo power of each beam relative to the greatest one without obstacles [planes × cells]. Each row begins with
    /// one value per beam axis (node); the rest is 0.
    pub(in crate::host) powers: &'a mut [f32],
}

/// Fills the outputs from the modes' `fields`, an output of `propagate`. Planes before `first` are unobstructed. `work`
/// is [planes × 2 × beams].
pub(in crate::host) fn beams(
    constants: ImageConstants,
    tables: &ApertureTables,
    roots: &Roots,
    first: usize,
    fields: &[f32],
    work: &mut [Wide],
    into: Beams<'_>,
) {
    let (cells, beams) = (tables.sampling.cells, tables.sampling.beams);
    let rows = into
        .powers
        .par_chunks_exact_mut(cells)
        .zip(into.amplitudes.par_chunks_exact_mut(beams * cells))
        .zip(work.par_chunks_exact_mut(2 * beams))
        .enumerate();
    rows.for_each(|(plane, ((row, amplitudes), work))| {
        if plane < first {
            row.copy_from_slice(&tables.shares[plane * cells..][..cells]);
        } else {
            sum_plane(constants, tables, roots, plane, fields, work, amplitudes, row);
        }
    });
}

widened_to_eight! {
    /// Sums the modes to beams at one plane.
    fn sum_plane(
        constants: ImageConstants, tables: &ApertureTables, roots: &Roots, plane: usize, fields: &[f32],
        work: &mut [Wide], amplitudes: &mut [f32], row: &mut [f32],
    ) = sum_plane_body
}

#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "those of `sum_plane`")]
fn sum_plane_body(
    constants: ImageConstants,
    tables: &ApertureTables,
    roots: &Roots,
    plane: usize,
    fields: &[f32],
    work: &mut [Wide],
    amplitudes: &mut [f32],
    row: &mut [f32],
) {
    let (cells, beams) = (tables.sampling.cells, tables.sampling.beams);
    let receive = &tables.receive[plane * tables.modes.len()..][..tables.sampling.modes_at(plane)];
    let (sent, heard) = work.split_at_mut(beams);
    let of_group = FIELDS / LANES * cells * tables.planes;
    let mut bins = [0; MODES_MAX];
    for (bin, mode) in bins.iter_mut().zip(&tables.modes) {
        *bin = mode.map_or(0, |mode| tables.sampling.bin(plane, mode));
    }
    let mut powers = [[0.0; TOGETHER]; BEAMS_MAX];
    for first_cell in (0..cells).step_by(TOGETHER) {
        for beside in 0..TOGETHER / LANES {
            let tile = FIELDS / LANES * (plane * cells + first_cell) + beside * FIELDS;
            sent.fill(Wide::ZERO);
            heard.fill(Wide::ZERO);
            let groups = bins.chunks_exact(LANES).zip(tables.transmit.chunks_exact(LANES)).enumerate();
            for ((group, (bins, transmit)), receive) in groups.zip(receive.chunks_exact(LANES)) {
                let Some(tile) = fields.get(group * of_group + tile..).and_then(|rest| rest.first_chunk::<FIELDS>())
                else {
                    continue;
                };
                let rows = tile.as_chunks::<LANES>().0.as_chunks::<2>().0;
                // Modes that pad a group have no field.
                for (((&bin, [re, im]), &transmit), &receive) in bins.iter().zip(rows).zip(transmit).zip(receive) {
                    let field = Wide { re: *re, im: *im };
                    sent[bin] = sent[bin].plus(&field.times(transmit));
                    heard[bin] = heard[bin].plus(&field.times(receive));
                }
            }
            roots.forward(sent);
            roots.forward(heard);
            for ((t, r), powers) in sent.iter().zip(&*heard).zip(&mut powers) {
                let powers = &mut powers[beside * LANES..][..LANES];
                for (lane, power) in powers.iter_mut().enumerate() {
                    *power = (t.re[lane] * t.re[lane] + t.im[lane] * t.im[lane])
                        * (r.re[lane] * r.re[lane] + r.im[lane] * r.im[lane]);
                }
            }
        }
        // Amplitudes are written by whole cache lines: rows are a power of two apart and collide in the L1 cache.
        for (beam, amplitudes) in amplitudes.chunks_exact_mut(cells).enumerate() {
            let powers = &powers[reversed(beam, beams)];
            for (amplitude, &power) in amplitudes[first_cell..].iter_mut().zip(powers) {
                *amplitude = power.sqrt();
            }
        }
    }
    let greatest = tables.greatest[plane].max(constants.unobstructed_min());
    let (node_cells, reach) = (tables.sampling.node_cells_at(plane), tables.reach_cells[plane]);
    let furthest = (reach + 0.5) as usize;
    row.fill(0.0);
    for (axis, power) in row.iter_mut().enumerate().take(tables.sampling.nodes_at(plane)) {
        let amplitudes = &amplitudes[tables.sampling.beam_of(plane, axis) * cells..][..cells];
        let middle = axis * node_cells;
        let (from, to) = (middle.saturating_sub(furthest), (middle + furthest + 1).min(cells));
        let mut sum = sum_within(&amplitudes[from..to], (middle - from) as f32, reach);
        // The grid is periodic.
        let (before, after) = (furthest - (middle - from), middle + furthest + 1 - to);
        if before > 0 {
            sum += sum_within(&amplitudes[cells - before..], furthest as f32, reach);
        }
        if after > 0 {
            sum += sum_within(&amplitudes[..after], middle as f32 - cells as f32, reach);
        }
        *power = sum / greatest;
    }
}

/// Sum of squared amplitudes within `reach` of `middle`, a position in cells from the first one. The last cell counts
/// by the fraction of it inside. Each lane has its own sum, so every instruction set adds in the same order.
#[inline(always)]
fn sum_within(amplitudes: &[f32], middle: f32, reach: f32) -> f32 {
    let mut sums = [0.0; LANES];
    let term = |i: usize, amplitude: f32| {
        let inside = (reach + 0.5 - (i as f32 - middle).abs()).clamp(0.0, 1.0);
        inside * amplitude * amplitude
    };
    let (tiles, rest) = amplitudes.as_chunks::<LANES>();
    for (tile, first) in tiles.iter().zip((0..).step_by(LANES)) {
        for lane in 0..LANES {
            sums[lane] += term(first + lane, tile[lane]);
        }
    }
    for (lane, &amplitude) in rest.iter().enumerate() {
        sums[lane] += term(LANES * tiles.len() + lane, amplitude);
    }
    sums.iter().sum()
}
