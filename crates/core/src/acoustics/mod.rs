//! Formulas of linear acoustics: pure f64 functions without state.

pub mod attenuation;
pub mod beam;
pub mod decibel;
pub mod interface;
pub mod pulse;
pub mod slide;

/// Speed of sound that a scanner assumes when it converts time to depth, m/s.
pub const ASSUMED_SPEED_M_S: f64 = 1540.0;
/// Deviation of c/c₀ from 1 beyond which a medium counts as hard: bone, gas, stone, metal. Sound that images tissue
/// behind a hard body has travelled past it, so the body neither bends nor delays it.
pub const HARD_SPEED: f64 = 0.15;

/// Characteristic impedance of a medium in MRayl, from kg/m³ and m/s.
pub fn impedance_mrayl(density_kg_m3: f64, speed_m_s: f64) -> f64 {
    density_kg_m3 * speed_m_s * 1e-6
}

/// Wavelength in mm at the assumed speed.
pub fn wavelength_mm(frequency_mhz: f64) -> f64 {
    ASSUMED_SPEED_M_S * 1e-3 / frequency_mhz
}
