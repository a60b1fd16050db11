//! Poses without a tracker.

use crate::pose::{Pose, TrackingState};

use super::parts::{PoseSample, PoseSource};

/// A probe that stands still.
#[derive(Debug, Clone, Copy)]
pub struct StandingPose(pub Pose);

impl PoseSource for StandingPose {
    fn sample(&mut self, _: u64, _: u64) -> PoseSample {
        let scene_from_probe = Some(self.0);
        PoseSample { scene_from_probe, state: TrackingState::Good, first_byte_ns: None, predicted_ms: 0.0 }
    }
}
