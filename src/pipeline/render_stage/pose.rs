//! Poses of the tools and scene time of the next frame; all are constant while the picture is frozen.

use std::time::Duration;

use crate::needle::{Needle, NeedleEstimate};
use crate::pipeline::events::Events;
use crate::pipeline::parts::PoseSource;
use crate::pose::{Estimate, Pose, TrackingState};

/// Samples poses for frames, and reports changes of the tracking states.
pub(super) struct PoseSampler {
    poses: Box<dyn PoseSource>,
    events: Events,
    tracking: TrackingState,
    /// Pose of the last picture that was not frozen; none if it had no pose.
    last: Option<Pose>,
    /// Pose of the frozen picture; none while the picture is live.
    frozen: Option<Pose>,
    /// Tracking state of the needle; lost without one.
    needle_tracking: TrackingState,
    /// Needle in the last picture that was not frozen; none before the first.
    last_needle: Option<Option<Needle>>,
    /// Needle in the frozen picture; none while the picture is live.
    frozen_needle: Option<Option<Needle>>,
    /// Scene time of the last picture; none before the first.
    scene_time: Option<Duration>,
}

impl PoseSampler {
    pub(super) fn new(poses: Box<dyn PoseSource>, events: Events) -> Self {
        Self {
            poses,
            events,
            tracking: TrackingState::Lost,
            last: None,
            frozen: None,
            needle_tracking: TrackingState::Lost,
            last_needle: None,
            frozen_needle: None,
            scene_time: None,
        }
    }

    /// The estimates of probe and needle for a frame submitted at `now_ns` and expected on display at `display_ns`, ns since 1970 (UTC).
    pub(super) fn sample(&mut self, now_ns: u64, display_ns: u64, frozen: bool) -> (Estimate, Option<NeedleEstimate>) {
        let mut estimate = self.poses.sample(now_ns, display_ns);
        let mut needle = self.poses.sample_needle(now_ns, display_ns);
        self.events.poses(&estimate, needle.as_ref());
        if let Some(needle) = &mut needle {
            // The probe's report comes last, because viewers see the last one.
            self.report_needle(needle.state);
            needle.needle = self.held_needle(needle.needle, frozen);
        }
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
        (estimate, needle)
    }

    /// The needle in a picture: `live`, or that of the frozen picture.
    fn held_needle(&mut self, live: Option<Needle>, frozen: bool) -> Option<Needle> {
        if frozen {
            return *self.frozen_needle.get_or_insert(self.last_needle.unwrap_or(live));
        }
        self.frozen_needle = None;
        *self.last_needle.insert(live)
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

    fn report_needle(&mut self, state: TrackingState) {
        use TrackingState::{Good, Held, Lost, Stale, Stuck};
        let before = std::mem::replace(&mut self.needle_tracking, state);
        match (before, state) {
            (before, state) if before == state => {}
            (Good | Held | Stuck, Stale) => {
                self.events.warn("the needle's sensor is silent: the picture shows the needle's last pose".to_owned());
            }
            (_, Lost) => self.events.warn("needle lost: the picture goes on without it".to_owned()),
            (_, Stuck) => {
                self.events.warn("the needle's sensor is stuck: it repeats one reading".to_owned());
            }
            (Stuck, Good | Held) => self.events.info("the needle's sensor moves again"),
            (Stale | Lost, Good | Held) => self.events.info("needle tracked"),
            _ => {}
        }
    }
}
