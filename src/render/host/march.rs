//! Scatterers along the paths: complex baseband before the point-spread function.

use rayon::prelude::*;

use super::constants::{DENSITY_ONE, ImageConstants, LN_SCALE, LN_SPECKLE_SILENT, UNSCALED};
use super::speckle::{BLOCK, Block, Lanes, PLACE, SEGMENT, Speckle, Strength};
use super::wide::{at_least, at_most, exp, real, widened};
use crate::render::constants::{HINT_BLOCK, SEGMENTS, STARTS, TAG_DENSITY};
use crate::render::params::Params;

/// Blocks per pass over the paths: their sums stay in the first-level cache.
const CHUNK: usize = 32;
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
    /// Offset, slope, weight and stretch of each elevational layer.
    pub(crate) layers: &'a [[f32; 4]],
    /// Gain of each block of samples.
    pub(crate) gain: &'a [f32],
    /// 1/Y of the sheets for each block of samples; empty for the lattice.
    pub(crate) per_reach_mm: &'a [f32],
}

/// Scatterers' power between the batches of a frame, scaled [scanlines × row_samples].
#[derive(Debug)]
pub(crate) struct Powers<'a> {
    /// Of mean and deviation.
    pub(crate) parts: &'a mut [[f32; 2]],
    /// Both, times the density as a part of 1.
    pub(crate) dense: &'a mut [f32],
}

/// Fills `baseband`, complex [scanlines × row_samples]; the last batch adds to it.
pub(crate) fn march(
    params: &Params,
    paths: Paths<'_>,
    scatterers: Scatterers<'_>,
    baseband: &mut [[f32; 2]],
    powers: Powers<'_>,
) {
    let samples = params.row_samples as usize;
    let powers = powers.parts.par_chunks_exact_mut(samples).zip(powers.dense.par_chunks_exact_mut(samples));
    let rows = baseband.par_chunks_exact_mut(samples).zip(powers).enumerate();
    rows.for_each(|(line, (row, (parts, dense)))| {
        let mut powers = Powers { parts, dense };
        march_row(params, &paths, &scatterers, line as u32, row, &mut powers);
    });
}

widened! {
    /// One scanline.
    fn march_row(
        params: &Params, paths: &Paths<'_>, scatterers: &Scatterers<'_>, line: u32, row: &mut [[f32; 2]],
        powers: &mut Powers<'_>,
    ) = march_row_body
}

