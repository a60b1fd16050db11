//! Scatterers along the paths: complex baseband before the point-spread function.

use rayon::prelude::*;

use super::constants::{DEVIATE_SCALE, ImageConstants, LN_SCALE, LN_SPECKLE_SILENT, UNSCALED};
use super::wide::{at_least, at_most, exp, floor, pcg3d, phasor, real, widened};
use crate::render::constants::{DEPTH_BLOCK, HINT_BLOCK, SEGMENTS, STARTS, TAG_DENSITY};
use crate::render::params::Params;

/// Samples per block, which share a gain.
const BLOCK: usize = DEPTH_BLOCK as usize;
/// Blocks per pass over the paths: their sums stay in the first-level cache.
const CHUNK: usize = 32;
/// One number per sample of a block.
type Lanes = [f32; BLOCK];
/// Numbers per segment.
const SEGMENT: usize = 12;
/// Indices of those that place its scatterers: origin and step.
const PLACE: [usize; 6] = [0, 1, 2, 4, 5, 6];
/// Scaled power at and below which scatterers are silent: e⁻⁷⁰.
const SILENT_POWER: f32 = 3.975_449_7e-31;
/// Largest fall of ln power per block for which a block's powers are derived from those of the block before.
const LN_FALL_MAX: f32 = 7.0;
/// Range of ln of the scaled powers. Lanes before the start of their segment are louder, by up to a block's fall.
const LN_POWERS: [f32; 2] = [2.0 * (LN_SPECKLE_SILENT + LN_SCALE), 2.0 * LN_SCALE + LN_FALL_MAX];

/// Traced paths of a batch: the outputs of `trace`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Paths<'a> {
    /// Start of each segment, mm of range [paths × STARTS].
    pub(crate) starts: &'a [f32],
    /// Origin and ln amplitude; step and fall; mean, deviation, density, 0 [paths × SEGMENTS].
    pub(crate) segments: &'a [[f32; SEGMENT]],
    /// Segments that hold the first samples of hint blocks, four per word [paths × hint_words].
    pub(crate) hints: &'a [u32],
}

/// Inputs of the samples besides the paths.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scatterers<'a> {
    pub(crate) constants: ImageConstants,
    /// Gain of each block of samples.
    pub(crate) gain: &'a [f32],
}

/// Fills `baseband`, complex [scanlines × row_samples]; the last batch adds to it. `powers`, of the same size, keeps
/// the scatterers' power between the batches of a frame: of mean and deviation, scaled.
pub(crate) fn march(
    params: &Params,
    paths: Paths<'_>,
    scatterers: Scatterers<'_>,
    baseband: &mut [[f32; 2]],
    powers: &mut [[f32; 2]],
) {
    let samples = params.row_samples as usize;
    let rows = baseband.par_chunks_exact_mut(samples).zip(powers.par_chunks_exact_mut(samples)).enumerate();
    rows.for_each(|(line, (row, powers))| march_row(params, &paths, &scatterers, line as u32, row, powers));
}

widened! {
    /// One scanline.
    fn march_row(
        params: &Params, paths: &Paths<'_>, scatterers: &Scatterers<'_>, line: u32, row: &mut [[f32; 2]],
        powers: &mut [[f32; 2]],
    ) = march_row_body
}

#[inline(always)]
fn march_row_body(
    params: &Params,
    paths: &Paths<'_>,
    scatterers: &Scatterers<'_>,
    line: u32,
    row: &mut [[f32; 2]],
    powers: &mut [[f32; 2]],
) {
    let begins = params.layer_first == 0;
    let ends = params.layer_first.wrapping_add(params.layer_count) == params.layers;
    // One guide places the scatterers of all paths of a scanline; a single path is its own guide.
    let sounding_paths = if params.guides == 0 { 0 } else { params.sounding_paths(params.layer_count) };
    let guide = sounding_paths.wrapping_add(line);
    let mut cells: [Cells; CHUNK] = std::array::from_fn(|_| Cells::default());
    let mut power = [[[0.0; BLOCK]; 2]; CHUNK];
    let chunks =
        row.as_chunks_mut::<BLOCK>().0.chunks_mut(CHUNK).zip(powers.as_chunks_mut::<BLOCK>().0.chunks_mut(CHUNK));
    for ((chunk, (row, powers)), gain) in chunks.enumerate().zip(scatterers.gain.chunks(CHUNK)) {
        let first = (chunk * CHUNK * BLOCK) as u32;
        let block_at = |block: usize| first.wrapping_add((block * BLOCK) as u32);
        for (block, cells) in cells.iter_mut().enumerate().take(row.len()) {
            cells.find(params, scatterers.constants, &places(params, paths, guide, block_at(block)), block_at(block));
        }
        for (power, before) in power.iter_mut().zip(powers.iter()) {
            for (i, before) in before.iter().enumerate() {
                [power[0][i], power[1][i]] = if begins { [0.0; 2] } else { *before };
            }
        }
        // The mean power of all rays sets their strength.
        let weight = params.path_weight();
        for layer in 0..params.layer_count {
            let path = layer.wrapping_mul(params.scanlines).wrapping_add(line).wrapping_mul(params.rays);
            for ray in 0..params.rays {
                let blocks = row.len();
                accumulate_power(
                    params,
                    paths,
                    path.wrapping_add(ray),
                    weight,
                    first,
                    &cells[..blocks],
                    &mut power[..blocks],
                );
            }
        }
        for (i, ((row, powers), &gain)) in row.iter_mut().zip(powers).zip(gain).enumerate() {
            let mut sums = [[0.0; BLOCK]; 2];
            if ends {
                cells[i].echo(UNSCALED * gain, &power[i].map(|lanes| lanes.map(f32::sqrt)), &mut sums);
            } else {
                for (j, powers) in powers.iter_mut().enumerate() {
                    *powers = [power[i][0][j], power[i][1][j]];
                }
            }
            for (j, out) in row.iter_mut().enumerate() {
                // `row` already holds the echoes of earlier batches.
                let before = if begins { [0.0; 2] } else { *out };
                *out = [before[0] + sums[0][j], before[1] + sums[1][j]];
            }
        }
    }
}

