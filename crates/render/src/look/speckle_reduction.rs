//! Speckle reduction by local statistics: Lee, "Digital image enhancement and noise filtering by use of local
//! statistics", IEEE Trans Pattern Anal Mach Intell 2:165 (1980).

use insonify_core::simd::{at_least, widened};

use super::Shape;
use super::blur::{Blur, Columns, each_chunk};

/// Half the width of the window around a pixel, pixels.
pub(super) const HALF: usize = 3;
/// Standard deviation of fully developed speckle in log-compressed grey levels, dB (Rayleigh): 10·π/(√6·ln 10).
pub(super) const SPECKLE_DB: f64 = 5.570_082;

/// Variance of speckle, grey levels squared: variance of a single picture over the number of independent pictures in
/// the mean.
pub(super) fn variance_of_speckle(shape: Shape<'_>) -> f64 {
    (SPECKLE_DB * 255.0 / shape.dynamic_range_db).powi(2) / shape.independent_angles.max(1.0)
}

/// The filter, with its working memory.
#[derive(Debug, Default)]
pub(super) struct SpeckleReduction {
    blur: Blur,
}

impl SpeckleReduction {
    /// Filters a picture in place. Each pixel becomes a weighted mean of its level and its window's mean. The weight of
    /// the window's mean is the ratio of speckle variance to the window's variance, at most 1. `strength` (0..=1)
    /// blends the filtered picture with the original.
    pub(super) fn apply(&mut self, strength: f32, shape: Shape<'_>, picture: &mut [u8]) {
        let filter = Filter { strength, variance_of_speckle: variance_of_speckle(shape) as f32 };
        self.blur.rows(shape.width, HALF, shape.mask, picture, |pixels, mask, columns| {
            filter_row(filter, columns, mask, pixels);
        });
    }
}

#[derive(Debug, Clone, Copy)]
struct Filter {
    strength: f32,
    variance_of_speckle: f32,
}

widened! {
    /// Filters one row of pixels.
    fn filter_row(filter: Filter, columns: &Columns, mask: &[u8], pixels: &mut [u8]) = filter_row_body
}

#[inline(always)]
fn filter_row_body(filter: Filter, columns: &Columns, mask: &[u8], pixels: &mut [u8]) {
    let Filter { strength, variance_of_speckle } = filter;
    each_chunk::<{ 2 * HALF + 1 }>(columns, mask, pixels, |own, mean, mean_square| {
        let variance = at_least(mean_square - mean * mean, 0.0);
        let kept = at_least(variance - variance_of_speckle, 0.0) / at_least(variance, 1.0e-3);
        let filtered = mean + kept * (own - mean);
        own + strength * (filtered - own)
    });
}
