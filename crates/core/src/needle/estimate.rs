//! Estimate of the needle's pose at a display time.

use super::Needle;
use crate::pose::{Estimate, TrackingState};

/// Estimate of the needle at a display time. It accompanies its frame from rendering to display.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NeedleEstimate {
    /// Filtered and predicted needle; `None` before the first measurement and while its tracking is lost.
    pub needle: Option<Needle>,
    /// Tracking state of the needle.
    pub state: TrackingState,
    /// Arrival of the newest measurement's first byte, ns since 1970 (UTC); `None` without a tracker.
    pub first_byte_ns: Option<u64>,
    /// Number of measurements so far that became poses.
    pub measurements: u64,
    /// Time by which the pose is predicted beyond the newest measurement, ms.
    pub predicted_ms: f64,
}

impl NeedleEstimate {
    /// Estimate of a tracked needle. `estimate` comes from the estimator of its sensor, whose calibration has the
    /// needle's mounting in place of the probe's.
    pub fn of(estimate: &Estimate, bevel_known: bool) -> Self {
        let &Estimate { scene_from_probe: scene_from_needle, state, first_byte_ns, measurements, predicted_ms, .. } =
            estimate;
        let needle = scene_from_needle.map(|scene_from_needle| Needle { scene_from_needle, bevel_known });
        Self { needle, state, first_byte_ns, measurements, predicted_ms }
    }

    /// Estimate of a needle that stands still.
    pub fn standing(needle: Needle) -> Self {
        Self { needle: Some(needle), state: TrackingState::Good, ..Self::default() }
    }
}
