//! Feature vectors of images for the Fréchet distance.

use super::error::{check_holds, check_sizes};
use super::{QualityError, cut};

/// Side of a crop for Inception v3, pixels.
pub const CROP: usize = 299;

/// Extractor of feature vectors; the ONNX implementation is `generator::OnnxFeatures`.
pub trait FeatureExtractor {
    /// Side of its square input crops, pixels.
    fn crop(&self) -> usize;

    /// Features of a square crop [crop × crop] of grey levels. All vectors have the same length.
    ///
    /// # Errors
    /// [`QualityError::Extractor`] if the extractor fails.
    fn features(&mut self, crop: &[u8]) -> Result<Vec<f64>, QualityError>;
}

/// Crops [crop × crop] of an image [height × width] for feature extraction: the image's centre, cut into four. The
/// paper does so with 299, so its centre is 598 × 598 pixels. An image too small for four crops gives one crop at its
/// centre.
///
/// # Errors
/// The image is smaller than a crop, or the number of pixels does not fit the size.
pub fn crops(pixels: &[u8], size: [usize; 2], crop: usize) -> Result<Vec<Vec<u8>>, QualityError> {
    check_sizes(size, &[("image", pixels)])?;
    check_holds(size, crop, "the feature extractor")?;
    let [width, height] = size;
    let across = if width >= 2 * crop && height >= 2 * crop { 2 } else { 1 };
    let (left, top) = ((width - across * crop) / 2, (height - across * crop) / 2);
    let corner = |i: usize| [left + i % across * crop, top + i / across * crop];
    Ok((0..across * across).map(|i| cut(pixels, width, corner(i), crop)).collect())
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
