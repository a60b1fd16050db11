//! Tools without a tracker.

use super::parts::PoseSource;
use crate::needle::{Needle, NeedleEstimate};
use crate::pose::{Estimate, Pose, TrackingState};

/// A stationary probe.
#[derive(Debug, Clone, Copy)]
pub struct StandingPose(pub Pose);

impl PoseSource for StandingPose {
    fn sample(&mut self, _: u64, _: u64) -> Estimate {
        Estimate { scene_from_probe: Some(self.0), state: TrackingState::Good, ..Estimate::default() }
    }
}

/// Poses of a source, with a needle that stands still if the source has none.
#[derive(Debug, Clone, Copy)]
pub struct WithStandingNeedle<P> {
    /// Source of the poses.
    pub poses: P,
    /// The needle; none: only the source's needle is shown.
    pub needle: Option<Needle>,
}

impl<P: PoseSource> PoseSource for WithStandingNeedle<P> {
    fn sample(&mut self, now_ns: u64, display_ns: u64) -> Estimate {
        self.poses.sample(now_ns, display_ns)
    }

    fn sample_needle(&mut self, now_ns: u64, display_ns: u64) -> Option<NeedleEstimate> {
        self.poses.sample_needle(now_ns, display_ns).or(self.needle.map(NeedleEstimate::standing))
    }
}
