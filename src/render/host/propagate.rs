//! Propagation of the modes from plane to plane through the transmission of the scan plane.

use rayon::prelude::*;

use super::fourier::{LANES, Roots, Wide, reversed};
use super::wide::{phasor, widened};
use crate::render::aperture::{ApertureTables, MODE_LANES};

const _: () = assert!(LANES == MODE_LANES);

/// Rows of a plane whose transmissions differ by less than this hide nothing.
const CONTRAST_MIN: f32 = 1.0e-5;

/// Orders of a spectrum, made once for a configuration.
#[derive(Debug, Clone)]
pub(super) struct Propagation {
    roots: Roots,
    /// Steps of the tables in the order of spectra [planes × cells].
    steps: Vec<[f32; 2]>,
}

impl Propagation {
    pub(super) fn new(tables: &ApertureTables) -> Self {
        let mut steps = vec![[0.0; 2]; tables.steps.len()];
        for (row, steps) in tables.steps.chunks_exact(tables.cells).zip(steps.chunks_exact_mut(tables.cells)) {
            for (k, &step) in row.iter().enumerate() {
                steps[reversed(k, tables.cells)] = step;
            }
        }
        Self { roots: Roots::new(tables.cells), steps }
    }
}

/// The first plane with an obstacle in its interval; `planes` if there is none. Beams up to it are unobstructed.
pub(super) fn first_plane(tables: &ApertureTables, mask: &[f32]) -> usize {
    let differs = |row: &[f32]| row.iter().any(|&value| value < 1.0 - CONTRAST_MIN);
    mask.chunks_exact(tables.cells).position(differs).unwrap_or(tables.planes)
}

/// Fills `fields` from plane `first` on: the field of each mode at each node, before the interval of the plane
/// [modes × planes × (real parts, imaginary parts) × cells], the first nodes of each row. `work` holds as many numbers as
/// the groups of modes have cells.
pub(super) fn propagate(
    tables: &ApertureTables,
    propagation: &Propagation,
    first: usize,
    mask: &[f32],
    work: &mut [Wide],
    fields: &mut [f32],
) {
    if first >= tables.planes {
        return;
    }
    let groups = fields
        .par_chunks_exact_mut(LANES * tables.planes * 2 * tables.cells)
        .zip(work.par_chunks_exact_mut(tables.cells));
    groups.enumerate().for_each(|(group, (fields, work))| {
        propagate_group(tables, propagation, group, first, mask, work, fields);
    });
}

widened! {
    /// A group of modes.
    fn propagate_group(
        tables: &ApertureTables, propagation: &Propagation, group: usize, first: usize, mask: &[f32],
        work: &mut [Wide], fields: &mut [f32],
    ) = propagate_group_body
}

#[inline(always)]
fn propagate_group_body(
    tables: &ApertureTables,
    propagation: &Propagation,
    group: usize,
    first: usize,
    mask: &[f32],
    work: &mut [Wide],
    fields: &mut [f32],
) {
    let (cells, planes) = (tables.cells, tables.planes);
    begin(tables, group, work);
    propagation.roots.forward(work);
    for plane in 0..planes {
        if LANES * group >= tables.modes_at(plane) {
            return;
        }
        let steps = &propagation.steps[plane * cells..][..cells];
        for (value, &step) in work.iter_mut().zip(steps) {
            *value = value.times(step);
        }
        if plane < first {
            // Steps hold the inverse transform's 1/cells, which only one of them may have.
            let scale = [cells as f32, 0.0];
            work.iter_mut().for_each(|value| *value = value.times(scale));
            continue;
        }
        propagation.roots.inverse(work);
        store(tables, plane, work, fields);
        for (value, &passes) in work.iter_mut().zip(&mask[plane * cells..][..cells]) {
            *value = value.times([passes, 0.0]);
        }
        propagation.roots.forward(work);
    }
}

/// Writes the modes of a group on the face.
#[inline(always)]
fn begin(tables: &ApertureTables, group: usize, work: &mut [Wide]) {
    let modes = &tables.modes[group * LANES..][..LANES];
    let period = (tables.beams * tables.node_cells) as i32;
    for (cell, (value, &face)) in work.iter_mut().zip(&tables.face).enumerate() {
        let across = cell as i32 - (tables.cells / 2) as i32;
        for (lane, mode) in modes.iter().enumerate() {
            // Whole turns are taken off as integers.
            let turns = mode.map_or(0, |mode| (mode * across).rem_euclid(period)) as f32 / period as f32;
            let [re, im] = phasor(turns);
            let amplitude = if mode.is_some() { face } else { 0.0 };
            (value.re[lane], value.im[lane]) = (amplitude * re, amplitude * im);
        }
    }
}

/// Writes the fields at the nodes of a plane, a row a mode.
#[inline(always)]
fn store(tables: &ApertureTables, plane: usize, work: &[Wide], fields: &mut [f32]) {
    let (cells, node_cells, nodes) = (tables.cells, tables.node_cells_at(plane), tables.nodes_at(plane));
    for (lane, rows) in fields.chunks_exact_mut(tables.planes * 2 * cells).enumerate() {
        let (re, im) = rows[plane * 2 * cells..][..2 * cells].split_at_mut(cells);
        let values = work.iter().step_by(node_cells);
        for ((value, re), im) in values.zip(&mut re[..nodes]).zip(&mut im[..nodes]) {
            (*re, *im) = (value.re[lane], value.im[lane]);
        }
    }
}
