//! Level of a point's echo by its distance from the image plane.

use crate::acoustics::pulse::FWHM_PER_SIGMA;
use crate::transducer::Probe;

/// Two-way elevational profile of a probe's beam.
pub trait ElevationalProfile {
    /// Two-way level of a point `offset_mm` from the image plane at the depth `depth_mm`, relative to the level in the
    /// plane, dB.
    fn level_db(&self, offset_mm: f64, depth_mm: f64) -> f64;
}

impl<F: Fn(f64, f64) -> f64> ElevationalProfile for F {
    fn level_db(&self, offset_mm: f64, depth_mm: f64) -> f64 {
        self(offset_mm, depth_mm)
    }
}

/// Gaussian profile with the width of the probe's beam: −6 dB at half the slice's thickness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussianSlice(pub Probe);

impl ElevationalProfile for GaussianSlice {
    fn level_db(&self, offset_mm: f64, depth_mm: f64) -> f64 {
        let half_mm = 0.5 * FWHM_PER_SIGMA * self.0.elevational_sigma_mm(depth_mm.max(0.0));
        let ratio = offset_mm / half_mm;
        20.0 * 0.5_f64.log10() * ratio * ratio
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exam::score::slice_mm;

    #[test]
    fn the_edge_of_the_slice_is_at_half_the_amplitude() {
        let probe = Probe::default();
        for depth_mm in [10.0, 60.0] {
            let slice = GaussianSlice(probe);
            assert_eq!(slice.level_db(0.0, depth_mm), 0.0);
            let edge_db = slice.level_db(0.5 * slice_mm(&probe, depth_mm), depth_mm);
            assert!((edge_db + 6.02).abs() < 0.01, "{edge_db}");
        }
        let own = |offset_mm: f64, _: f64| -offset_mm;
        assert_eq!(own.level_db(2.0, 0.0), -2.0);
    }
}
