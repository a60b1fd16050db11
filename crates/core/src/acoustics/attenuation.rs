//! Absorption with distance: α·fʸ, in decibels and nepers.

use super::decibel::NEPER_PER_DB;

/// One-way attenuation of a medium in dB/mm at `frequency_mhz`: α·fʸ/10.
///
/// `coefficient_db_cm_mhz` is the loss at 1 MHz in dB/cm, `exponent` the power y of the frequency.
pub fn attenuation_db_mm(coefficient_db_cm_mhz: f64, exponent: f64, frequency_mhz: f64) -> f64 {
    coefficient_db_cm_mhz * frequency_mhz.powf(exponent) / 10.0
}

/// One-way attenuation of a medium in nepers/mm at `frequency_mhz`.
pub fn attenuation_np_mm(coefficient_db_cm_mhz: f64, exponent: f64, frequency_mhz: f64) -> f64 {
    attenuation_db_mm(coefficient_db_cm_mhz, exponent, frequency_mhz) * NEPER_PER_DB
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_db_at_8_mhz_is_8_db_two_way_a_cm() {
        let two_way_db_cm = 2.0 * attenuation_db_mm(0.5, 1.0, 8.0) * 10.0;
        assert!((two_way_db_cm - 8.0).abs() < 1e-12);
    }
}
