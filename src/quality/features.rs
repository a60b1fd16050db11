//! Feature vectors of images for the Fréchet distance.

use super::QualityError;

/// Side of a crop for Inception v3, pixels.
pub const CROP: usize = 299;

/// Makes a feature vector of an image; the ONNX one is `generator::OnnxFeatures`.
pub trait FeatureExtractor {
    /// Side of the square crops that it takes, pixels.
    fn crop(&self) -> usize;

    /// Features of a square crop [crop × crop] of grey levels; every vector has one length.
    ///
    /// # Errors
    /// [`QualityError::Extractor`].
    fn features(&mut self, crop: &[u8]) -> Result<Vec<f64>, QualityError>;
}

/// The crops of an image [height × width] that features are made of, each [crop × crop]: the centre cut into four, as
/// the paper does with 299 (its centre crop of 598 × 598); of an image too small for that, its centre alone.
///
/// # Errors
/// An image smaller than a crop, or whose pixels don't fill it.
pub fn crops(pixels: &[u8], [width, height]: [usize; 2], crop: usize) -> Result<Vec<Vec<u8>>, QualityError> {
    if Some(pixels.len()) != width.checked_mul(height) {
        return Err(QualityError::Size { what: "image", found: pixels.len(), width, height });
    }
    if crop == 0 || width < crop || height < crop {
        return Err(QualityError::TooSmall { metric: "the feature extractor", needed: crop, width, height });
    }
    let across = if width >= 2 * crop && height >= 2 * crop { 2 } else { 1 };
    let (left, top) = ((width - across * crop) / 2, (height - across * crop) / 2);
    let cut = |i: usize| {
        let (left, top) = (left + i % across * crop, top + i / across * crop);
        let rows = pixels.chunks_exact(width).skip(top).take(crop);
        rows.flat_map(|row| &row[left..left + crop]).copied().collect()
    };
    Ok((0..across * across).map(cut).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_centre_is_cut_into_four() {
        let pixels: Vec<u8> = (0..6 * 5).collect();
        let four = crops(&pixels, [6, 5], 2).unwrap();
        assert_eq!(four, [[1, 2, 7, 8], [3, 4, 9, 10], [13, 14, 19, 20], [15, 16, 21, 22]]);
        assert_eq!(crops(&pixels, [6, 5], 3).unwrap(), [[7, 8, 9, 13, 14, 15, 19, 20, 21]]);
        assert!(crops(&pixels, [6, 5], 6).is_err() && crops(&pixels, [6, 5], 0).is_err());
        assert!(crops(&pixels, [7, 5], 2).is_err());
    }
}
