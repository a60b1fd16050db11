//! Poses of recordings in a build without the feature `recordings`. None can be read.

use std::convert::Infallible;
use std::path::Path;

use super::RecordingError;
use crate::pose::{Calibration, TimedPose};

/// Poses of a recording.
///
/// # Errors
/// Always: the build lacks the feature `recordings`.
pub fn poses(path: &Path) -> Result<(Vec<TimedPose>, Infallible), RecordingError> {
    Err(RecordingError::NotBuilt { path: path.to_owned() })
}

/// Calibration that brings the poses of a recording into the scene. There is none to ask about.
pub(crate) fn calibration_for(_: &Path, summary: &Infallible, _: Calibration) -> Calibration {
    match *summary {}
}
