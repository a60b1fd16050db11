//! The lateral point-spread function.

use glam::DVec2;

use super::inputs::Inputs;

/// Baseband after the beam [scanlines × samples]: each sample is the weighted mean over neighbouring scanlines, with
/// weights renormalised at the sector's edges.
pub fn lateral(inputs: &Inputs, baseband: &[DVec2]) -> Vec<DVec2> {
    let mut focused = Vec::with_capacity(baseband.len());
    for line in 0..inputs.scanlines {
        for sample in 0..inputs.samples {
            let kernel = &inputs.lateral_kernels[sample / inputs.depth_block];
            let half = kernel.len() / 2;
            let (mut sum, mut total) = (DVec2::ZERO, 0.0);
            for (tap, &weight) in kernel.iter().enumerate() {
                if let Some(other) = (line + tap).checked_sub(half).filter(|&l| l < inputs.scanlines) {
                    sum += weight * baseband[other * inputs.samples + sample];
                    total += weight;
                }
            }
            focused.push(sum / total);
        }
    }
    focused
}
