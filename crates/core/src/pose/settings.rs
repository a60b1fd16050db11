//! Settings of the pose estimator.

use super::{Calibration, Pose};
pub use crate::settings::FilterSettings;

/// Settings of an [`Estimator`](super::Estimator).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Settings {
    /// Filter, prediction, tracking states.
    pub filter: FilterSettings,
    /// Calibration of tracker, sensor and probe.
    pub calibration: Calibration,
    /// `scene_from_probe` at which a puck starts. Its position is used for devices that measure only orientation.
    pub initial_pose: Pose,
}
