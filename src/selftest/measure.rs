//! Measurements on scanlines: echoes, widths, powers.

use crate::render::Frame;
use crate::transducer::Probe;

/// Magnitude of a complex sample.
pub fn magnitude(sample: [f32; 2]) -> f64 {
    f64::from(sample[0]).hypot(f64::from(sample[1]))
}

/// Complex samples of scanline number `line`; empty if the frame has no lines.
pub fn line<'a>(probe: &Probe, frame: &'a Frame, line: u32) -> &'a [[f32; 2]] {
    let samples = probe.sample_count() as usize;
    frame.lines.get(line as usize * samples..).and_then(|rest| rest.get(..samples)).unwrap_or_default()
}

/// Summed power of a scanline's samples within `half_mm` of `range_mm`.
pub fn power_about(probe: &Probe, frame: &Frame, number: u32, range_mm: f64, half_mm: f64) -> f64 {
    let sample = |mm: f64| (mm / probe.sample_spacing_mm()) as usize;
    let samples = line(probe, frame, number).get(sample(range_mm - half_mm)..sample(range_mm + half_mm));
    samples.unwrap_or_default().iter().map(|[re, im]| f64::from(re * re + im * im)).sum()
}

/// A peak of the envelope.
#[derive(Debug, Clone, Copy)]
pub struct Echo {
    /// Range of the peak sample, mm.
    pub peak_mm: f64,
    /// Envelope at the peak.
    pub amplitude: f64,
    /// Phase at the peak, in turns.
    turns: f64,
    turns_per_mm: f64,
}

impl Echo {
    /// Range of the echo, mm, from its phase. The peak selects the period. `sign` is the sign of the reflection.
    pub fn range_mm(&self, sign: f64) -> f64 {
        let shift = if sign < 0.0 { 0.5 } else { 0.0 };
        // The phase at range z is −turns_per_mm·z.
        let off = -(self.turns - shift) - self.turns_per_mm * self.peak_mm;
        self.peak_mm + (off - off.round()) / self.turns_per_mm
    }
}

/// Local maxima of the envelope above `threshold`, nearest first.
pub fn echoes(probe: &Probe, line: &[[f32; 2]], threshold: f64) -> Vec<Echo> {
    let envelope: Vec<f64> = line.iter().map(|&s| magnitude(s)).collect();
    let peak = |i: usize| {
        let before = if i > 0 { envelope[i - 1] } else { 0.0 };
        let after = envelope.get(i + 1).copied().unwrap_or(0.0);
        envelope[i] > threshold && envelope[i] >= before && envelope[i] > after
    };
    (0..line.len())
        .filter(|&i| peak(i))
        .map(|i| Echo {
            peak_mm: (i as f64 + 0.5) * probe.sample_spacing_mm(),
            amplitude: envelope[i],
            turns: f64::from(line[i][1]).atan2(f64::from(line[i][0])) / std::f64::consts::TAU,
            turns_per_mm: probe.phase_turns_per_mm(),
        })
        .collect()
}

/// Full width at half maximum of a sampled bell curve, in samples. Interpolates the logarithm as a parabola, which is
/// exact for a Gaussian. NaN if a side never falls to half the maximum.
pub fn half_width(values: &[f64]) -> f64 {
    let Some(peak) = (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])) else { return f64::NAN };
    let half = 0.5 * values[peak];
    let side = |outward: &mut dyn Iterator<Item = f64>| {
        let mut inside = values[peak];
        for (value, steps) in outward.zip(1u32..) {
            if value < half {
                // ln of a Gaussian is linear in the squared distance.
                let (d0, d1) = (f64::from(steps - 1), f64::from(steps));
                let part = (half.ln() - inside.ln()) / (value.max(f64::MIN_POSITIVE).ln() - inside.ln());
                return (d0 * d0 + part * (d1 * d1 - d0 * d0)).sqrt();
            }
            inside = value;
        }
        f64::NAN
    };
    side(&mut values[peak + 1..].iter().copied()) + side(&mut values[..peak].iter().rev().copied())
}

/// Mean of the squares of `values`.
pub fn mean_square(values: impl Iterator<Item = f64>) -> f64 {
    let (count, sum) = values.fold((0u32, 0.0), |(n, s), v| (n + 1, s + v * v));
    sum / f64::from(count)
}
