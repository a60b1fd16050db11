//! Echo power of the beams at each plane, over that without obstacles.

use rayon::prelude::*;

use super::constants::ImageConstants;
use super::fourier::{LANES, Roots, Row, Wide, reversed};
use crate::render::aperture::{ApertureTables, BEAMS_MAX};
use crate::simd::widened;

/// Fills `powers`, echo power of the beam at each node over that without obstacles [planes × cells], the first nodes of
/// each row. Planes before `first` have none. `work` holds a period of beams, twice, for each plane.
pub(super) fn beams(
    constants: ImageConstants,
    tables: &ApertureTables,
    roots: &Roots,
    first: usize,
    fields: &[f32],
    work: &mut [Wide],
    powers: &mut [f32],
) {
    let rows = powers
        .par_chunks_exact_mut(tables.sampling.cells)
        .zip(work.par_chunks_exact_mut(2 * tables.sampling.beams))
        .enumerate();
    rows.for_each(|(plane, (row, work))| {
        if plane < first {
            row.fill(1.0);
        } else {
            sum_plane(constants, tables, roots, plane, fields, work, row);
        }
    });
}

widened! {
    /// One plane.
    fn sum_plane(
        constants: ImageConstants, tables: &ApertureTables, roots: &Roots, plane: usize, fields: &[f32],
        work: &mut [Wide], row: &mut [f32],
    ) = sum_plane_body
}

#[inline(always)]
fn sum_plane_body(
    constants: ImageConstants,
    tables: &ApertureTables,
    roots: &Roots,
    plane: usize,
    fields: &[f32],
    work: &mut [Wide],
    row: &mut [f32],
) {
    let (cells, nodes, beams) = (tables.sampling.cells, tables.sampling.nodes_at(plane), tables.sampling.beams);
    let receive = &tables.receive[plane * tables.modes.len()..][..tables.sampling.modes_at(plane)];
    let (sent, heard) = work.split_at_mut(beams);
    let mut products: [[f32; BEAMS_MAX]; LANES] = [[0.0; BEAMS_MAX]; LANES];
    row.fill(0.0);
    for first_node in (0..nodes).step_by(LANES) {
        sent.fill(Wide::ZERO);
        heard.fill(Wide::ZERO);
        for (slot, ((mode, &transmit), &receive)) in tables.modes.iter().zip(&tables.transmit).zip(receive).enumerate()
        {
            let Some(mode) = mode else { continue };
            let at = (slot * tables.planes + plane) * 2 * cells + first_node;
            let (Some(re), Some(im)) = (lanes_at(fields, at), lanes_at(fields, at + cells)) else { continue };
            let (field, bin) = (Wide { re: *re, im: *im }, tables.sampling.bin(plane, *mode));
            sent[bin] = sent[bin].plus(&field.times(transmit));
            heard[bin] = heard[bin].plus(&field.times(receive));
        }
        roots.forward(sent);
        roots.forward(heard);
        for beam in 0..beams {
            let (t, r) = (&sent[reversed(beam, beams)], &heard[reversed(beam, beams)]);
            for (lane, products) in products.iter_mut().enumerate() {
                let power = |v: &Wide| v.re[lane] * v.re[lane] + v.im[lane] * v.im[lane];
                products[beam] = power(t) * power(r);
            }
        }
        for (lane, products) in products.iter().enumerate() {
            add_node(tables, plane, first_node + lane, products, &mut row[..nodes]);
        }
    }
    let unobstructed = &tables.unobstructed[plane * cells..][..nodes];
    for (power, &whole) in row.iter_mut().zip(unobstructed) {
        *power /= whole.max(constants.unobstructed_min());
    }
}

/// Adds what the scatterers at a node return to each beam whose axis is within reach.
#[inline(always)]
fn add_node(tables: &ApertureTables, plane: usize, node: usize, products: &[f32; BEAMS_MAX], row: &mut [f32]) {
    let (nodes, reach) = (row.len(), tables.reach_nodes[plane]);
    let furthest = (reach + 0.5) as usize;
    // x = 0 is in the middle of the nodes.
    let first = node.saturating_sub(furthest);
    for (axis, sum) in row.iter_mut().enumerate().take(node + furthest + 1).skip(first) {
        let inside = (reach + 0.5 - axis.abs_diff(node) as f32).clamp(0.0, 1.0);
        *sum += inside * products[((axis + nodes / 2) & (tables.sampling.beams - 1)) & (BEAMS_MAX - 1)];
    }
}

#[inline(always)]
fn lanes_at(values: &[f32], at: usize) -> Option<&Row> {
    values.get(at..).and_then(|rest| rest.first_chunk::<LANES>())
}
