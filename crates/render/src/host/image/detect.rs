//! Axial pulse, envelope, TGC and log compression.

use insonify_core::simd::{at_least, at_most, log2, nearest_bits, widened};
use rayon::prelude::*;

use crate::constants::{AXIAL_HALF_MAX, PULSE_PAD, ROW_ALIGN};
use crate::host::constants::ImageConstants;
use crate::kernels::Kernels;
use crate::params::Params;

/// Complex samples per block, which are convolved together.
const BLOCK: usize = ROW_ALIGN as usize;
/// Most numbers in a block's convolution window.
const WINDOW_MAX: usize = 2 * (BLOCK + 2 * AXIAL_HALF_MAX as usize);
const GREY_MAX: f32 = 65535.0;

/// Gain of each grey level of a scanline, dB: overall gain, TGC and sliders. Kept between frames to reuse the
/// allocation.
#[derive(Debug, Default)]
pub(crate) struct DepthGain(Vec<f32>);

impl DepthGain {
    fn fill(&mut self, params: &Params) {
        // Sample j is centred at depth (j + ½)·spacing, and its second level lies midway to the next sample.
        let per_sample = params.levels_per_sample as f32;
        let level_db = |level: u32| {
            let depth_mm = (level as f32 / per_sample + 0.5) * params.sample_spacing_mm;
            params.image.gain_db + params.tgc_db_per_mm * depth_mm + slider_db(params, depth_mm)
        };
        self.0.clear();
        self.0.extend((0..params.row_levels()).map(level_db));
    }
}

/// Gain of the TGC sliders at a depth, dB, interpolated linearly between the sliders' depths.
fn slider_db(params: &Params, depth_mm: f32) -> f32 {
    let position = (7.0 * depth_mm / params.depth_mm).clamp(0.0, 7.0);
    let below = (position as usize).min(6);
    let [low, high] = [params.image.tgc_sliders_db[below], params.image.tgc_sliders_db[below + 1]];
    low + (high - low) * (position - below as f32)
}

/// Taps of the pulse's envelope: at the samples, and midway between them.
#[derive(Debug, Clone, Copy)]
struct Pulse<'a> {
    at_samples: &'a [f32],
    /// Empty if the envelope is detected at the samples alone.
    midway: &'a [f32],
}

/// Convolves each row of `focused`, complex [scanlines × row_samples], with the pulse's envelope and turns its power
/// into grey levels.
///
/// `polar` [scanlines × row_levels] takes one word per level: the grey level 0..=65535, and its successor's in the upper
/// half. `lines`, unless empty, takes the pulse-shaped baseband at the samples.
pub(crate) fn detect(
    params: &Params,
    constants: ImageConstants,
    kernels: &Kernels,
    gain: &mut DepthGain,
    focused: &[[f32; 2]],
    polar: &mut [u32],
    lines: &mut [[f32; 2]],
) {
    gain.fill(params);
    let gain = &gain.0[..];
    let taps = 2 * params.axial_half as usize + 1;
    let at_samples = &kernels.pulse[PULSE_PAD as usize..][..taps];
    let midway = if params.levels_per_sample == 2 { &kernels.midway[PULSE_PAD as usize..][..taps] } else { &[] };
    let pulse = Pulse { at_samples, midway };
    let (samples, levels) = (params.row_samples as usize, params.row_levels() as usize);
    let rows = focused.par_chunks_exact(samples).zip(polar.par_chunks_exact_mut(levels));
    if lines.is_empty() {
        rows.for_each(|(row, polar)| detect_row(params, constants, pulse, gain, row.as_flattened(), polar, &mut []));
    } else {
        rows.zip(lines.par_chunks_exact_mut(samples)).for_each(|((row, polar), lines)| {
            detect_row(params, constants, pulse, gain, row.as_flattened(), polar, lines.as_flattened_mut());
        });
    }
}

widened! {
    /// Processes one scanline.
    fn detect_row(
        params: &Params, constants: ImageConstants, pulse: Pulse<'_>, gain: &[f32], row: &[f32], polar: &mut [u32],
        lines: &mut [f32],
    ) = detect_row_body
}

