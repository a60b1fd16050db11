//! Data of a frame in addition to its pixels: pose, times, settings and faults.

use std::time::Duration;

use crate::needle::NeedleEstimate;
use crate::pose::{Estimate, Pose, TrackingState};
use crate::settings::LiveSettings;
use crate::transducer::{Contact, Misplacement};

/// Times at which a frame passed each stage, since the start of the session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameTimeline {
    /// Arrival of the first byte of the tracker record that gave the pose; none without a tracker.
    pub first_byte: Option<Duration>,
    /// Sampling of the pose.
    pub sampled: Duration,
    /// Submission of the render.
    pub submitted: Duration,
    /// Arrival of the rendered frame in memory.
    pub rendered: Duration,
    /// Start and end of the generator's run; none if none ran on this frame.
    pub inference: Option<(Duration, Duration)>,
    /// Handover to the sinks.
    pub presented: Duration,
}

/// Measurements that a presented frame is the first to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NewMeasurements {
    /// Number of measurements; 0 without a tracker.
    pub count: u64,
    /// Time at which the previous presented frame was sampled; all these measurements arrived after it.
    pub after: Duration,
    /// Arrival of the first byte of the previous presented frame's newest measurement; none if it showed none.
    pub before: Option<Duration>,
    /// Arrival of the first byte of the measurement that was held back until a second one confirmed a jump; none
    /// without a new jump.
    pub jump: Option<Duration>,
}

/// Data of a frame in addition to its pixels; each stage completes its part.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameInfo {
    /// Number among all frames that were begun, from 0.
    pub number: u64,
    /// Pose estimate of the picture; without a picture its pose is `None`.
    pub estimate: Estimate,
    /// Estimate of the needle in the picture, frozen with it; none in sessions without a needle.
    pub needle: Option<NeedleEstimate>,
    /// Times at which the frame passed the stages so far.
    pub timeline: FrameTimeline,
    /// Measurements that no earlier frame showed; completed by the presenter.
    pub new: NewMeasurements,
    /// Settings with which the frame is rendered.
    pub settings: LiveSettings,
    /// Contact of the probe's face with the skin; none without the effect `contact`, or without a picture.
    pub contact: Option<Contact>,
    /// Impossible placement of the probe, if it has lasted for seconds.
    pub misplaced: Option<Misplacement>,
}

impl FrameInfo {
    /// `scene_from_probe` of the picture; none before the first pose.
    pub fn pose(&self) -> Option<Pose> {
        self.estimate.scene_from_probe
    }

    /// Latency of the newest measurement: time from its first byte to the handover to the sinks. Without a tracker,
    /// the time starts at the sampling of the pose. None without a new measurement, and for held, stuck, stale and
    /// frozen poses, whose age is no latency.
    pub fn pose_to_present(&self) -> Option<Duration> {
        let FrameTimeline { first_byte, sampled, presented, .. } = self.timeline;
        let is_new = first_byte.is_none() || (self.new.count > 0 && self.estimate.state == TrackingState::Good);
        let from = first_byte.unwrap_or(sampled);
        (is_new && self.is_live()).then(|| presented.saturating_sub(from))
    }

    /// Latency of each measurement that the frame is the first to show: time from its first byte to the handover. It
    /// includes the wait for the tick and, after a jump, for its confirmation. First bytes are assumed evenly spaced,
    /// from the newest one of the last frame on. After a silence of the tracker they are spaced from the last frame's
    /// sampling on. Empty without a tracker.
    pub fn motion_to_present(&self) -> impl Iterator<Item = Duration> + use<> {
        let Self { new, timeline: FrameTimeline { presented, .. }, .. } = *self;
        let first_byte = self.timeline.first_byte.filter(|_| self.pose_to_present().is_some());
        let count = u32::try_from(new.count).unwrap_or(u32::MAX);
        let even = first_byte.into_iter().flat_map(move |newest| {
            // All new measurements arrived after the last frame's sampling, even if `before` is much older.
            let since_sampling = newest.saturating_sub(new.after);
            let step = match new.before {
                Some(before) => {
                    (newest.saturating_sub(before) / count.max(1)).min(since_sampling / count.saturating_sub(1).max(1))
                }
                None => since_sampling / count.max(1),
            };
            (0..count).map(move |nth| presented.saturating_sub(newest.saturating_sub(step * nth)))
        });
        even.chain(self.jump_to_present().filter(|_| first_byte.is_some()))
    }

    /// Latency of a jump: time from the first byte of the measurement that first showed it to the handover. It
    /// includes the wait for the measurement that confirmed it, and for the tick. None without a new jump.
    pub fn jump_to_present(&self) -> Option<Duration> {
        self.new.jump.filter(|_| self.is_live()).map(|from| self.timeline.presented.saturating_sub(from))
    }

    /// Whether the picture shows the sampled pose.
    fn is_live(&self) -> bool {
        !self.settings.frozen && self.estimate.scene_from_probe.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// Times from each of `count` measurements to a frame presented at 1000 ms, ms.
    fn motion_ms(count: u64, after: Duration, before: Option<Duration>, newest: Duration) -> Vec<f64> {
        let estimate =
            Estimate { scene_from_probe: Some(Pose::IDENTITY), state: TrackingState::Good, ..Estimate::default() };
        let timeline = FrameTimeline { first_byte: Some(newest), presented: 1000 * MS, ..FrameTimeline::default() };
        let new = NewMeasurements { count, after, before, jump: None };
        let info = FrameInfo { estimate, timeline, new, ..FrameInfo::default() };
        info.motion_to_present().map(|time| (1e3 * time.as_secs_f64()).round()).collect()
    }

    #[test]
    fn measurements_are_spaced_since_the_one_before_them() {
        // A measurement every 10 ms; the last frame was sampled just before the next measurement arrived.
        assert_eq!(motion_ms(3, 919 * MS, Some(910 * MS), 940 * MS), [60.0, 70.0, 80.0]);
        assert_eq!(motion_ms(3, 910 * MS, Some(910 * MS), 940 * MS), [60.0, 70.0, 80.0]);
        assert_eq!(motion_ms(1, 919 * MS, Some(910 * MS), 920 * MS), [80.0]);
        // After a silence, and in the first frame, only the time of sampling is known.
        assert_eq!(motion_ms(3, 920 * MS, Some(100 * MS), 940 * MS), [60.0, 70.0, 80.0]);
        assert_eq!(motion_ms(2, 920 * MS, None, 940 * MS), [60.0, 70.0]);
    }

    #[test]
    fn each_of_many_measurements_counts() {
        let times = motion_ms(400, 100 * MS, Some(100 * MS), 500 * MS);
        assert_eq!(times, (500_u32..900).map(f64::from).collect::<Vec<f64>>());
        assert!(motion_ms(0, 100 * MS, Some(100 * MS), 500 * MS).is_empty());
    }
}