#[inline(always)]
fn march_row_body(
    params: &Params,
    paths: &Paths<'_>,
    scatterers: &Scatterers<'_>,
    line: u32,
    row: &mut [[f32; 2]],
    powers: &mut Powers<'_>,
) {
    let begins = params.layer_first == 0;
    let ends = params.layer_first.wrapping_add(params.layer_count) == params.layers;
    // One guide places the scatterers of all paths of a scanline; a single path is its own guide.
    let sounding_paths = if params.guides == 0 { 0 } else { params.sounding_paths(params.layer_count) };
    let guide = sounding_paths.wrapping_add(line);
    let speckle = Speckle::new(params, scatterers.constants);
    let mut power = [[[0.0; BLOCK]; 3]; CHUNK];
    let parts = powers.parts.as_chunks_mut::<BLOCK>().0.chunks_mut(CHUNK);
    let powers = parts.zip(powers.dense.as_chunks_mut::<BLOCK>().0.chunks_mut(CHUNK));
    let chunks = row.as_chunks_mut::<BLOCK>().0.chunks_mut(CHUNK).zip(powers);
    for (chunk, (row, (parts, dense))) in chunks.enumerate() {
        let first = (chunk * CHUNK * BLOCK) as u32;
        for ((power, parts), dense) in power.iter_mut().zip(parts.iter()).zip(dense.iter()) {
            for i in 0..BLOCK {
                let before = [parts[i][0], parts[i][1], dense[i]];
                [power[0][i], power[1][i], power[2][i]] = if begins { [0.0; 3] } else { before };
            }
        }
        // The mean power of all rays sets the scatterers' strength.
        for layer in 0..params.layer_count {
            let of_layer = scatterers.layers.get(params.layer_first.wrapping_add(layer) as usize);
            let weight = of_layer.map_or(0.0, |layer| layer[2]) / params.rays as f32;
            let path = layer.wrapping_mul(params.scanlines).wrapping_add(line).wrapping_mul(params.rays);
            for ray in 0..params.rays {
                accumulate_power(params, paths, path.wrapping_add(ray), weight, first, &mut power[..row.len()]);
            }
        }
        for (i, ((row, parts), dense)) in row.iter_mut().zip(parts).zip(dense).enumerate() {
            let mut sums = [[0.0; BLOCK]; 2];
            if ends {
                let block = chunk * CHUNK + i;
                echo(params, paths, guide, scatterers, &speckle, block, &power[i], &mut sums);
            } else {
                for j in 0..BLOCK {
                    parts[j] = [power[i][0][j], power[i][1][j]];
                    dense[j] = power[i][2][j];
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

/// Adds the echoes of a block's scatterers to `sums`, from the power that all paths send there.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "inputs of one block")]
fn echo(
    params: &Params,
    paths: &Paths<'_>,
    guide: u32,
    scatterers: &Scatterers<'_>,
    speckle: &Speckle,
    block: usize,
    power: &[Lanes; 3],
    sums: &mut [Lanes; 2],
) {
    // Media without scatterers, shadows.
    if power[2].iter().all(|&power| power == 0.0) {
        return;
    }
    let of_block = |table: &[f32]| table.get(block).copied().unwrap_or(0.0);
    let first = (block * BLOCK) as u32;
    let mut ranges_mm = [0.0; BLOCK];
    for (i, range) in ranges_mm.iter_mut().enumerate() {
        *range = range_mm(params, first.wrapping_add(i as u32));
    }
    let block = Block {
        ranges_mm,
        per_reach_mm: of_block(scatterers.per_reach_mm),
        strength: Strength::new(power, UNSCALED * of_block(scatterers.gain)),
    };
    speckle.echo(&block, |view| places(params, paths, guide, first, |segment| view.of(segment)), sums);
}

/// Adds a path's power, times `weight`, in a run of blocks: the scatterers' squared mean, their squared deviation, and
/// both times their density.
#[inline(always)]
fn accumulate_power(params: &Params, paths: &Paths<'_>, path: u32, weight: f32, first: u32, power: &mut [[Lanes; 3]]) {
    let last = first.wrapping_add((power.len() * BLOCK) as u32);
    let mut sample = first;
    while sample < last {
        let (end_mm, segment) = seek(params, paths, path, sample);
        let stop = first_beyond(params, end_mm, sample, last);
        let &[_, _, _, level, _, _, _, fall, mean, deviation, density, _] = segment;
        let density = (density.to_bits() & TAG_DENSITY) as i32;
        // Skips media without scatterers, and inaudible segments.
        if density != 0 && level - fall * range_mm(params, sample) > LN_SPECKLE_SILENT {
            let parts = [weight * mean * mean, weight * deviation * deviation];
            let dense = density as f32 * (1.0 / DENSITY_ONE) * (parts[0] + parts[1]);
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
                let Some([means, deviations, denses]) = power.get_mut(block) else { break };
                for i in 0..BLOCK {
                    let within = (i as i32 >= from) & ((i as i32) < to);
                    let part = if within & (now[i] > SILENT_POWER) { now[i] } else { 0.0 };
                    means[i] += parts[0] * part;
                    deviations[i] += parts[1] * part;
                    denses[i] += dense * part;
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

/// What `of` makes of a path's segments at a block's samples. Two samples share a segment.
#[inline(always)]
fn places(
    params: &Params,
    paths: &Paths<'_>,
    path: u32,
    first: u32,
    of: impl Fn(&[f32; SEGMENT]) -> [f32; PLACE],
) -> [Lanes; PLACE] {
    let (end_mm, segment) = seek(params, paths, path, first);
    let mut lanes = [[0.0; BLOCK]; PLACE];
    if range_mm(params, first.wrapping_add(BLOCK as u32 - 2)) < end_mm {
        for (lane, place) in lanes.iter_mut().zip(of(segment)) {
            *lane = [place; BLOCK];
        }
        return lanes;
    }
    for pair in 0..BLOCK / 2 {
        let segment = seek(params, paths, path, first.wrapping_add(2 * pair as u32)).1;
        for (lane, place) in lanes.iter_mut().zip(of(segment)) {
            lane[2 * pair] = place;
            lane[2 * pair + 1] = place;
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
