//! Decorrelation of speckle when the probe slides across its slice, by diffraction of the elevational lens.
//!
//! The lens is a cylinder with the same focus for transmission and reception. Its two-way field across the slice is p =
//! b², where b is its one-way field. For uncorrelated scatterers, the complex scanlines before and after a slide by d
//! have the correlation ρ(d) = |∫p(y)·p*(y + d)dy| / ∫|p|²dy. The integral is the Fourier transform of the power
//! spectrum of p.

use std::f64::consts::{PI, TAU};

use super::wavelength_mm;

/// Largest number of plane waves in the one-way field, and largest number of sample positions on the lens.
const WAVES_MAX: f64 = 256.0;
const POSITIONS_MAX: f64 = 1024.0;
/// Number of diffraction lobes that the lens's angular spectrum keeps outside the cone from the focus to the edges.
const LOBES: f64 = 8.0;
/// Number of sample positions on the lens per period of its highest spatial frequency.
const POSITIONS_PER_PERIOD: f64 = 8.0;
/// Margin on each side of the beam, mm. It separates the beam from its periodic images in the sampled field.
const MARGIN_MM: f64 = 2.0;

/// A cylindrical lens across the slice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Frequency, MHz.
    pub frequency_mhz: f64,
    /// Height, mm.
    pub height_mm: f64,
    /// Focal depth, mm.
    pub focus_mm: f64,
}

impl Lens {
    /// Length of a slide that decorrelates speckle at the focus, mm: λ·F/H. F is the distance from the focus to an edge
    /// of the lens, and H is the lens's height.
    pub fn scale_mm(&self) -> f64 {
        wavelength_mm(self.frequency_mhz) * self.focus_mm.hypot(0.5 * self.height_mm) / self.height_mm
    }

    /// Half width of the beam at a depth, including four diffraction lobes, mm.
    fn half_width_mm(&self, depth_mm: f64) -> f64 {
        let cone = 0.5 * self.height_mm * (1.0 - depth_mm / self.focus_mm).abs().max(0.2);
        cone + 4.0 * depth_mm * wavelength_mm(self.frequency_mhz) / self.height_mm
    }

    /// Correlation of speckle before and after a slide [depths × slides], 0..=1. `weight` is the lens's apodization at
    /// a position of −½..½ of its height.
    ///
    /// The field is a sum of at most 256 plane waves. If a beam is too wide for them, a smaller depth is used: far from
    /// the focus, the correlation no longer depends on depth.
    pub fn slide_correlation(
        &self,
        weight: impl Fn(f64) -> f64,
        depths_mm: &[f64],
        slides_mm: &[f64],
    ) -> Vec<Vec<f64>> {
        let k = TAU / wavelength_mm(self.frequency_mhz);
        let steepest = 0.5 * self.height_mm / self.focus_mm.hypot(0.5 * self.height_mm);
        let q_max = (k * steepest + LOBES * TAU / self.height_mm).min(k);
        let period_max_mm = WAVES_MAX * PI / q_max;
        let near = |mut depth_mm: f64| {
            while 2.0 * (self.half_width_mm(depth_mm) + MARGIN_MM) > period_max_mm && depth_mm > 1.0e-3 {
                depth_mm *= 0.8;
            }
            depth_mm
        };
        let depths_mm: Vec<f64> = depths_mm.iter().map(|&z| near(z)).collect();
        let widest = depths_mm.iter().map(|&z| self.half_width_mm(z)).fold(0.0, f64::max);
        let dq = TAU / (2.0 * (widest + MARGIN_MM)).min(period_max_mm);
        let half = (q_max / dq).floor() as i32;
        let spectrum = self.spectrum(&weight, k, dq, half);
        // The two-way field p has twice the bandwidth of the one-way field b.
        let turned: Vec<Vec<[f64; 2]>> = slides_mm
            .iter()
            .map(|d| (-2 * half..=2 * half).map(|j| (f64::from(j) * dq * d).sin_cos().into()).collect())
            .collect();
        let at_depth = |depth_mm: f64| {
            let power = power_of_square(&propagated(&spectrum, k, dq, half, depth_mm));
            let total: f64 = power.iter().sum();
            let correlation = |turned: &Vec<[f64; 2]>| {
                let sum = power.iter().zip(turned).fold([0.0; 2], |s, (p, t)| [s[0] + p * t[0], s[1] + p * t[1]]);
                sum[0].hypot(sum[1]) / total
            };
            turned.iter().map(correlation).collect()
        };
        depths_mm.into_iter().map(at_depth).collect()
    }

