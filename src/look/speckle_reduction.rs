//! Speckle reduction by local statistics: Lee, "Digital image enhancement and noise filtering by use of local
//! statistics", IEEE Trans Pattern Anal Mach Intell 2:165 (1980).

use super::Shape;
use super::blur::Blur;

/// Half the width of the window, pixels.
pub(super) const HALF: usize = 3;
/// Standard deviation of fully developed speckle in log-compressed grey levels, dB (Rayleigh): 10·π/(√6·ln 10).
pub(super) const SPECKLE_DB: f64 = 5.570_082;

/// Memory of the filter.
#[derive(Debug, Default)]
pub(super) struct SpeckleReduction {
    blur: Blur,
}

impl SpeckleReduction {
    /// Filters a picture. Each pixel moves towards the mean of its window, the more the less the window varies beyond
    /// what speckle does. `strength` 0..=1 blends the filtered picture with the original.
    pub(super) fn apply(&mut self, strength: f32, shape: Shape<'_>, picture: &mut [u8]) {
        let speckle = (SPECKLE_DB * 255.0 / shape.dynamic_range_db) as f32;
        let variance_of_speckle = speckle * speckle;
        let (width, mask) = (shape.width, shape.mask);
        self.blur.rows(width, HALF, mask, picture, |row, pixels, sums| {
            let mask = &mask[row * width..][..width];
            for ((level, sums), &inside) in pixels.iter_mut().zip(sums).zip(mask) {
                if inside == 0 {
                    continue;
                }
                let [count, sum, squares] = sums.map(|sum| sum as f32);
                let mean = sum / count.max(1.0);
                let variance = (squares / count.max(1.0) - mean * mean).max(0.0);
                let kept = (variance - variance_of_speckle).max(0.0) / variance.max(1.0e-3);
                let own = f32::from(*level);
                let filtered = mean + kept * (own - mean);
                *level = (own + strength * (filtered - own) + 0.5) as u8;
            }
        });
    }
}
