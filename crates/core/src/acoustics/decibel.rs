//! Decibels of amplitude, and nepers.

use std::f64::consts::LN_10;

/// Nepers in one decibel of amplitude: ln(10)/20.
pub const NEPER_PER_DB: f64 = LN_10 / 20.0;

/// An amplitude ratio in dB; zero and below give −∞.
pub fn db_from_amplitude(amplitude: f64) -> f64 {
    if amplitude > 0.0 { 20.0 * amplitude.log10() } else { f64::NEG_INFINITY }
}
