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
    /// Initial `scene_from_probe` of a puck. Devices that measure only orientation use its position.
    pub initial_pose: Pose,
}
