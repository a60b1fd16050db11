//! Scatterers along the paths: complex baseband before the point-spread function.

use rayon::prelude::*;

use super::wide::{at_least, exp, floor, pcg3d, phasor, real, widened};
use crate::render::params::Params;
use crate::render::tables::{DEPTH_BLOCK, HINT_BLOCK, SEGMENTS, STARTS};

/// Samples that are made at once: they share a gain.
const BLOCK: usize = DEPTH_BLOCK as usize;
/// Numbers of a segment.
const SEGMENT: usize = 12;
/// Those that say where its scatterers lie.
const PLACE: [usize; 6] = [0, 1, 2, 4, 5, 6];
/// Those that say how strong they are.
const STRENGTH: [usize; 5] = [3, 7, 8, 9, 10];
/// Place of the density among those numbers.
const DENSITY: usize = 10;
/// Nothing scatters.
const NONE: &[f32; SEGMENT] = &[0.0; SEGMENT];
const LN_SILENT: f32 = -80.0;
/// Density in the lowest bits of its word.
const TAG_DENSITY: u32 = 0x3_ffff;

/// What the paths of a batch left: `trace`'s outputs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Paths<'a> {
    /// Where segments begin, mm of range [paths × STARTS].
    pub(crate) starts: &'a [f32],
    /// Origin and level; step and its fall; mean, deviation, density, 0 [paths × SEGMENTS].
    pub(crate) segments: &'a [[f32; SEGMENT]],
    /// Segments of the blocks' first samples, four a word [paths × hint_words].
    pub(crate) hints: &'a [u32],
}

/// Fills, or for later layers adds to, `baseband`, complex [scanlines × row_samples]; `gain` is that of each block of
/// samples, `cell_mm` the side of a cell of the lattice.
pub(crate) fn march(
    params: &Params,
    paths: Paths<'_>,
    cell_mm: f32,
    layers: &[[f32; 4]],
    gain: &[f32],
    baseband: &mut [[f32; 2]],
) {
    let rows = baseband.par_chunks_exact_mut(params.row_samples as usize).enumerate();
    rows.for_each(|(line, row)| march_row(params, &paths, cell_mm, layers, gain, line as u32, row));
}

widened! {
    /// One scanline.
    fn march_row(
        params: &Params, paths: &Paths<'_>, cell_mm: f32, layers: &[[f32; 4]], gain: &[f32], line: u32,
        row: &mut [[f32; 2]],
    ) = march_row_body
}

#[inline(always)]
fn march_row_body(
    params: &Params,
    paths: &Paths<'_>,
    cell_mm: f32,
    layers: &[[f32; 4]],
    gain: &[f32],
    line: u32,
    row: &mut [[f32; 2]],
) {
    let single = params.rays == 1 && params.layers == 1;
    let guide = params.layer_count.wrapping_mul(params.scanlines).wrapping_mul(params.rays).wrapping_add(line);
    let [rotation, ..] = pcg3d([params.seed, 0, 0]);
    let mut lanes = [[0.0f32; BLOCK]; SEGMENT];
    for (block, (out, &gain)) in row.as_chunks_mut::<BLOCK>().0.iter_mut().zip(gain).enumerate() {
        let first = (block * BLOCK) as u32;
        let gain = gain / (params.paths_per_sample as f32).sqrt();
        let mut sums = [[0.0f32; BLOCK]; 2];
        if single {
            of_path(params, paths, line, first, PLACE, &mut lanes);
            of_path(params, paths, line, first, STRENGTH, &mut lanes);
            // Nothing scatters in a fluid.
            if lanes[DENSITY].iter().any(|density| density.to_bits() & TAG_DENSITY != 0) {
                scatter(params, cell_mm, &lanes, first, gain, &mut sums);
            }
        } else {
            // Where scatterers lie the guide says for all, how strong they are the ray whose turn it is.
            of_path(params, paths, guide, first, PLACE, &mut lanes);
            for k in 0..params.paths_per_sample {
                for pair in 0..BLOCK / 2 {
                    let sample = first.wrapping_add(2 * pair as u32);
                    let [layer, ray] = turn_of(params, layers, line, sample, k, rotation);
                    let path = layer.wrapping_mul(params.scanlines).wrapping_add(line).wrapping_mul(params.rays);
                    // Another dispatch's layer is silent here.
                    let here = layer < params.layer_count;
                    let segment = if here { seek(params, paths, path.wrapping_add(ray), sample).1 } else { NONE };
                    for at in STRENGTH {
                        lanes[at][2 * pair] = segment[at];
                        lanes[at][2 * pair + 1] = segment[at];
                    }
                }
                scatter(params, cell_mm, &lanes, first, gain, &mut sums);
            }
        }
        let [re, im] = &sums;
        if params.layer_first == 0 {
            for (i, out) in out.iter_mut().enumerate() {
                *out = [re[i], im[i]];
            }
        } else {
            for (i, out) in out.iter_mut().enumerate() {
                *out = [out[0] + re[i], out[1] + im[i]];
            }
        }
    }
}

