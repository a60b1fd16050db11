//! Poses of recordings in a build without the feature `recordings`. None can be read.

use std::convert::Infallible;
use std::path::Path;

use insonify_core::pose::{Calibration, TimedPose};

use super::RecordingError;

/// Poses of a recording.
///
/// # Errors
/// Always: the build lacks the feature `recordings`.
pub fn poses(path: &Path) -> Result<(Vec<TimedPose>, Infallible), RecordingError> {
    Err(RecordingError::NotBuilt { path: path.to_owned() })
}

/// Calibration that converts the poses of a recording to the scene. This build can't read any recording.
pub fn calibration_for(_: &Path, summary: &Infallible, _: Calibration) -> Calibration {
    match *summary {}
}
