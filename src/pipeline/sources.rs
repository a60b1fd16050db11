//! Poses without a tracker: one that stands still, and those of a recording.

use crate::pose::{Pose, TimedPose, TrackingState};

use super::parts::{PoseSample, PoseSource};

/// Time without a pose after which the last one is held, stale, lost, ns.
const HELD_NS: u64 = 100_000_000;
const STALE_NS: u64 = 300_000_000;
const LOST_NS: u64 = 2_000_000_000;

/// A probe that stands still.
#[derive(Debug, Clone, Copy)]
pub struct StandingPose(pub Pose);

impl PoseSource for StandingPose {
    fn sample(&mut self, _: u64, _: u64) -> PoseSample {
        let scene_from_probe = Some(self.0);
        PoseSample { scene_from_probe, state: TrackingState::Good, first_byte_ns: None, predicted_ms: 0.0 }
    }
}

/// The poses of a recording, each at its time after the first sample. Nothing is predicted or smoothed: a frame has the
/// last pose that a live session would have known.
#[derive(Debug, Clone)]
pub struct RecordedPoses {
    poses: Vec<TimedPose>,
    /// What is added to a recorded time to make it one of the session, once it is known.
    shift_ns: Option<i128>,
    next: usize,
}

impl RecordedPoses {
    /// Of `poses` that ascend in host time.
    pub fn new(poses: Vec<TimedPose>) -> Self {
        Self { poses, shift_ns: None, next: 0 }
    }
}

impl PoseSource for RecordedPoses {
    fn sample(&mut self, now_ns: u64, _: u64) -> PoseSample {
        let first_ns = self.poses.first().map_or(0, |pose| pose.host_time_ns);
        let shift_ns = *self.shift_ns.get_or_insert(i128::from(now_ns) - i128::from(first_ns));
        let session_ns = |pose: &TimedPose| u64::try_from(i128::from(pose.host_time_ns) + shift_ns).unwrap_or(0);
        while self.poses.get(self.next).is_some_and(|pose| session_ns(pose) <= now_ns) {
            self.next += 1;
        }
        let Some(pose) = self.next.checked_sub(1).and_then(|i| self.poses.get(i)) else {
            return PoseSample::default();
        };
        let first_byte_ns = session_ns(pose);
        let state = match now_ns.saturating_sub(first_byte_ns) {
            age if age < HELD_NS => TrackingState::Good,
            age if age < STALE_NS => TrackingState::Held,
            age if age < LOST_NS => TrackingState::Stale,
            _ => TrackingState::Lost,
        };
        let scene_from_probe = (state != TrackingState::Lost).then_some(pose.pose);
        PoseSample { scene_from_probe, state, first_byte_ns: Some(first_byte_ns), predicted_ms: 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_gives_what_was_known_at_each_time() {
        let pose = |ms: u64, x: f64| TimedPose {
            host_time_ns: 77_000_000_000 + ms * 1_000_000,
            device_time_us: 0,
            pose: Pose::from_components([x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).unwrap(),
        };
        let mut poses = RecordedPoses::new(vec![pose(0, 0.0), pose(10, 1.0), pose(20, 2.0)]);
        let start_ns = 5_000_000_000;
        let mut at = |ms: u64| {
            let sample = poses.sample(start_ns + ms * 1_000_000, 0);
            (sample.scene_from_probe.map(|p| p.position_mm.x), sample.state, sample.first_byte_ns.unwrap() - start_ns)
        };
        assert_eq!(at(0), (Some(0.0), TrackingState::Good, 0));
        assert_eq!(at(19), (Some(1.0), TrackingState::Good, 10_000_000));
        assert_eq!(at(130), (Some(2.0), TrackingState::Held, 20_000_000));
        assert_eq!(at(400), (Some(2.0), TrackingState::Stale, 20_000_000));
        assert_eq!(at(2100), (None, TrackingState::Lost, 20_000_000));
        assert_eq!(RecordedPoses::new(Vec::new()).sample(9, 9), PoseSample::default());
    }
}
