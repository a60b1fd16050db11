//! The lateral point-spread function: each sample becomes the beam's weighted mean over neighbouring scanlines.

use rayon::prelude::*;

use super::constants::{ImageConstants, NEIGHBOUR_GAIN_MAX};
use super::visibility::BlockGain;
use crate::render::constants::DEPTH_BLOCK;
use crate::render::params::Params;
use crate::simd::{at_most, widened};

/// Numbers in a block of complex samples that share a kernel.
const BLOCK: usize = 2 * DEPTH_BLOCK as usize;
/// Least consecutive scanlines per task: they read the same rows.
const LINES_TOGETHER: usize = 8;

/// Tables of the beam.
#[derive(Debug, Clone, Copy)]
pub(super) struct LateralBeam<'a> {
    pub(super) constants: ImageConstants,
    /// Weights of each block of samples.
    pub(super) kernels: &'a [f32],
    /// Gain of each block [scanlines × blocks]; empty without the aperture.
    pub(super) gains: &'a [BlockGain],
}

/// Focuses `baseband` into `focused`, both complex [scanlines × row_samples]. Each block of samples has a kernel; at
/// the sector's edges the remaining weights are renormalised. Weights below `least_weight` count as 0. Each
/// scanline sees its neighbours' scatterers with the gain of its own aperture.
pub(super) fn lateral(params: &Params, beam: LateralBeam<'_>, baseband: &[[f32; 2]], focused: &mut [[f32; 2]]) {
    let row_samples = params.row_samples as usize;
    let rows = focused.par_chunks_exact_mut(row_samples).enumerate().with_min_len(LINES_TOGETHER);
    rows.for_each(|(line, row)| {
        focus_row(params, beam, line, baseband.as_flattened(), row.as_flattened_mut());
    });
}

widened! {
    /// One scanline.
    fn focus_row(
        params: &Params, beam: LateralBeam<'_>, line: usize, baseband: &[f32], row: &mut [f32],
    ) = focus_row_body
}

#[inline(always)]
fn focus_row_body(params: &Params, beam: LateralBeam<'_>, line: usize, baseband: &[f32], row: &mut [f32]) {
    let LateralBeam { constants, kernels, gains } = beam;
    let half = params.lateral_half as usize;
    let stride = row.len();
    // Taps within the array.
    let from = half.saturating_sub(line);
    let to = (2 * half + 1).min(params.scanlines as usize + half - line);
    let first_line = line + from - half;
    let blocks = row.as_chunks_mut::<BLOCK>().0;
    let block_count = blocks.len();
    for ((block, out), kernel) in blocks.iter_mut().enumerate().zip(kernels.chunks_exact(2 * half + 1)) {
        let weights = &kernel[from..to];
        let mut sum = [0.0f32; BLOCK];
        let mut total = 0.0;
        // Denormal weights are zeros on a GPU, and slow here.
        let some = |weight: &&f32| **weight >= constants.least_weight();
        let skipped = weights.iter().take_while(|w| !some(w)).count();
        let mut at = (first_line + skipped) * stride + block * BLOCK;
        let own = gains.get(line * block_count + block).map_or(1.0, |gain| gain[0]);
        let mut other = (first_line + skipped) * block_count + block;
        for &weight in weights[skipped..].iter().take_while(some) {
            let seen = gains.get(other).map_or(1.0, |gain| at_most(own * gain[1], NEIGHBOUR_GAIN_MAX));
            let seen = weight * seen;
            if let Some(source) = baseband.get(at..).and_then(|rest| rest.first_chunk::<BLOCK>()) {
                for (sum, &value) in sum.iter_mut().zip(source) {
                    *sum += seen * value;
                }
            }
            total += weight;
            at += stride;
            other += block_count;
        }
        let scale = 1.0 / total.max(1.0e-30);
        for (out, &sum) in out.iter_mut().zip(&sum) {
            *out = sum * scale;
        }
    }
}
