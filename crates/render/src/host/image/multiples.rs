//! Multiples: echoes that the face reflects back into the body, and that return again.

use insonify_core::simd::widened;
use rayon::prelude::*;

use crate::constants::{MULTIPLE_FIRST, MULTIPLE_GAIN_MAX, MULTIPLE_SAMPLES};
use crate::host::constants::ImageConstants;
use crate::params::Params;

const FIRST: usize = MULTIPLE_FIRST as usize;
const MOST: usize = MULTIPLE_SAMPLES as usize;
/// Samples that are computed together.
const GROUP: usize = 16;
const _: () = assert!(FIRST.is_multiple_of(GROUP), "the first group has no part that returns");

/// Size of the working memory, complex numbers.
pub(in crate::host) fn working_samples(params: &Params) -> u64 {
    u64::from(params.scanlines) * (u64::from(params.row_samples) + GROUP as u64)
}

/// Adds multiples to `focused`, complex [scanlines × row_samples]. `again` is working memory of
/// [`working_samples`].
pub(in crate::host) fn multiples(
    params: &Params,
    constants: ImageConstants,
    again: &mut [[f32; 2]],
    focused: &mut [[f32; 2]],
) {
    let (length, samples) = (params.row_samples as usize, params.samples as usize);
    let face_reflection = constants.face_reflected() * params.face_reflection;
    let rows = focused.par_chunks_exact_mut(length).zip(again.par_chunks_exact_mut(length + GROUP));
    rows.for_each(|(row, again)| of_line(face_reflection, again.as_flattened_mut(), &mut row[..samples]));
}

widened! {
    /// Adds the multiples of a scanline. `again` has two numbers for each sample and for [`GROUP`] more.
    fn of_line(face_reflection: f32, again: &mut [f32], row: &mut [[f32; 2]]) = of_line_body
}

#[inline(always)]
fn of_line_body(face_reflection: f32, again: &mut [f32], row: &mut [[f32; 2]]) {
    let (again_re, again_im) = again.split_at_mut(row.len() + GROUP);
    let weakest = weakest(row, again_re);
    for zeros in [&mut *again_re, &mut *again_im] {
        zeros[..GROUP].fill(0.0);
    }
    let strong = Strong::of(row, weakest);
    let sum = strong.sum();
    let reflection =
        if face_reflection * sum > MULTIPLE_GAIN_MAX as f32 { MULTIPLE_GAIN_MAX as f32 / sum } else { face_reflection };
    // No echo nearer than `FIRST` samples returns again, so groups of samples depend on earlier ones alone.
    for first in (0..row.len()).step_by(GROUP) {
        let count = GROUP.min(row.len() - first);
        let [re, im] = returned(&strong, [again_re, again_im], first);
        for i in 0..count {
            let echo = row[first + i];
            let part = if first < FIRST { [0.0; 2] } else { strong_part(echo, weakest) };
            let whole = [echo[0] + reflection * re[i], echo[1] + reflection * im[i]];
            row[first + i] = whole;
            again_re[GROUP + first + i] = whole[0] + (echo[0] - part[0]);
            again_im[GROUP + first + i] = whole[1] + (echo[1] - part[1]);
        }
    }
}

/// Sum over the strong echoes of what returns again at the samples from `first` on. `again` has the parts of the earlier
/// samples, after [`GROUP`] zeros.
#[inline(always)]
fn returned(strong: &Strong, [again_re, again_im]: [&[f32]; 2], first: usize) -> [[f32; GROUP]; 2] {
    let [mut re, mut im] = [[0.0f32; GROUP]; 2];
    for (&at, &[a, b]) in strong.at.iter().zip(&strong.amplitude).take(strong.count) {
        // Sample i lies i + ½ samples deep, so depths of the samples j and k add up to that of sample j + k + 1.
        let Some(from) = (GROUP + first).checked_sub(at + 1) else { break };
        let parts = (again_re[from..].first_chunk::<GROUP>(), again_im[from..].first_chunk::<GROUP>());
        let (Some(x), Some(y)) = parts else { break };
        for i in 0..GROUP {
            re[i] += a * x[i] - b * y[i];
            im[i] += a * y[i] + b * x[i];
        }
    }
    [re, im]
}

/// Samples whose echoes return again, in their order.
struct Strong {
    count: usize,
    at: [usize; MOST],
    /// The part of the amplitude that returns again.
    amplitude: [[f32; 2]; MOST],
}

impl Strong {
    #[inline(always)]
    fn of(row: &[[f32; 2]], weakest: u32) -> Self {
        let mut strong = Self { count: 0, at: [0; MOST], amplitude: [[0.0; 2]; MOST] };
        for (i, &echo) in row.iter().enumerate().skip(FIRST) {
            if power(echo).to_bits() > weakest && strong.count < MOST {
                strong.at[strong.count] = i;
                strong.amplitude[strong.count] = strong_part(echo, weakest);
                strong.count += 1;
            }
        }
        strong
    }

    /// Sum of the amplitudes that return again.
    #[inline(always)]
    fn sum(&self) -> f32 {
        self.amplitude.iter().map(|&amplitude| power(amplitude).sqrt()).sum()
    }
}

#[inline(always)]
fn power([re, im]: [f32; 2]) -> f32 {
    re * re + im * im
}

/// The part of an echo that returns again. It falls to zero at the power with the bits `weakest`, so that a sample that is
/// no longer strong leaves no step.
#[inline(always)]
fn strong_part(echo: [f32; 2], weakest: u32) -> [f32; 2] {
    let power = power(echo);
    if power.to_bits() <= weakest {
        return [0.0; 2];
    }
    let part = 1.0 - f32::from_bits(weakest) / power;
    echo.map(|x| x * part)
}

/// Bits of the largest power that more than [`MOST`] samples reach. Powers are positive, so their bits are in the same
/// order. `powers` is working memory, one number a sample.
#[inline(always)]
fn weakest(row: &[[f32; 2]], powers: &mut [f32]) -> u32 {
    let samples = row.get(FIRST..).unwrap_or_default();
    for (kept, &echo) in powers.iter_mut().zip(samples) {
        *kept = power(echo);
    }
    let powers = &powers[..samples.len()];
    let mut weakest = 0u32;
    for bit in (0..31).rev() {
        let raised = weakest | 1 << bit;
        let above: u32 = powers.iter().map(|power| u32::from(power.to_bits() >= raised)).sum();
        if above > MULTIPLE_SAMPLES {
            weakest = raised;
        }
    }
    weakest
}
