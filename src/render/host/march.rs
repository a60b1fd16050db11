//! Scatterers along the paths: complex baseband before the point-spread function.

use rayon::prelude::*;

use super::constants::{DEVIATE_SCALE, ImageConstants, UNSCALED};
use super::line_gain::Visibility;
use super::paths::{BLOCK, CHUNK, Lanes, Paths, range_mm, seek};
use super::power::{Power, Powers, Stretch};
use super::wide::{at_least, floor, pcg3d, phasor, real, widened};
use crate::render::params::Params;

/// Indices of those that place its scatterers: origin and step.
const PLACE: [usize; 6] = [0, 1, 2, 4, 5, 6];

/// Inputs of the samples besides the paths.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scatterers<'a> {
    pub(super) constants: ImageConstants,
    /// Gain of each block of samples.
    pub(super) gain: &'a [f32],
    /// Gain along the scanlines; without it, every path loses what it meets.
    pub(super) visibility: Option<&'a Visibility<'a>>,
}

/// Fills `baseband`, complex [scanlines × row_samples]; the last batch adds to it. `kept` keeps the powers between the
/// batches of a frame [scanlines × row_samples]; it is empty if there is one batch.
pub(super) fn march(
    params: &Params,
    paths: Paths<'_>,
    scatterers: Scatterers<'_>,
    baseband: &mut [[f32; 2]],
    kept: &mut [[f32; 3]],
) {
    let samples = params.row_samples as usize;
    let rows = baseband.par_chunks_exact_mut(samples).enumerate();
    if kept.is_empty() {
        rows.for_each(|(line, row)| march_row(params, &paths, &scatterers, line as u32, row, &mut []));
    } else {
        let rows = rows.zip(kept.par_chunks_exact_mut(samples));
        rows.for_each(|((line, row), kept)| march_row(params, &paths, &scatterers, line as u32, row, kept));
    }
}

widened! {
    /// One scanline.
    fn march_row(
        params: &Params, paths: &Paths<'_>, scatterers: &Scatterers<'_>, line: u32, row: &mut [[f32; 2]],
        kept: &mut [[f32; 3]],
    ) = march_row_body
}

#[inline(always)]
fn march_row_body(
    params: &Params,
    paths: &Paths<'_>,
    scatterers: &Scatterers<'_>,
    line: u32,
    row: &mut [[f32; 2]],
    kept: &mut [[f32; 3]],
) {
    let begins = params.layer_first == 0;
    let ends = params.layer_first.wrapping_add(params.layer_count) == params.layers;
    // One guide places the scatterers of all paths of a scanline; a single path is its own guide.
    let guide = params.guide_of(line);
    let mut powers = Powers::new();
    let mut cells = Cells::default();
    let chunks = row.as_chunks_mut::<BLOCK>().0.chunks_mut(CHUNK);
    for ((chunk, row), gain) in chunks.enumerate().zip(scatterers.gain.chunks(CHUNK)) {
        let first = (chunk * CHUNK * BLOCK) as u32;
        powers.begin(row.len());
        // The mean power of all rays sets their strength.
        let weight = params.path_weight();
        for layer in 0..params.layer_count {
            let path = layer.wrapping_mul(params.scanlines).wrapping_add(line).wrapping_mul(params.rays);
            for ray in 0..params.rays {
                let stretch = Stretch { first, blocks: row.len(), weight };
                powers.add(params, paths, [path.wrapping_add(ray), guide], stretch, scatterers.visibility.is_some());
            }
        }
        for (i, (row, &gain)) in row.iter_mut().zip(gain).enumerate() {
            let block = first.wrapping_add((i * BLOCK) as u32);
            let mut loudness = [0.0; BLOCK];
            if let Some(visibility) = scatterers.visibility {
                visibility.block(params, paths, line, block, &mut loudness);
            }
            let mut total = powers.total(i, &loudness);
            if let Some(kept) = kept.get_mut(block as usize..).and_then(|rest| rest.first_chunk_mut::<BLOCK>()) {
                add_kept(&mut total, kept, begins);
            }
            let mut sums = [[0.0; BLOCK]; 2];
            if ends {
                cells.find(params, scatterers.constants, &places(params, paths, guide, block), block);
                cells.echo(UNSCALED * gain, &total, &mut sums);
            }
            for (j, out) in row.iter_mut().enumerate() {
                // `row` already holds the echoes of earlier batches.
                let before = if begins { [0.0; 2] } else { *out };
                *out = [before[0] + sums[0][j], before[1] + sums[1][j]];
            }
        }
    }
}

