//! Edge enhancement by an unsharp mask.

use insonify_core::simd::widened;

use super::Shape;
use super::blur::{Blur, Columns, each_chunk};

/// Half the width of the window around a pixel, pixels.
pub(super) const HALF: usize = 2;

/// Adds to each pixel `amount` times its difference from the mean of its window.
pub(super) fn enhance(blur: &mut Blur, amount: f32, shape: Shape<'_>, picture: &mut [u8]) {
    blur.rows(shape.width, HALF, shape.mask, picture, |pixels, mask, columns| {
        enhance_row(amount, columns, mask, pixels)
    });
}

widened! {
    /// Enhances one row of pixels.
    fn enhance_row(amount: f32, columns: &Columns, mask: &[u8], pixels: &mut [u8]) = enhance_row_body
}

#[inline(always)]
fn enhance_row_body(amount: f32, columns: &Columns, mask: &[u8], pixels: &mut [u8]) {
    each_chunk::<{ 2 * HALF + 1 }>(columns, mask, pixels, |own, mean, _| own + amount * (own - mean));
}
