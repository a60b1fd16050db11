//! Beam widths against depth: a fixed transmit focus, dynamic receive focus, a fixed elevational lens.

use super::wavelength_mm;

/// −6 dB two-way width of a rectangular aperture at its focus, in λ·F#: 0.886.
///
/// The full width at half maximum of sinc², the two-way field of a rectangular aperture
/// (Szabo, *Diagnostic Ultrasound Imaging*, 2nd ed., section 6).
pub const TWO_WAY_WIDTH_PER_LAMBDA_F: f64 = 0.886;

/// Width of one way of a Gaussian beam whose two ways multiply to [`TWO_WAY_WIDTH_PER_LAMBDA_F`], in λ·F#.
const ONE_WAY_WIDTH_PER_LAMBDA_F: f64 = TWO_WAY_WIDTH_PER_LAMBDA_F * std::f64::consts::SQRT_2;

/// Smallest F-number of the receive aperture: elements are insensitive at steeper angles.
pub const RECEIVE_F_NUMBER_MIN: f64 = 2.0;

/// −6 dB one-way width in mm of an aperture focused at `focus_mm`: a Gaussian beam that is half the aperture wide at
/// the face and diffraction-limited at the focus.
pub fn fixed_focus_width_mm(frequency_mhz: f64, aperture_mm: f64, focus_mm: f64, depth_mm: f64) -> f64 {
    let waist = ONE_WAY_WIDTH_PER_LAMBDA_F * wavelength_mm(frequency_mhz) * focus_mm / aperture_mm;
    let face = (0.5 * aperture_mm).max(waist);
    let growth = ((face / waist).powi(2) - 1.0).max(0.0).sqrt();
    waist * (1.0 + (growth * (depth_mm - focus_mm) / focus_mm).powi(2)).sqrt()
}

/// −6 dB one-way width in mm of a dynamically focused receive aperture that opens to `aperture_mm`.
pub fn dynamic_focus_width_mm(frequency_mhz: f64, aperture_mm: f64, depth_mm: f64) -> f64 {
    let f_number = (depth_mm / aperture_mm).max(RECEIVE_F_NUMBER_MIN);
    ONE_WAY_WIDTH_PER_LAMBDA_F * wavelength_mm(frequency_mhz) * f_number
}

/// −6 dB two-way lateral width in mm: fixed transmit focus times dynamic receive focus, 0.886·λ·F# at the focus.
pub fn lateral_width_mm(frequency_mhz: f64, aperture_mm: f64, focus_mm: f64, depth_mm: f64) -> f64 {
    let transmit = fixed_focus_width_mm(frequency_mhz, aperture_mm, focus_mm, depth_mm);
    let receive = dynamic_focus_width_mm(frequency_mhz, aperture_mm, depth_mm);
    (transmit.powi(-2) + receive.powi(-2)).powf(-0.5)
}

/// −6 dB two-way elevational width in mm of a lens `height_mm` high, focused at `focus_mm` on both ways.
pub fn elevational_width_mm(frequency_mhz: f64, height_mm: f64, focus_mm: f64, depth_mm: f64) -> f64 {
    fixed_focus_width_mm(frequency_mhz, height_mm, focus_mm, depth_mm) / std::f64::consts::SQRT_2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_way_width_at_the_focus_is_0_886_lambda_f() {
        let width = lateral_width_mm(8.0, 20.0, 70.0, 70.0);
        assert!((width - 0.886 * 0.1925 * 3.5).abs() < 1e-9, "{width}");
    }

    #[test]
    fn beam_is_widest_away_from_the_focus() {
        for depth in [1.0, 20.0, 140.0] {
            let at = |z| elevational_width_mm(5.0, 12.0, 60.0, z);
            assert!(at(depth) > at(60.0));
        }
    }
}