/// Adds the powers of earlier batches, and keeps the sum.
#[inline(always)]
fn add_kept(total: &mut Power, kept: &mut [[f32; 3]; BLOCK], begins: bool) {
    for (i, kept) in kept.iter_mut().enumerate() {
        for (sums, kept) in total.iter_mut().zip(kept) {
            sums[i] += if begins { 0.0 } else { *kept };
            *kept = sums[i];
        }
    }
}

/// Origin and step of a path's segments at a block's samples. Two samples share a segment.
#[inline(always)]
fn places(params: &Params, paths: &Paths<'_>, path: u32, first: u32) -> [Lanes; PLACE.len()] {
    let (end_mm, segment) = seek(params, paths, path, first);
    if range_mm(params, first.wrapping_add(BLOCK as u32 - 2)) < end_mm {
        return PLACE.map(|at| [segment[at]; BLOCK]);
    }
    let mut lanes = [[0.0; BLOCK]; PLACE.len()];
    for pair in 0..BLOCK / 2 {
        let segment = seek(params, paths, path, first.wrapping_add(2 * pair as u32)).1;
        for (lane, at) in lanes.iter_mut().zip(PLACE) {
            lane[2 * pair] = segment[at];
            lane[2 * pair + 1] = segment[at];
        }
    }
    lanes
}

/// Lattice cells of a path at a block's samples.
#[derive(Debug, Default)]
struct Cells {
    /// The cell holds a scatterer in media whose density is above this.
    presence: [u32; BLOCK],
    deviate: [Lanes; 2],
    turn: [Lanes; 2],
}

impl Cells {
    /// Finds the cells from the origins and steps of segments.
    #[inline(always)]
    fn find(&mut self, params: &Params, constants: ImageConstants, places: &[Lanes; PLACE.len()], first: u32) {
        let cell_mm = constants.cell_mm();
        let [x0, y0, z0, dx, dy, dz] = places;
        let per_mm = 1.0 / cell_mm;
        for i in 0..BLOCK {
            let range_mm = range_mm(params, first.wrapping_add(i as u32));
            let here = [x0[i] + dx[i] * range_mm, y0[i] + dy[i] * range_mm, z0[i] + dz[i] * range_mm];
            let cell = here.map(|x| floor(x * per_mm));
            let [presence, place, amplitude] = pcg3d(cell.map(|c| c as u32));
            // Place of the scatterer in its cell: three times ten bits.
            let offset = |shift: u32| (real(place >> shift & 1023) + 0.5) * (1.0 / 1024.0);
            let ahead = [
                (cell[0] as f32 + offset(0)) * cell_mm - here[0],
                (cell[1] as f32 + offset(10)) * cell_mm - here[1],
                (cell[2] as f32 + offset(20)) * cell_mm - here[2],
            ];
            // The scatterer's own range sets the phase, whichever sample finds its cell.
            let along = ahead[0] * dx[i] + ahead[1] * dy[i] + ahead[2] * dz[i];
            let ahead_mm = along / at_least(dx[i] * dx[i] + dy[i] * dy[i] + dz[i] * dz[i], 1.0e-12);
            let turn = phasor(-params.phase_turns_per_mm * (range_mm + ahead_mm));
            let deviate = deviate(amplitude);
            self.presence[i] = presence >> 15;
            for part in 0..2 {
                self.turn[part][i] = turn[part];
                self.deviate[part][i] = deviate[part];
            }
        }
    }

    /// Adds the echoes of the scatterers of a power, times `gain`, to `sums`.
    #[inline(always)]
    fn echo(&self, gain: f32, [mean, deviation, dense]: &Power, sums: &mut [Lanes; 2]) {
        let (turn, deviate) = (&self.turn, &self.deviate);
        for i in 0..BLOCK {
            // Where media meet, their densities are averaged by power.
            let density = dense[i] / at_least(mean[i] + deviation[i], f32::MIN_POSITIVE);
            let there = if real(self.presence[i]) + 0.5 < density { gain } else { 0.0 };
            let (mean, deviation) = (mean[i].sqrt(), deviation[i].sqrt());
            let strength = [there * (mean + deviation * deviate[0][i]), there * (deviation * deviate[1][i])];
            sums[0][i] += strength[0] * turn[0][i] - strength[1] * turn[1][i];
            sums[1][i] += strength[0] * turn[1][i] + strength[1] * turn[0][i];
        }
    }
}

/// A complex number of mean 0 and mean square 1: each part is a sum of four nibbles.
#[inline(always)]
fn deviate(bits: u32) -> [f32; 2] {
    let pairs = (bits & 0x0f0f_0f0f).wrapping_add(bits >> 4 & 0x0f0f_0f0f);
    let sums = [pairs.wrapping_add(pairs >> 8), (pairs >> 16).wrapping_add(pairs >> 24)];
    sums.map(|sum| (real(sum & 255) - 30.0) * DEVIATE_SCALE)
}
