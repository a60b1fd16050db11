//! Axial pulse, envelope, time-gain compensation and log compression.

use glam::DVec2;
use insonify_core::acoustics::decibel::db_from_amplitude;

use super::inputs::Inputs;

/// Detector output for the focused baseband.
#[derive(Debug, Clone, PartialEq)]
pub struct Detected {
    /// Baseband convolved with the pulse [scanlines × samples].
    pub lines: Vec<DVec2>,
    /// Grey level 0..=255 [scanlines × samples].
    pub grey: Vec<f64>,
}

/// Convolves each line with the pulse's envelope and turns its magnitude into grey levels.
///
/// The reference is fixed: 0 dB, a perfect reflector, is white in every image.
pub fn detect(inputs: &Inputs, focused: &[DVec2]) -> Detected {
    let half = inputs.pulse.len() / 2;
    let mut lines = Vec::with_capacity(focused.len());
    let mut grey = Vec::with_capacity(focused.len());
    for line in focused.chunks_exact(inputs.samples) {
        for sample in 0..inputs.samples {
            let mut sum = DVec2::ZERO;
            for (tap, &weight) in inputs.pulse.iter().enumerate() {
                if let Some(value) = (sample + tap).checked_sub(half).and_then(|at| line.get(at)) {
                    sum += weight * *value;
                }
            }
            let tgc_db = inputs.tgc_db_per_mm * inputs.range_mm(sample) + inputs.slider_db(inputs.range_mm(sample));
            // The device's floor: a power of 10⁻³⁷.
            let level_db = db_from_amplitude(sum.length()).max(-370.0) + f64::from(inputs.image.gain_db) + tgc_db;
            lines.push(sum);
            grey.push(255.0 * (1.0 + level_db / f64::from(inputs.image.dynamic_range_db)).clamp(0.0, 1.0));
        }
    }
    Detected { lines, grey }
}

impl Inputs {
    /// Gain of the eight TGC sliders at a depth, dB: linear between their depths, evenly spaced from 0 to the full
    /// depth.
    pub fn slider_db(&self, depth_mm: f64) -> f64 {
        let position = (7.0 * depth_mm / self.depth_mm).clamp(0.0, 7.0);
        let below = (position as usize).min(6);
        let sliders_db = self.image.tgc_sliders_db.map(f64::from);
        let (low, high) = (sliders_db[below], sliders_db[below + 1]);
        low + (high - low) * (position - below as f64)
    }
}