/// Adds a path's power, times `weight`, to the scatterers' mean and deviation in a run of blocks.
#[inline(always)]
fn accumulate_power(
    params: &Params,
    paths: &Paths<'_>,
    path: u32,
    weight: f32,
    first: u32,
    cells: &[Cells],
    power: &mut [[Lanes; 2]],
) {
    let last = first.wrapping_add((cells.len() * BLOCK) as u32);
    let mut sample = first;
    while sample < last {
        let (end_mm, segment) = seek(params, paths, path, sample);
        let stop = first_beyond(params, end_mm, sample, last);
        let &[_, _, _, level, _, _, _, fall, mean, deviation, density, _] = segment;
        let density = (density.to_bits() & TAG_DENSITY) as i32;
        // Skips media without scatterers, and inaudible segments.
        if density != 0 && level - fall * range_mm(params, sample) > LN_SPECKLE_SILENT {
            let parts = [weight * mean * mean, weight * deviation * deviation];
            let begin = sample.wrapping_sub(first) as usize;
            let end = stop.wrapping_sub(first) as usize;
            let mut now = [0.0; BLOCK];
            let fall_a_block = 2.0 * fall * params.sample_spacing_mm * BLOCK as f32;
            let on = exp(-at_most(fall_a_block, LN_FALL_MAX));
            for block in begin / BLOCK..end.div_ceil(BLOCK) {
                if block == begin / BLOCK || fall_a_block > LN_FALL_MAX {
                    let first = first.wrapping_add((block * BLOCK) as u32);
                    for (i, now) in now.iter_mut().enumerate() {
                        let ln_amplitude = level - fall * range_mm(params, first.wrapping_add(i as u32));
                        *now = exp(at_most(at_least(2.0 * (ln_amplitude + LN_SCALE), LN_POWERS[0]), LN_POWERS[1]));
                    }
                }
                let (from, to) = (begin.saturating_sub(block * BLOCK) as i32, end.wrapping_sub(block * BLOCK) as i32);
                let (Some(cells), Some([means, deviations])) = (cells.get(block), power.get_mut(block)) else { break };
                for i in 0..BLOCK {
                    let within = (i as i32 >= from) & ((i as i32) < to);
                    let there = ((cells.presence[i] as i32) < density) & (now[i] > SILENT_POWER);
                    let part = if within & there { now[i] } else { 0.0 };
                    means[i] += parts[0] * part;
                    deviations[i] += parts[1] * part;
                    now[i] *= on;
                }
                // Amplitude falls with depth, so the first sample bounds the block.
                if now[0] <= SILENT_POWER {
                    break;
                }
            }
        }
        sample = stop;
    }
}

/// The first sample in (sample, last] beyond a segment that ends at `end_mm`. Two samples share the first's segment.
#[inline(always)]
fn first_beyond(params: &Params, end_mm: f32, sample: u32, last: u32) -> u32 {
    let about = (end_mm / params.sample_spacing_mm - 0.5).clamp(real(sample), real(last));
    // An even estimate, then corrected.
    let mut stop = ((about as u32).wrapping_add(1) & !1).clamp(sample.wrapping_add(2), last);
    while stop > sample.wrapping_add(2) && range_mm(params, stop.wrapping_sub(2)) >= end_mm {
        stop = stop.wrapping_sub(2);
    }
    while stop < last && range_mm(params, stop) < end_mm {
        stop = stop.wrapping_add(2);
    }
    stop
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

/// End of the path segment that holds `sample`, mm of range, and the segment.
#[inline(always)]
fn seek<'a>(params: &Params, paths: &Paths<'a>, path: u32, sample: u32) -> (f32, &'a [f32; SEGMENT]) {
    const NONE: &[f32; SEGMENT] = &[0.0; SEGMENT];
    let path = path as usize;
    let range_mm = range_mm(params, sample);
    let hints: &[u8] = bytemuck::cast_slice(paths.hints);
    let hint = path * 4 * params.hint_words as usize + (sample / HINT_BLOCK) as usize;
    let mut at = hints.get(hint).copied().unwrap_or(0) as usize;
    let ends = paths.starts.get(path * STARTS as usize + 1..(path + 1) * STARTS as usize).unwrap_or(&[]);
    while ends.get(at).is_some_and(|&end_mm| end_mm <= range_mm) {
        at += 1;
    }
    let segment = paths.segments.get(path * SEGMENTS as usize + at).unwrap_or(NONE);
    (ends.get(at).copied().unwrap_or(f32::MAX), segment)
}

#[inline(always)]
fn range_mm(params: &Params, sample: u32) -> f32 {
    (real(sample) + 0.5) * params.sample_spacing_mm
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

    /// Adds the echoes of the scatterers, with mean and deviation times `gain`, to `sums`.
    #[inline(always)]
    fn echo(&self, gain: f32, [mean, deviation]: &[Lanes; 2], sums: &mut [Lanes; 2]) {
        let (turn, deviate) = (&self.turn, &self.deviate);
        for i in 0..BLOCK {
            let strength = [gain * (mean[i] + deviation[i] * deviate[0][i]), gain * (deviation[i] * deviate[1][i])];
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
