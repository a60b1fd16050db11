//! Propagation of the modes (waves along the face) from plane to plane through the transmission and the delays of the
//! scan plane.

use insonify_core::simd::{phasor, widened_to_eight};
use rayon::iter::once;
use rayon::prelude::*;

use super::fourier::{LANES, Roots, Wide, reversed, transposed};
use crate::aperture::{ApertureTables, MODE_LANES};
use crate::host::constants::ImageConstants;

const _: () = assert!(LANES == MODE_LANES);

/// Numbers in a tile of complex fields: eight modes at eight cells.
pub(in crate::host) const FIELDS: usize = 2 * LANES * LANES;

/// Tables in the bit-reversed order of spectra, made once for a configuration.
#[derive(Debug, Clone)]
pub(in crate::host) struct Propagation {
    roots: Roots,
    /// The aperture tables' `steps` in bit-reversed order [planes × cells].
    steps: Vec<[f32; 2]>,
}

impl Propagation {
    pub(in crate::host) fn new(tables: &ApertureTables) -> Self {
        let mut steps = vec![[0.0; 2]; tables.steps.len()];
        for (row, steps) in
            tables.steps.chunks_exact(tables.sampling.cells).zip(steps.chunks_exact_mut(tables.sampling.cells))
        {
            for (k, &step) in row.iter().enumerate() {
                steps[reversed(k, tables.sampling.cells)] = step;
            }
        }
        Self { roots: Roots::new(tables.sampling.cells), steps }
    }
}

/// Index of the first plane with an obstacle or an uneven delay in its interval; the number of planes if there is none.
/// Beams up to that plane are unobstructed.
pub(in crate::host) fn first_plane(constants: ImageConstants, tables: &ApertureTables, mask: &[[f32; 2]]) -> usize {
    let whole = 1.0 - constants.contrast_min();
    let differs = |row: &[[f32; 2]]| row.iter().any(|&[re, im]| re < whole || im.abs() > constants.phase_min());
    mask.chunks_exact(tables.sampling.cells).position(differs).unwrap_or(tables.planes)
}

/// Fills `fields` from plane `first_plane` on: the field of each mode at each cell, before the plane's interval
/// transmits and delays it.
///
/// `fields` is [groups of 8 modes × planes × tiles of 8 cells × modes × (real parts, imaginary parts) × cells], `work`
/// is [groups of modes × cells].
pub(in crate::host) fn propagate(
    tables: &ApertureTables,
    propagation: &Propagation,
    first_plane: usize,
    mask: &[[f32; 2]],
    work: &mut [Wide],
    fields: &mut [f32],
) {
    if first_plane >= tables.planes {
        return;
    }
    let (cells, of_group) = (tables.sampling.cells, LANES * tables.planes * 2 * tables.sampling.cells);
    let groups = tables.modes.len() / LANES;
    // Groups at the start reach the last plane, groups at the end may stop earlier. A task takes one of each.
    let (fields, last_fields) = fields.split_at_mut(groups.div_ceil(2) * of_group);
    let (work, last_work) = work.split_at_mut(groups.div_ceil(2) * cells);
    let first = fields.par_chunks_exact_mut(of_group).zip(work.par_chunks_exact_mut(cells)).enumerate();
    let last = last_fields.par_chunks_exact_mut(of_group).zip(last_work.par_chunks_exact_mut(cells));
    let go = |group: usize, (fields, work): (&mut [f32], &mut [Wide])| {
        propagate_group(tables, propagation, group, first_plane, mask, work, fields);
    };
    first.zip(last.rev().map(Some).chain(once(None))).for_each(|((group, of_first), of_last)| {
        rayon::join(|| go(group, of_first), || of_last.map(|of_last| go(groups - 1 - group, of_last)));
    });
}

widened_to_eight! {
    /// Propagates a group of modes.
    fn propagate_group(
        tables: &ApertureTables, propagation: &Propagation, group: usize, first: usize, mask: &[[f32; 2]],
        work: &mut [Wide], fields: &mut [f32],
    ) = propagate_group_body
}

