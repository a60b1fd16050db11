//! Weights that place an echo between samples: a fractional-delay filter (Laakso et al., "Splitting the unit delay", IEEE
//! Signal Processing Magazine 13, 1996).
//!
//! An echo is an impulse that the pass `detect` convolves with the pulse. Between two samples, four impulses at the
//! samples around it stand for it. Their weights are those whose pulses differ least, in the mean square, from the pulse
//! at the echo's place, scaled so that the pulse keeps its peak.

use glam::{DMat4, DVec4};

use crate::constants::DELAY_STEPS;

/// Number of samples over which an echo is spread.
pub(crate) const TAPS: usize = 4;
/// Positions of the four samples, relative to the last sample before the echo.
const AT: [f64; TAPS] = [-1.0, 0.0, 1.0, 2.0];

/// Weights for echoes at k/[`DELAY_STEPS`] of the way from one sample to the next, k = 0 to [`DELAY_STEPS`]. `sigma` is
/// the standard deviation of the pulse's envelope, in samples.
pub(crate) fn delay_weights(sigma: f64) -> Vec<[f32; TAPS]> {
    let step = |k: u32| weights(sigma, f64::from(k) / f64::from(DELAY_STEPS)).as_vec4().to_array();
    (0..=DELAY_STEPS).map(step).collect()
}

/// Weights for an echo at the fraction `part` of the way from one sample to the next.
fn weights(sigma: f64, part: f64) -> DVec4 {
    // Inner products of Gaussian pulses at a distance.
    let product = |distance: f64| (-0.25 * (distance / sigma).powi(2)).exp();
    let pulses = DMat4::from_cols_array_2d(&AT.map(|a| AT.map(|b| product(a - b))));
    let weights = pulses.inverse() * DVec4::from_array(AT.map(|a| product(a - part)));
    weights / peak(sigma, weights, part)
}

/// Amplitude at `part` of the pulses at the four samples with these weights.
fn peak(sigma: f64, weights: DVec4, part: f64) -> f64 {
    weights.dot(DVec4::from_array(AT.map(|a| (-0.5 * ((a - part) / sigma).powi(2)).exp())))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Amplitude at `at` of the pulses with the weights for `part`.
    fn amplitude(sigma: f64, part: f64, at: f64) -> f64 {
        peak(sigma, weights(sigma, part), at)
    }

    #[test]
    fn an_echo_at_a_sample_stays_there_and_the_table_is_symmetric() {
        for sigma in [0.5, 0.75, 0.9, 1.0] {
            let table = delay_weights(sigma);
            assert_eq!(table.len(), DELAY_STEPS as usize + 1);
            for (k, weights) in table.iter().enumerate() {
                let [a, b, c, d] = table[table.len() - 1 - k];
                let mirrored = [d, c, b, a];
                assert!(weights.iter().zip(mirrored).all(|(a, b)| (a - b).abs() < 1e-5), "{weights:?}");
            }
            assert!(table[0].iter().zip([0.0, 1.0, 0.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-6), "{:?}", table[0]);
        }
    }

    #[test]
    fn pulses_between_samples_keep_their_place_their_peak_and_nearly_their_width() {
        // Automatic samples are 4/3 standard deviations apart.
        let sigma = 0.75;
        // Distance at which a Gaussian has fallen to a half.
        let half_width = (2.0 * 2f64.ln()).sqrt() * sigma;
        for k in 0..=16 {
            let part = f64::from(k) / 16.0;
            assert!((amplitude(sigma, part, part) - 1.0).abs() < 1e-12);
            let beside = |side: f64| amplitude(sigma, part, part + side * half_width);
            let [before, after] = [-1.0, 1.0].map(beside);
            assert!((before - after).abs() < 0.1, "{part}: {before} {after}");
            assert!((0.49..0.61).contains(&(0.5 * (before + after))), "{part}: {before} {after}");
        }
    }
}
