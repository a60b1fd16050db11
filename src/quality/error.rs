//! Errors of image metrics.

use thiserror::Error;

/// Reason why a metric has no value.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum QualityError {
    /// Wrong number of pixels for the image's size.
    #[error("the {what} has {found} pixels; an image of {width} x {height} has {}", width * height)]
    Size {
        /// Map with the wrong size.
        what: &'static str,
        /// Pixels given.
        found: usize,
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
    },
    /// An image without pixels.
    #[error("the image is {width} x {height}; it must have a pixel at least")]
    NoPixels {
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
    },
    /// A mask without a pixel inside.
    #[error("the mask is 0 everywhere; it must have a pixel inside (any other value)")]
    EmptyMask,
    /// An image smaller than the metric's window.
    #[error("{metric} needs an image of {needed} x {needed} at least, this one is {width} x {height}")]
    TooSmall {
        /// Metric.
        metric: &'static str,
        /// Pixels needed in both directions.
        needed: usize,
        /// Pixels across.
        width: usize,
        /// Pixels down.
        height: usize,
    },
    /// A mask in which no patch has half of its pixels.
    #[error("no patch of {patch} x {patch} pixels has half of its pixels inside the mask: there is nothing to compare")]
    NoPatch {
        /// Side of a patch, pixels.
        patch: usize,
    },
    /// Too few feature vectors for a covariance.
    #[error("{found} feature vectors; a covariance needs 2 at least")]
    FewFeatures {
        /// Vectors given.
        found: usize,
    },
    /// Too few frames of a sequence.
    #[error("{found} frames; steadiness needs 2 at least")]
    FewFrames {
        /// Frames given.
        found: usize,
    },
    /// Feature vectors of different lengths, or empty ones.
    #[error("a feature vector has {found} values where {expected} are expected")]
    FeatureLength {
        /// Values found.
        found: usize,
        /// Values expected.
        expected: usize,
    },
    /// A feature that is not finite.
    #[error("value {index} of a feature vector is not finite")]
    NotFinite {
        /// Index in its vector.
        index: usize,
    },
    /// Features so large that their distance is not finite.
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