#[inline(always)]
fn propagate_group_body(
    tables: &ApertureTables,
    propagation: &Propagation,
    group: usize,
    first: usize,
    mask: &[[f32; 2]],
    work: &mut [Wide],
    fields: &mut [f32],
) {
    let (cells, planes) = (tables.sampling.cells, tables.planes);
    begin(tables, group, work);
    let roots = &propagation.roots;
    let part = roots.part();
    roots.begin_forward(work);
    for plane in 0..planes {
        if LANES * group >= tables.sampling.modes_at(plane) {
            return;
        }
        let steps = propagation.steps[plane * cells..][..cells].chunks_exact(part);
        for (values, steps) in work.chunks_exact_mut(part).zip(steps) {
            // Planes before `first` skip the inverse transform: their spectra stay whole.
            if plane == 0 || plane > first {
                roots.end_forward(values);
            }
            for (value, &step) in values.iter_mut().zip(steps) {
                *value = value.times(step);
            }
            if plane >= first {
                roots.begin_inverse(values);
            } else {
                // Each step includes the inverse transform's factor 1/cells. Without that transform, the factor is
                // taken out again.
                let scale = [cells as f32, 0.0];
                for value in values.iter_mut() {
                    *value = value.times(scale);
                }
            }
        }
        if plane < first {
            continue;
        }
        roots.end_inverse(work);
        let fields = fields[2 * LANES * cells * plane..].as_chunks_mut::<FIELDS>().0;
        let mask = mask[plane * cells..].as_chunks::<LANES>().0;
        for ((tile, fields), mask) in work.as_chunks_mut::<LANES>().0.iter_mut().zip(fields).zip(mask) {
            store(tile, fields);
            for (value, &passes) in tile.iter_mut().zip(mask) {
                *value = value.times(passes);
            }
        }
        roots.begin_forward(work);
    }
}

/// Writes the fields of a group's modes on the face.
#[inline(always)]
fn begin(tables: &ApertureTables, group: usize, work: &mut [Wide]) {
    let modes = &tables.modes[group * LANES..][..LANES];
    let period = (tables.sampling.beams * tables.sampling.node_cells) as i32;
    for (cell, (value, &face)) in work.iter_mut().zip(&tables.face).enumerate() {
        let across = cell as i32 - (tables.sampling.cells / 2) as i32;
        for (lane, mode) in modes.iter().enumerate() {
            // Whole turns are removed in integer arithmetic.
            let turns = mode.map_or(0, |mode| (mode * across).rem_euclid(period)) as f32 / period as f32;
            let [re, im] = phasor(turns);
            let amplitude = if mode.is_some() { face } else { 0.0 };
            (value.re[lane], value.im[lane]) = (amplitude * re, amplitude * im);
        }
    }
}

/// Writes the fields of a group's modes at eight cells, by mode.
#[inline(always)]
fn store(tile: &[Wide; LANES], fields: &mut [f32; FIELDS]) {
    let (mut re, mut im) = ([[0.0; LANES]; LANES], [[0.0; LANES]; LANES]);
    for ((re, im), value) in re.iter_mut().zip(&mut im).zip(tile) {
        (*re, *im) = (value.re, value.im);
    }
    let rows = fields.as_chunks_mut::<LANES>().0.as_chunks_mut::<2>().0;
    for (row, (re, im)) in rows.iter_mut().zip(transposed(re).into_iter().zip(transposed(im))) {
        *row = [re, im];
    }
}

/// The fields in the order of the shaders: [modes × planes × (real parts, imaginary parts) × cells].
pub(in crate::host) fn by_mode(tables: &ApertureTables, fields: &[f32]) -> Vec<f32> {
    let (cells, planes) = (tables.sampling.cells, tables.planes);
    let mut ordered = vec![0.0; fields.len()];
    for (at, row) in fields.as_chunks::<LANES>().0.iter().enumerate() {
        let (part, mode, tile) = (at % 2, at / 2 % LANES, at / (2 * LANES) % (cells / LANES));
        let (plane, group) = (at * LANES / (2 * LANES * cells) % planes, at * LANES / (2 * LANES * cells) / planes);
        let first = (((group * LANES + mode) * planes + plane) * 2 + part) * cells + tile * LANES;
        ordered[first..first + LANES].copy_from_slice(row);
    }
    ordered
}
