//! Poses of recordings in a build without the feature `recordings`. None can be read.

use std::convert::Infallible;
use std::path::Path;

use super::RecordingError;
use crate::pose::TimedPose;

/// Poses of a recording.
///
/// # Errors
/// Always: the build lacks the feature `recordings`.
pub fn poses(path: &Path) -> Result<(Vec<TimedPose>, Infallible), RecordingError> {
    Err(RecordingError::NotBuilt { path: path.to_owned() })
}