/// Which layer (of this dispatch; another one's is not below layer_count) and which of its rays carry the `k`-th echo of a
/// sample, a layer as often as its weight says. They take turns in an order of low discrepancy over depth and scanlines (R2:
/// Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018), two samples each, less than the pulse is long.
#[inline(always)]
fn turn_of(params: &Params, layers: &[[f32; 4]], line: u32, sample: u32, k: u32, rotation: u32) -> [u32; 2] {
    let number = (sample >> 1).wrapping_mul(params.paths_per_sample).wrapping_add(k);
    let place = number.wrapping_mul(3_242_174_889).wrapping_add(line.wrapping_mul(2_447_445_414));
    let mut turn = place.wrapping_add(rotation) >> 16;
    let share = |layer: u32| layers.get(layer as usize).map_or(0, |layer| (layer[2] * 65536.0) as u32);
    let mut layer = 0;
    while turn >= share(layer) && layer + 1 < params.layers {
        turn -= share(layer);
        layer += 1;
    }
    // The last one's share is what rounding left.
    [layer.wrapping_sub(params.layer_first), (turn * params.rays / share(layer).max(1)).min(params.rays - 1)]
}

/// What `lanes` hold of a block's samples, of the numbers `of` of a path's segments. Two samples share a segment.
#[inline(always)]
fn of_path<const N: usize>(
    params: &Params,
    paths: &Paths<'_>,
    path: u32,
    first: u32,
    of: [usize; N],
    lanes: &mut [[f32; BLOCK]; SEGMENT],
) {
    let (end_mm, segment) = seek(params, paths, path, first);
    if range_mm(params, first.wrapping_add(BLOCK as u32 - 2)) < end_mm {
        for at in of {
            lanes[at] = [segment[at]; BLOCK];
        }
        return;
    }
    for pair in 0..BLOCK / 2 {
        let segment = seek(params, paths, path, first.wrapping_add(2 * pair as u32)).1;
        for at in of {
            lanes[at][2 * pair] = segment[at];
            lanes[at][2 * pair + 1] = segment[at];
        }
    }
}

/// Where the segment of a path that holds `sample` ends, and the segment.
#[inline(always)]
fn seek<'a>(params: &Params, paths: &Paths<'a>, path: u32, sample: u32) -> (f32, &'a [f32; SEGMENT]) {
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

/// Adds the echoes of the scatterers that the segments meet at a block's samples. A sample meets the scatterer of the
/// lattice cell that the path is in at its range.
#[inline(always)]
fn scatter(
    params: &Params,
    cell_mm: f32,
    lanes: &[[f32; BLOCK]; SEGMENT],
    first: u32,
    weight: f32,
    sums: &mut [[f32; BLOCK]; 2],
) {
    let [x0, y0, z0, level, dx, dy, dz, fall, mean, deviation, density, _] = lanes;
    let per_mm = 1.0 / cell_mm;
    for i in 0..BLOCK {
        let range_mm = range_mm(params, first.wrapping_add(i as u32));
        let here = [x0[i] + dx[i] * range_mm, y0[i] + dy[i] * range_mm, z0[i] + dz[i] * range_mm];
        let cell = here.map(|x| floor(x * per_mm));
        let [presence, place, amplitude] = pcg3d(cell.map(|c| c as u32));
        // Where in its cell the scatterer lies: three times ten bits.
        let offset = |shift: u32| (real(place >> shift & 1023) + 0.5) * (1.0 / 1024.0);
        let ahead = [
            (cell[0] as f32 + offset(0)) * cell_mm - here[0],
            (cell[1] as f32 + offset(10)) * cell_mm - here[1],
            (cell[2] as f32 + offset(20)) * cell_mm - here[2],
        ];
        // Its range sets the phase, whichever sample meets its cell.
        let along = ahead[0] * dx[i] + ahead[1] * dy[i] + ahead[2] * dz[i];
        let ahead_mm = along / at_least(dx[i] * dx[i] + dy[i] * dy[i] + dz[i] * dz[i], 1.0e-12);
        let turn = phasor(-params.phase_turns_per_mm * (range_mm + ahead_mm));
        let ln_amplitude = level[i] - fall[i] * range_mm;
        let scale = weight * exp(at_least(ln_amplitude, LN_SILENT));
        let deviate = deviate(amplitude);
        let strength = [scale * (mean[i] + deviation[i] * deviate[0]), scale * (deviation[i] * deviate[1])];
        let some = ((presence >> 15) as i32) < (density[i].to_bits() & TAG_DENSITY) as i32;
        let there = some & (ln_amplitude > LN_SILENT);
        let echo = [strength[0] * turn[0] - strength[1] * turn[1], strength[0] * turn[1] + strength[1] * turn[0]];
        sums[0][i] += if there { echo[0] } else { 0.0 };
        sums[1][i] += if there { echo[1] } else { 0.0 };
    }
}

/// A complex number of mean 0 and mean square 1: in each part the sum of four nibbles.
#[inline(always)]
fn deviate(bits: u32) -> [f32; 2] {
    let pairs = (bits & 0x0f0f_0f0f).wrapping_add(bits >> 4 & 0x0f0f_0f0f);
    let sums = [pairs.wrapping_add(pairs >> 8), (pairs >> 16).wrapping_add(pairs >> 24)];
    sums.map(|sum| (real(sum & 255) - 30.0) * 0.076_696_5)
}