#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a row of each buffer")]
fn detect_row_body(
    params: &Params,
    constants: ImageConstants,
    pulse: Pulse<'_>,
    gain: &[f32],
    row: &[f32],
    polar: &mut [u32],
    lines: &mut [f32],
) {
    let half = pulse.at_samples.len() / 2;
    let reach = BLOCK + 2 * half;
    // Samples beyond the row's ends count as 0.
    let row = &row[..2 * params.samples as usize];
    let mut lines = lines.as_chunks_mut::<{ 2 * BLOCK }>().0.iter_mut();
    let levels = params.levels_per_sample as usize * BLOCK;
    let blocks = polar.chunks_exact_mut(levels).zip(gain.chunks_exact(levels));
    let mut edge = [0.0; WINDOW_MAX];
    for (block, (polar, gain)) in blocks.enumerate() {
        let first = block * BLOCK;
        // The window within the row, or at the row's ends a copy padded with zeros.
        let window = match first.checked_sub(half).and_then(|from| row.get(2 * from..2 * (from + reach))) {
            Some(window) => window,
            None => {
                edge.fill(0.0);
                let before = half.saturating_sub(first);
                let inside =
                    &row[(2 * (first + before - half)).min(row.len())..(2 * (first + half + BLOCK)).min(row.len())];
                edge[2 * before..][..inside.len()].copy_from_slice(inside);
                &edge[..2 * reach]
            }
        };
        let shaped = convolve(pulse.at_samples, window);
        if let Some(out) = lines.next() {
            *out = shaped;
        }
        if pulse.midway.is_empty() {
            let gain = gain.first_chunk::<BLOCK>().unwrap_or(&[0.0; BLOCK]);
            for (out, level) in polar.iter_mut().zip(levels_of(params, constants, &shaped, gain)) {
                *out = level;
            }
        } else {
            // Levels at the samples and midway to the next ones take turns.
            let (mut at_samples, mut midway) = ([0.0; BLOCK], [0.0; BLOCK]);
            for (i, &[at, after]) in gain.as_chunks::<2>().0.iter().enumerate() {
                (at_samples[i], midway[i]) = (at, after);
            }
            let at_samples = levels_of(params, constants, &shaped, &at_samples);
            let midway = levels_of(params, constants, &convolve(pulse.midway, window), &midway);
            for ((out, at), midway) in polar.as_chunks_mut::<2>().0.iter_mut().zip(at_samples).zip(midway) {
                *out = [at, midway];
            }
        }
    }
    // Packs each level with its successor. The last word's upper half is never read.
    for i in 1..polar.len() {
        polar[i - 1] |= polar[i] << 16;
    }
}

/// Grey levels 0..=65535 of complex samples, whose gains are in dB.
#[inline(always)]
fn levels_of(
    params: &Params,
    constants: ImageConstants,
    samples: &[f32; 2 * BLOCK],
    gain: &[f32; BLOCK],
) -> [u32; BLOCK] {
    let per_db = 1.0 / params.image.dynamic_range_db;
    let mut levels = [0; BLOCK];
    for ((out, sample), &gain) in levels.iter_mut().zip(samples.as_chunks::<2>().0).zip(gain) {
        let power = sample[0] * sample[0] + sample[1] * sample[1];
        // The lower bound of the power is far below any displayed level.
        let level_db = constants.db_a_doubling() * log2(at_least(power, 1.0e-37)) + gain;
        let level = at_most(at_least(1.0 + level_db * per_db, 0.0), 1.0);
        *out = nearest_bits(level * GREY_MAX) & 0xffff;
    }
    levels
}

#[inline(always)]
fn convolve(pulse: &[f32], window: &[f32]) -> [f32; 2 * BLOCK] {
    let mut sum = [0.0f32; 2 * BLOCK];
    for (&weight, from) in pulse.iter().zip(window.windows(2 * BLOCK).step_by(2)) {
        for (sum, &value) in sum.iter_mut().zip(from) {
            *sum += weight * value;
        }
    }
    sum
}
