//! Axial pulse, envelope, TGC and log compression.

use insonify_core::simd::{at_least, at_most, log2, nearest_bits, widened};
use rayon::prelude::*;

use crate::constants::{AXIAL_HALF_MAX, PULSE_PAD, ROW_ALIGN};
use crate::host::constants::ImageConstants;
use crate::params::Params;

/// Complex samples per block, which are convolved together.
const BLOCK: usize = ROW_ALIGN as usize;
/// Most numbers in a block's convolution window.
const WINDOW_MAX: usize = 2 * (BLOCK + 2 * AXIAL_HALF_MAX as usize);
const GREY_MAX: f32 = 65535.0;

/// Gain at each depth, dB: overall gain, TGC and sliders. Kept between frames to reuse the allocation.
#[derive(Debug, Default)]
pub(crate) struct DepthGain(Vec<f32>);

impl DepthGain {
    fn fill(&mut self, params: &Params) {
        let level_db = |sample: u32| {
            let depth_mm = (sample as f32 + 0.5) * params.sample_spacing_mm;
            params.image.gain_db + params.tgc_db_per_mm * depth_mm + slider_db(params, depth_mm)
        };
        self.0.clear();
        self.0.extend((0..params.row_samples).map(level_db));
    }
}

/// Gain of the TGC sliders at a depth, dB, interpolated linearly between the sliders' depths.
fn slider_db(params: &Params, depth_mm: f32) -> f32 {
    let position = (7.0 * depth_mm / params.depth_mm).clamp(0.0, 7.0);
    let below = (position as usize).min(6);
    let [low, high] = [params.image.tgc_sliders_db[below], params.image.tgc_sliders_db[below + 1]];
    low + (high - low) * (position - below as f32)
}

/// Convolves each row of `focused`, complex [scanlines × row_samples], with the pulse's envelope (between PULSE_PAD
/// zeros) and turns its power into grey levels.
///
/// `polar` [scanlines × row_samples] takes one word per sample: the sample's grey level 0..=65535, and its successor's
/// in the upper half. `lines`, unless empty, takes the pulse-shaped baseband.
pub(crate) fn detect(
    params: &Params,
    constants: ImageConstants,
    pulse: &[f32],
    gain: &mut DepthGain,
    focused: &[[f32; 2]],
    polar: &mut [u32],
    lines: &mut [[f32; 2]],
) {
    gain.fill(params);
    let gain = &gain.0[..];
    let pulse = &pulse[PULSE_PAD as usize..][..2 * params.axial_half as usize + 1];
    let stride = params.row_samples as usize;
    let rows = focused.par_chunks_exact(stride).zip(polar.par_chunks_exact_mut(stride));
    if lines.is_empty() {
        rows.for_each(|(row, polar)| detect_row(params, constants, pulse, gain, row.as_flattened(), polar, &mut []));
    } else {
        rows.zip(lines.par_chunks_exact_mut(stride)).for_each(|((row, polar), lines)| {
            detect_row(params, constants, pulse, gain, row.as_flattened(), polar, lines.as_flattened_mut());
        });
    }
}

widened! {
    /// Processes one scanline.
    fn detect_row(
        params: &Params, constants: ImageConstants, pulse: &[f32], gain: &[f32], row: &[f32], polar: &mut [u32],
        lines: &mut [f32],
    ) = detect_row_body
}

#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a row of each buffer")]
fn detect_row_body(
    params: &Params,
    constants: ImageConstants,
    pulse: &[f32],
    gain: &[f32],
    row: &[f32],
    polar: &mut [u32],
    lines: &mut [f32],
) {
    let half = pulse.len() / 2;
    let reach = BLOCK + 2 * half;
    // Samples beyond the row's ends count as 0.
    let row = &row[..2 * params.samples as usize];
    let mut lines = lines.as_chunks_mut::<{ 2 * BLOCK }>().0.iter_mut();
    let blocks = polar.as_chunks_mut::<BLOCK>().0.iter_mut().zip(gain.as_chunks::<BLOCK>().0);
    let per_db = 1.0 / params.image.dynamic_range_db;
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
        let shaped = convolve(pulse, window);
        if let Some(out) = lines.next() {
            *out = shaped;
        }
        for ((out, sample), &gain) in polar.iter_mut().zip(shaped.as_chunks::<2>().0).zip(gain) {
            let power = sample[0] * sample[0] + sample[1] * sample[1];
            // The lower bound of the power is far below any displayed level.
            let level_db = constants.db_a_doubling() * log2(at_least(power, 1.0e-37)) + gain;
            let level = at_most(at_least(1.0 + level_db * per_db, 0.0), 1.0);
            *out = nearest_bits(level * GREY_MAX) & 0xffff;
        }
    }
    // Packs each sample with its successor. The last word's upper half is never read.
    for i in 1..polar.len() {
        polar[i - 1] |= polar[i] << 16;
    }
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
