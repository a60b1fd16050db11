//! The lateral point-spread function.

use glam::DVec2;

use super::inputs::Inputs;
use crate::render::constants::NEIGHBOUR_GAIN_MAX;

/// Baseband after the beam [scanlines × samples]: each sample is the weighted mean over neighbouring scanlines, with
/// weights renormalised at the sector's edges. Each scanline sees its neighbours' scatterers with the gain of its own
/// aperture. `gains` are the aperture's [scanlines × blocks]; empty without it.
pub fn lateral(inputs: &Inputs, gains: &[f64], baseband: &[DVec2]) -> Vec<DVec2> {
    let mut focused = Vec::with_capacity(baseband.len());
    for line in 0..inputs.scanlines {
        for sample in 0..inputs.samples {
            let block = sample / inputs.depth_block;
            let gain_of = |line: usize| gains.get(line * inputs.blocks() + block);
            let kernel = &inputs.lateral_kernels[block];
            let half = kernel.len() / 2;
            let (mut sum, mut total) = (DVec2::ZERO, 0.0);
            for (tap, &weight) in kernel.iter().enumerate() {
                if let Some(other) = (line + tap).checked_sub(half).filter(|&l| l < inputs.scanlines) {
                    let pair = gain_of(line).zip(gain_of(other));
                    let seen = pair.map_or(1.0, |(own, other)| (own / other).min(NEIGHBOUR_GAIN_MAX));
                    sum += weight * seen * baseband[other * inputs.samples + sample];
                    total += weight;
                }
            }
            focused.push(sum / total);
        }
    }
    focused
}
