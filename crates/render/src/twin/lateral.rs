//! The lateral point-spread function.

use glam::DVec2;

use super::inputs::Inputs;
use super::profiles::Profile;
use super::visibility::BlockGain;
use crate::constants::NEIGHBOUR_GAIN_MAX;

/// Baseband after the lateral point-spread function [scanlines × samples]: each sample is a weighted sum over
/// neighbouring scanlines.
///
/// Beyond the array's ends, a beam with an aperture receives a mirror image of the tissue inside, a quarter of a cycle
/// later. Without the aperture, the weights inside are scaled to the sum of all.
///
/// Each scanline sees its neighbours' scatterers with the gain of its own aperture. It receives their echoes of reflected
/// paths with the kernel's weight, times reflected power over the greater of reflected and aperture power. The greater
/// of this weight and the weight by the gain applies.
///
/// `gains` and `reflected` are [scanlines × blocks], `profiles` [planes × scanlines]; all are empty without the
/// aperture.
pub fn lateral(
    inputs: &Inputs,
    gains: &[BlockGain],
    reflected: &[f64],
    profiles: &[Profile],
    baseband: &[DVec2],
) -> Vec<DVec2> {
    let by_reflections = |at: usize| (gains[at].gain * reflected[at]).min(1.0);
    let mut focused = Vec::with_capacity(baseband.len());
    for line in 0..inputs.scanlines {
        for block in 0..inputs.blocks() {
            let gain_of = |line: usize| gains.get(line * inputs.blocks() + block);
            let projection = inputs.projection(line);
            let unwidened_power = inputs.lateral_kernels[block].iter().map(|w| w * w).sum::<f64>();
            let kernel = &widened(&inputs.lateral_kernels[block], projection);
            let weights = weights(inputs, kernel, line, gain_of(line).map_or(0.0, |gain| gain.position), profiles);
            let half = kernel.len() / 2;
            let within = |tap: usize| (line + tap).checked_sub(half).filter(|&l| l < inputs.scanlines);
            let shown = |&(tap, _): &(usize, f64)| !gains.is_empty() || within(tap).is_some();
            let taps: Vec<(usize, f64)> = weights.iter().copied().enumerate().filter(shown).collect();
            let total: f64 = taps.iter().map(|(_, weight)| weight).sum();
            let power: f64 = taps.iter().map(|(_, weight)| weight * weight).sum();
            let whole: f64 = kernel.iter().map(|w| w * w).sum();
            let scale = if gains.is_empty() {
                // Speckle amplitude with the whole kernel, relative to the kernel on the array's normal.
                let level = (whole / unwidened_power).sqrt() / kernel.iter().sum::<f64>();
                1.0 / (total * level)
            } else {
                (unwidened_power / power.max(0.5 * unwidened_power)).sqrt()
            };
            let first = block * inputs.depth_block;
            for sample in first..(first + inputs.depth_block).min(inputs.samples) {
                let at = |line: usize| line * inputs.blocks() + block;
                let received = |weight: f64, kernel: f64, other: usize| {
                    let (reflected, carried) = (by_reflections(other), gains[other].gain.max(by_reflections(other)));
                    let by_gain = weight * (gains[at(line)].gain / carried).min(NEIGHBOUR_GAIN_MAX);
                    // Reflected echoes keep the power of the kernel.
                    let kernel = kernel * (unwidened_power / whole).sqrt();
                    (scale * by_gain).max(kernel * (reflected / carried).powi(2))
                };
                let echo_of = |&(tap, weight): &(usize, f64)| {
                    let other = within(tap).unwrap_or_else(|| mirrored(line + tap, half, inputs.scanlines));
                    let weight =
                        if gains.is_empty() { scale * weight } else { received(weight, kernel[tap], at(other)) };
                    let echo = steered(inputs, baseband, other, sample, tap as f64 - half as f64);
                    weight * if within(tap).is_some() { echo } else { echo.perp() }
                };
                focused.push(taps.iter().map(echo_of).sum::<DVec2>());
            }
        }
    }
    focused
}

/// Index of the scanline whose mirror image is at `at` − `half`, beyond the array's ends. No kernel is wider than the
/// array.
fn mirrored(at: usize, half: usize, scanlines: usize) -> usize {
    if at < half { half - at - 1 } else { 2 * scanlines - 1 - (at - half) }
}

/// The kernel, stretched by 1/`projection`: the aperture's projected width makes a wider beam.
fn widened(kernel: &[f64], projection: f64) -> Vec<f64> {
    let half = kernel.len() / 2;
    let weight = |tap: usize| {
        let position = tap.abs_diff(half) as f64 * projection;
        let at = |lines: f64| kernel.get(half + lines as usize).copied().unwrap_or(0.0);
        at(position.floor()) * (1.0 - position.fract()) + at(position.floor() + 1.0) * position.fract()
    };
    (0..kernel.len()).map(weight).collect()
}

/// Weights of a scanline's neighbours at `position`, a fractional index of the depth planes.
fn weights(inputs: &Inputs, kernel: &[f64], line: usize, position: f64, profiles: &[Profile]) -> Vec<f64> {
    let planes = profiles.len() / inputs.scanlines;
    if planes == 0 {
        return kernel.to_vec();
    }
    let position = position.clamp(0.0, (planes - 1) as f64);
    let low = (position as usize).min(planes.saturating_sub(2));
    let part = position - low as f64;
    let [a, b] = [low, (low + 1).min(planes - 1)].map(|plane| &profiles[plane * inputs.scanlines + line]);
    let mix = |a: f64, b: f64| (1.0 - part) * a + part * b;
    let pairs = a.weights.iter().zip(&b.weights);
    kernel.iter().zip(pairs).map(|(kernel, (&of_a, &of_b))| mix(a.kept, b.kept) * kernel + mix(of_a, of_b)).collect()
}

/// Sample of the scanline `other` on the steered wavefront through `sample`, turned to the phase of `sample`. `lines`
/// is the number of scanlines from the focused one to `other`.
fn steered(inputs: &Inputs, baseband: &[DVec2], other: usize, sample: usize, lines: f64) -> DVec2 {
    let later_mm = lines * inputs.steer_shift_mm;
    let shift = (later_mm / inputs.sample_spacing_mm + 0.5).floor() as isize;
    let at = sample.checked_add_signed(-shift).filter(|&at| at < inputs.samples);
    let value = at.map_or(DVec2::ZERO, |at| baseband[other * inputs.samples + at]);
    value.rotate(DVec2::from_angle(-std::f64::consts::TAU * inputs.phase_turns_per_mm * later_mm))
}
