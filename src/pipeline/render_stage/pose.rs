//! Pose and scene time of the next frame; both are constant while the picture is frozen.

use std::time::Duration;

use crate::pipeline::events::Events;
use crate::pipeline::parts::PoseSource;
use crate::pose::{Estimate, Pose, TrackingState};

/// Samples poses for frames, and reports changes of the tracking state.
pub(super) struct PoseSampler {
    poses: Box<dyn PoseSource>,
    events: Events,
    tracking: TrackingState,
    /// Pose of the last picture that was not frozen; none if it had no pose.
    last: Option<Pose>,
    /// Pose of the frozen picture; none while the picture is live.
    frozen: Option<Pose>,
    /// Scene time of the last picture; none before the first.
    scene_time: Option<Duration>,
}

impl PoseSampler {
    pub(super) fn new(poses: Box<dyn PoseSource>, events: Events) -> Self {
        Self { poses, events, tracking: TrackingState::Lost, last: None, frozen: None, scene_time: None }
    }

    /// The estimate for a frame submitted at `now_ns` and expected on display at `display_ns`, ns since 1970 (UTC).
    pub(super) fn sample(&mut self, now_ns: u64, display_ns: u64, frozen: bool) -> Estimate {
        let mut estimate = self.poses.sample(now_ns, display_ns);
        self.events.pose(&estimate);
        self.report_change(estimate.state);
        if estimate.state == TrackingState::Lost {
            estimate.scene_from_probe = None;
        }
        if frozen {
            self.frozen = self.frozen.or(self.last).or(estimate.scene_from_probe);
            estimate.scene_from_probe = self.frozen;
        } else {
            self.frozen = None;
            self.last = estimate.scene_from_probe;
        }
        estimate
    }

    /// Scene time of a frame submitted at `now`.
    pub(super) fn scene_time(&mut self, now: Duration, frozen: bool) -> Duration {
        let held = self.scene_time.filter(|_| frozen);
        *self.scene_time.insert(held.unwrap_or(now))
    }

    fn report_change(&mut self, state: TrackingState) {
        use TrackingState::{Good, Held, Lost, Stale, Stuck};
        let before = std::mem::replace(&mut self.tracking, state);
        match (before, state) {
            (before, state) if before == state => {}
            (Good | Held | Stuck, Stale) => {
                self.events.warn("the tracker is silent: the picture no longer follows the probe".to_owned());
            }
            (_, Lost) => self.events.warn("tracking lost".to_owned()),
            (_, Stuck) => self.events.warn(
                "the sensor is stuck: it repeats one reading, and the picture may not follow the probe".to_owned(),
            ),
            (Stuck, Good | Held) => self.events.info("the sensor moves again"),
            (Stale | Lost, Good) => self.events.info("tracking"),
            _ => {}
        }
    }
}
