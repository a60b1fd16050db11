//! The transmitted pulse: a Gaussian envelope on a carrier.

use super::ASSUMED_SPEED_M_S;

/// Full width at half maximum of a Gaussian, in standard deviations: 2·√(2 ln 2).
pub const FWHM_PER_SIGMA: f64 = 2.354_820_045_030_949_3;

/// Standard deviation of the pulse-echo envelope of a Gaussian pulse, in mm of depth.
///
/// `fractional_bandwidth` is the two-way −6 dB bandwidth over the centre frequency (0..2). The amplitude spectrum is
/// Gaussian with FWHM B = fractional_bandwidth·f, so σ_t = FWHM_PER_SIGMA/(2πB), and depth is c₀t/2.
pub fn axial_sigma_mm(frequency_mhz: f64, fractional_bandwidth: f64) -> f64 {
    let bandwidth_mhz = fractional_bandwidth * frequency_mhz;
    let sigma_us = FWHM_PER_SIGMA / (std::f64::consts::TAU * bandwidth_mhz);
    0.5 * ASSUMED_SPEED_M_S * 1e-3 * sigma_us
}
