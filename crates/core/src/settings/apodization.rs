//! Apodization: weights across an aperture.

use serde::Serialize;

use super::stored_word;

/// Standard deviation of the Gaussian weights as a fraction of the aperture's width.
const GAUSSIAN_SIGMA: f64 = 0.3;

/// Weights of an aperture's elements, for transmission and reception.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Apodization {
    /// Equal weights: the narrowest beam, with the highest side lobes.
    Rectangular,
    /// A raised cosine that falls to 0 at the ends: the widest beam, with the lowest side lobes.
    Hann,
    /// A Gaussian with a standard deviation of 0.3 of the aperture's width, cut at the ends.
    #[default]
    Gaussian,
}

crate::names::named!(Apodization { Rectangular = "rectangular", Hann = "hann", Gaussian = "gaussian" });

impl Apodization {
    /// Weight of the element at `position` from the middle, −0.5..=0.5 of the aperture's width; 1 in the middle.
    pub fn weight(self, position: f64) -> f64 {
        match self {
            Self::Rectangular => 1.0,
            Self::Hann => (std::f64::consts::PI * position).cos().powi(2),
            Self::Gaussian => (-0.5 * (position / GAUSSIAN_SIGMA).powi(2)).exp(),
        }
    }
}

stored_word!(Apodization);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Stored as _;

    #[test]
    fn weights_are_one_in_the_middle_and_even() {
        for apodization in Apodization::ALL {
            assert_eq!(apodization.weight(0.0), 1.0, "{apodization:?}");
            assert_eq!(apodization.weight(0.4), apodization.weight(-0.4), "{apodization:?}");
        }
        assert!(Apodization::Hann.weight(0.5) < 1e-30);
        assert!((Apodization::Gaussian.weight(0.3) - (-0.5f64).exp()).abs() < 1e-15);
    }

    #[test]
    fn stored_indices_are_those_of_the_names() {
        for (i, name) in Apodization::NAMES.iter().enumerate() {
            let mut stored = Apodization::default();
            stored.set(0, i as f64);
            assert_eq!((stored.name(), stored.get(0)), (*name, i as f64));
        }
    }
}
