//! Poses without a tracker.

use super::parts::PoseSource;
use crate::pose::{Estimate, Pose, TrackingState};

/// A stationary probe.
#[derive(Debug, Clone, Copy)]
pub struct StandingPose(pub Pose);

impl PoseSource for StandingPose {
    fn sample(&mut self, _: u64, _: u64) -> Estimate {
        Estimate { scene_from_probe: Some(self.0), state: TrackingState::Good, ..Estimate::default() }
    }
}
