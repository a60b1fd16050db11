//! Additions of the receiver to the focused lines: noise, clutter near the face, and reverberation where the face is
//! not coupled.

use glam::DVec2;

use super::inputs::Inputs;
use super::segment::Path;
use super::{hash, lattice};

/// The focused baseband with noise, clutter and reverberation [scanlines × samples].
pub fn receive(inputs: &Inputs, paths: &[Path], focused: &[DVec2]) -> Vec<DVec2> {
    let mut received = focused.to_vec();
    for (line, row) in received.chunks_exact_mut(inputs.samples).enumerate() {
        // ln of the two-way amplitude that the face passes. Reverberation is the part that stays in the probe.
        let ln_passed = paths[inputs.axial_path_of(line)].segments[0].ln_passed_at_zero;
        let near = inputs.near_field.iter().skip(line * inputs.near_samples).take(inputs.near_samples);
        for (sample, [reverberation, clutter]) in row.iter_mut().zip(near) {
            *sample += (1.0 - (0.5 * ln_passed).exp()) * inputs.reverberation * *reverberation;
            *sample += ln_passed.exp() * inputs.clutter * *clutter;
        }
        for (i, sample) in row.iter_mut().enumerate() {
            let [bits, ..] = hash::pcg3d([i as u32, line as u32, inputs.noise_seed]);
            *sample += inputs.noise * lattice::scatterer_deviate(bits);
        }
    }
    received
}
