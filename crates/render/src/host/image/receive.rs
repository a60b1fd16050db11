//! Additions of the receiver to the focused lines: noise, clutter near the face, and reverberation where the face is
//! not coupled.

use insonify_core::simd::{at_least, exp, pcg3d, widened};
use rayon::prelude::*;

use crate::host::constants::{ImageConstants, LN_UNCOUPLED};
use crate::host::paths::Paths;
use crate::host::scatter::speckle::deviate;
use crate::params::Params;

/// Adds noise, clutter and reverberation to `focused`, complex [scanlines × row_samples]. `near` holds reverberation
/// and clutter of the samples near the face, complex [scanlines × near_samples]. `params` and `paths` belong to the
/// last batch.
pub(in crate::host) fn receive(
    params: &Params,
    constants: ImageConstants,
    paths: Paths<'_>,
    near: &[[f32; 4]],
    focused: &mut [[f32; 2]],
) {
    let rows = focused.par_chunks_exact_mut(params.row_samples as usize).enumerate();
    rows.for_each(|(line, row)| {
        let near_samples = params.near_samples as usize;
        if near_samples > 0 {
            let near = &near[line * near_samples..][..near_samples];
            // ln of the two-way amplitude that the face passes. Reverberation is the part that stays in the probe.
            let [first, ..] = paths.of(params.axial_path_of(line as u32) as usize).1 else { return };
            let coupled = exp(at_least(first.ln_passed_at_zero, LN_UNCOUPLED));
            let uncoupled = 1.0 - exp(0.5 * at_least(first.ln_passed_at_zero, 2.0 * LN_UNCOUPLED));
            let parts = [uncoupled * params.reverberation, coupled * params.clutter];
            add_near(near, parts.map(|part| constants.added() * part), row);
        }
        if params.noise > 0.0 {
            add_noise(params, line as u32, constants.added() * params.noise, row);
        }
    });
}

/// Adds reverberation and clutter with their amplitudes.
fn add_near(near: &[[f32; 4]], [reverberation, clutter]: [f32; 2], row: &mut [[f32; 2]]) {
    for (sample, near) in row.iter_mut().zip(near) {
        sample[0] += reverberation * near[0] + clutter * near[2];
        sample[1] += reverberation * near[1] + clutter * near[3];
    }
}

widened! {
    /// Adds white noise.
    fn add_noise(params: &Params, line: u32, amplitude: f32, row: &mut [[f32; 2]]) = add_noise_body
}

#[inline(always)]
fn add_noise_body(params: &Params, line: u32, amplitude: f32, row: &mut [[f32; 2]]) {
    // By index: the overflow check of a zipped range keeps the loop scalar.
    for (i, sample) in row.iter_mut().enumerate() {
        let [re, im] = deviate(pcg3d([i as u32, line, params.noise_seed])[0]);
        sample[0] += amplitude * re;
        sample[1] += amplitude * im;
    }
}