    /// Complex amplitudes [re, im] of 2·`half` + 1 plane waves at the lens. Their spatial frequencies are `dq` apart;
    /// `k` is the wave number, rad/mm.
    fn spectrum(&self, weight: &impl Fn(f64) -> f64, k: f64, dq: f64, half: i32) -> Vec<[f64; 2]> {
        let q_max = dq * f64::from(half);
        let positions = (POSITIONS_PER_PERIOD * self.height_mm * q_max / TAU).clamp(32.0, POSITIONS_MAX).ceil() as u32;
        let positions = (0..positions).map(|i| {
            let part = (f64::from(i) + 0.5) / f64::from(positions) - 0.5;
            let y = part * self.height_mm;
            // Phase of the focusing delay, −k·(√(y² + F²) − F), in a form without cancellation.
            (y, weight(part), -k * y * y / (y.hypot(self.focus_mm) + self.focus_mm))
        });
        let positions: Vec<_> = positions.collect();
        let wave = |j: i32| {
            let q = f64::from(j) * dq;
            positions.iter().fold([0.0; 2], |[re, im], &(y, weight, phase)| {
                let (sin, cos) = (phase - q * y).sin_cos();
                [re + weight * cos, im + weight * sin]
            })
        };
        (-half..=half).map(wave).collect()
    }
}

/// Complex amplitudes of the plane waves of `spectrum` after propagation over `depth_mm`.
fn propagated(spectrum: &[[f64; 2]], k: f64, dq: f64, half: i32, depth_mm: f64) -> Vec<[f64; 2]> {
    let waves = (-half..=half).zip(spectrum);
    waves
        .map(|(j, &[re, im])| {
            let q = f64::from(j) * dq;
            let axial = (k * k - q * q).max(0.0).sqrt();
            let (sin, cos) = (-q * q / (axial + k) * depth_mm).sin_cos();
            [re * cos - im * sin, re * sin + im * cos]
        })
        .collect()
}

/// Power spectrum of a field's square, from the amplitudes of the field's plane waves.
fn power_of_square(waves: &[[f64; 2]]) -> Vec<f64> {
    let mut square = vec![[0.0; 2]; 2 * waves.len() - 1];
    for (i, a) in waves.iter().enumerate() {
        for (sum, b) in square[i..].iter_mut().zip(waves) {
            sum[0] += a[0] * b[0] - a[1] * b[1];
            sum[1] += a[0] * b[1] + a[1] * b[0];
        }
    }
    square.into_iter().map(|[re, im]| re * re + im * im).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gaussian weight at a position of −½..½ of the lens's height: σ is 0.3 of the height.
    fn gaussian_weight(part: f64) -> f64 {
        (-0.5 * (part / 0.3).powi(2)).exp()
    }

    /// Correlations at 8 MHz and depths of 20, 70 and 140 mm, and at 5 MHz and 70 mm.
    const REFERENCE: [[f64; 9]; 4] = [
        [0.996, 0.984, 0.965, 0.939, 0.871, 0.691, 0.445, 0.234, 0.036],
        [0.997, 0.990, 0.977, 0.959, 0.910, 0.768, 0.550, 0.342, 0.082],
        [0.997, 0.987, 0.970, 0.947, 0.884, 0.705, 0.437, 0.193, 0.066],
        [0.999, 0.996, 0.990, 0.982, 0.961, 0.895, 0.779, 0.641, 0.367],
    ];

    #[test]
    fn correlations_are_those_of_the_reference_program() {
        // Values of `elevation.py --height 12 --focus 70`.
        let slides = [0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5];
        let cases = [
            (8.0, 20.0, REFERENCE[0]),
            (8.0, 70.0, REFERENCE[1]),
            (8.0, 140.0, REFERENCE[2]),
            (5.0, 70.0, REFERENCE[3]),
        ];
        for (frequency_mhz, depth, want) in cases {
            let lens = Lens { frequency_mhz, height_mm: 12.0, focus_mm: 70.0 };
            let found = lens.slide_correlation(gaussian_weight, &[depth], &slides).remove(0);
            for ((slide, want), found) in slides.iter().zip(want).zip(found) {
                assert!(
                    (found - want).abs() < 0.01,
                    "{frequency_mhz} MHz, {depth} mm, {slide} mm: {found}, not {want}"
                );
            }
        }
    }

    #[test]
    fn any_lens_has_a_correlation() {
        for frequency_mhz in [0.5, 5.0, 40.0] {
            for height_mm in [0.5, 12.0, 100.0] {
                for focus_mm in [1.0, 70.0, 1000.0] {
                    let lens = Lens { frequency_mhz, height_mm, focus_mm };
                    for row in
                        lens.slide_correlation(gaussian_weight, &[0.0, 30.0, 500.0], &[0.0, 0.3 * lens.scale_mm()])
                    {
                        assert!((row[0] - 1.0).abs() < 1e-9 && row[1].is_finite() && row[1] <= 1.0, "{lens:?} {row:?}");
                    }
                }
            }
        }
    }
}
