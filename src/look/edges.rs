//! Edge enhancement by an unsharp mask.

use super::Shape;
use super::blur::Blur;

/// Half the width of the window, pixels.
pub(super) const HALF: usize = 2;

/// Adds `amount` times the difference from the mean of the window around each pixel.
pub(super) fn enhance(blur: &mut Blur, amount: f32, shape: Shape<'_>, picture: &mut [u8]) {
    let (width, mask) = (shape.width, shape.mask);
    blur.rows(width, HALF, mask, picture, |row, pixels, sums| {
        let mask = &mask[row * width..][..width];
        for ((level, [count, sum, _]), &inside) in pixels.iter_mut().zip(sums).zip(mask) {
            if inside == 0 {
                continue;
            }
            let mean = *sum as f32 / (*count).max(1) as f32;
            let own = f32::from(*level);
            *level = (own + amount * (own - mean) + 0.5).clamp(0.0, 255.0) as u8;
        }
    });
}
