//! Axial pulse, envelope, time-gain compensation and log compression.

use glam::DVec2;
use insonify_core::acoustics::decibel::db_from_amplitude;

use super::inputs::Inputs;

/// Detector output for the focused baseband.
#[derive(Debug, Clone, PartialEq)]
pub struct Detected {
    /// Baseband convolved with the pulse [scanlines × samples].
    pub lines: Vec<DVec2>,
    /// Grey level 0..=255 [scanlines × samples × levels per sample].
    pub grey: Vec<f64>,
}

/// Convolves each line with the pulse's envelope and turns its magnitude into grey levels, at the samples and, if
/// `inputs` have taps for it, midway to the next ones.
///
/// The reference is fixed: 0 dB, a perfect reflector, is white in every image.
pub fn detect(inputs: &Inputs, focused: &[DVec2]) -> Detected {
    let mut lines = Vec::with_capacity(focused.len());
    let mut grey = Vec::with_capacity(focused.len());
    for line in focused.chunks_exact(inputs.samples) {
        for sample in 0..inputs.samples {
            let at_sample = convolved(line, sample, &inputs.pulse);
            lines.push(at_sample);
            grey.push(inputs.grey(at_sample, inputs.range_mm(sample)));
            if !inputs.midway.is_empty() {
                let midway = convolved(line, sample, &inputs.midway);
                grey.push(inputs.grey(midway, inputs.range_mm(sample) + 0.5 * inputs.sample_spacing_mm));
            }
        }
    }
    Detected { lines, grey }
}

/// Weighted sum of the samples around `sample`, with the middle one of `weights` at `sample`. Samples beyond the line's
/// ends count as 0.
fn convolved(line: &[DVec2], sample: usize, weights: &[f64]) -> DVec2 {
    let half = weights.len() / 2;
    let value = |tap: usize| (sample + tap).checked_sub(half).and_then(|at| line.get(at)).copied();
    weights.iter().enumerate().filter_map(|(tap, &weight)| Some(weight * value(tap)?)).sum()
}

impl Inputs {
    /// Grey level of a complex amplitude at a range, 0..=255.
    fn grey(&self, amplitude: DVec2, range_mm: f64) -> f64 {
        let tgc_db = self.tgc_db_per_mm * range_mm + self.slider_db(range_mm);
        // The device's floor: a power of 10⁻³⁷.
        let level_db = db_from_amplitude(amplitude.length()).max(-370.0) + f64::from(self.image.gain_db) + tgc_db;
        255.0 * (1.0 + level_db / f64::from(self.image.dynamic_range_db)).clamp(0.0, 1.0)
    }

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
