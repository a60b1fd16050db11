//! Errors of image metrics.

use thiserror::Error;

/// Reason why a metric has no value.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum QualityError {
    /// The number of pixels does not fit the image's size.
    #[error("the {what} has {found} pixels; an image of {width} x {height} has {}", width * height)]
    Size {
        /// Name of the map with the wrong size.
        what: &'static str,
        /// Number of pixels given.
        found: usize,
        /// Width of the image, pixels.
        width: usize,
        /// Height of the image, pixels.
        height: usize,
    },
    /// The image has no pixels.
    #[error("the image is {width} x {height}; it must have a pixel at least")]
    NoPixels {
        /// Width of the image, pixels.
        width: usize,
        /// Height of the image, pixels.
        height: usize,
    },
    /// The mask has no pixel inside.
    #[error("the mask is 0 everywhere; it must have a pixel inside (any other value)")]
    EmptyMask,
    /// The image is smaller than the metric's window.
    #[error("{metric} needs an image of {needed} x {needed} at least, this one is {width} x {height}")]
    TooSmall {
        /// Name of the metric.
        metric: &'static str,
        /// Number of pixels needed in both directions.
        needed: usize,
        /// Width of the image, pixels.
        width: usize,
        /// Height of the image, pixels.
        height: usize,
    },
    /// No patch has at least half of its pixels inside the mask.
    #[error("no patch of {patch} x {patch} pixels has half of its pixels inside the mask: there is nothing to compare")]
    NoPatch {
        /// Side of a patch, pixels.
        patch: usize,
    },
    /// There are too few feature vectors for a covariance.
    #[error("{found} feature vectors; a covariance needs 2 at least")]
    FewFeatures {
        /// Number of vectors given.
        found: usize,
    },
    /// There are too few frames in a sequence.
    #[error("{found} frames; steadiness needs 2 at least")]
    FewFrames {
        /// Number of frames given.
        found: usize,
    },
    /// Feature vectors are empty, or have different lengths.
    #[error("a feature vector has {found} values where {expected} are expected")]
    FeatureLength {
        /// Number of values in the vector.
        found: usize,
        /// Number of values expected.
        expected: usize,
    },
    /// A feature is not finite.
    #[error("value {index} of a feature vector is not finite")]
    NotFinite {
        /// Index of the feature in its vector.
        index: usize,
    },
    /// Features are so large that their distance is not finite.
    #[error("the distance of the features is not finite: their values are too large")]
    NoDistance,
    /// The extractor failed.
    #[error("the feature extractor failed: {reason}")]
    Extractor {
        /// Message of the extractor.
        reason: String,
    },
}

/// Checks that each map fills an image of size [width, height].
pub(super) fn check_sizes([width, height]: [usize; 2], maps: &[(&'static str, &[u8])]) -> Result<(), QualityError> {
    match maps.iter().find(|(_, map)| Some(map.len()) != width.checked_mul(height)) {
        Some((what, map)) => Err(QualityError::Size { what, found: map.len(), width, height }),
        None => Ok(()),
    }
}

/// Checks that an image holds a square of `side` pixels, at least 1.
pub(super) fn check_holds([width, height]: [usize; 2], side: usize, metric: &'static str) -> Result<(), QualityError> {
    if side > 0 && width >= side && height >= side {
        return Ok(());
    }
    Err(QualityError::TooSmall { metric, needed: side.max(1), width, height })
}
