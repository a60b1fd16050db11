//! Frame rates of videos.

use super::SinkError;

/// Frames per second as a fraction, as video containers store it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRate {
    /// Number of frames in `denominator` seconds.
    pub numerator: u32,
    /// Duration of `numerator` frames, s.
    pub denominator: u32,
}

impl FrameRate {
    /// The rate nearest to `fps` in steps of 0.001 Hz, in lowest terms.
    ///
    /// # Errors
    /// `fps` outside 0.1..=1000, NaN included.
    pub fn new(fps: f64) -> Result<Self, SinkError> {
        if !(0.1..=1000.0).contains(&fps) {
            return Err(SinkError::FrameRate { fps });
        }
        let thousandths = (fps * 1000.0).round() as u32;
        let (mut a, mut b) = (thousandths, 1000);
        while b != 0 {
            (a, b) = (b, a % b);
        }
        Ok(Self { numerator: thousandths / a, denominator: 1000 / a })
    }

    /// Frames per second.
    pub fn fps(self) -> f64 {
        f64::from(self.numerator) / f64::from(self.denominator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frame_rates_are_in_lowest_terms() {
        let pair = |fps| FrameRate::new(fps).map(|r| (r.numerator, r.denominator));
        assert_eq!(pair(15.0).unwrap(), (15, 1));
        assert_eq!(pair(29.97).unwrap(), (2997, 100));
        assert_eq!(pair(0.1).unwrap(), (1, 10));
        for fps in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
            assert!(pair(fps).is_err(), "{fps}");
        }
    }
}
