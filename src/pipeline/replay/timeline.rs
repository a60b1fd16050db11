//! A recording's poses, resampled at the times of a video's frames.

use super::ReplayError;
use crate::needle::Needle;
use crate::pipeline::replayed::{ReplayedNeedle, ReplayedPoses};
use crate::pose::{Pose, TimedPose, TrackingState, interpolate};
use crate::recording::GAP_NS;
use crate::settings::LiveSettings;
use crate::sink::FrameRate;

/// Poses at evenly spaced times.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Timeline {
    /// Pose of each frame; the previous frame's pose if the pose is unknown.
    pub poses: Vec<Pose>,
    /// Needle in each frame; `None` where it is unknown, and without a needle.
    pub needles: Vec<Option<Needle>>,
    /// Whether the pose of the needle was known at each frame's time. An earlier one may be held.
    needles_known: Vec<bool>,
    /// Host time of each frame, ns.
    pub times_ns: Vec<u64>,
    /// Host time of the scene shown in each frame, ns; held while the picture is frozen.
    scene_times_ns: Vec<u64>,
    /// Host time of scene time 0, ns.
    scene_start_ns: u64,
    /// Whether an earlier pose was held for each frame, because the pose at the frame's time was unknown.
    held: Vec<bool>,
}

/// Poses for one frame.
struct Sample {
    /// Pose of the probe; `None` if it is unknown.
    pose: Option<Pose>,
    /// Whether the pose of the probe is known at the frame's time.
    known: bool,
    /// The needle; `None` if it is unknown, or without a needle.
    needle: Option<Needle>,
    /// Whether the pose of the needle is known at the frame's time, and not held.
    needle_known: bool,
}

/// Largest number of frames of a session: 28 hours at ten per second.
const FRAMES_MAX: u128 = 1_000_000;

impl Timeline {
    /// Samples `poses` from the first to the last at `rate`.
    ///
    /// # Errors
    /// Times that span too many frames.
    pub fn new(poses: &[TimedPose], rate: FrameRate) -> Result<Self, ReplayError> {
        let (Some(first), Some(last)) = (poses.first(), poses.last()) else { return Ok(Self::default()) };
        Self::sampled(first.host_time_ns, last.host_time_ns, rate, |time_ns| {
            let pose = interpolate(poses, time_ns, GAP_NS);
            Sample { pose, known: pose.is_some(), needle: None, needle_known: false }
        })
    }

    /// Samples the poses of probe and needle that a live session would have known, from `first_ns` to `last_ns` at
    /// `rate`. The first frame has the first pose of the probe.
    ///
    /// # Errors
    /// Times that span too many frames.
    pub fn replayed(
        poses: &mut ReplayedPoses,
        mut needle: Option<ReplayedNeedle>,
        first_ns: u64,
        last_ns: u64,
        rate: FrameRate,
    ) -> Result<Self, ReplayError> {
        Self::sampled(first_ns, last_ns, rate, |time_ns| {
            let estimate = poses.at(time_ns);
            let is_known = |state| matches!(state, TrackingState::Good | TrackingState::Stuck);
            let needle = needle.as_mut().map(|needle| needle.at(time_ns));
            Sample {
                pose: estimate.scene_from_probe,
                known: is_known(estimate.state),
                needle: needle.and_then(|needle| needle.needle),
                needle_known: needle.is_some_and(|needle| is_known(needle.state)),
            }
        })
    }

    /// The same timeline with a needle that stands still in all frames.
    #[must_use]
    pub fn with_standing_needle(mut self, needle: Needle) -> Self {
        self.needles.fill(Some(needle));
        self.needles_known.fill(true);
        self
    }

    /// Samples `at` at `rate`. Refuses more than `FRAMES_MAX` frames, which usually mean a wrong clock.
    fn sampled(
        first_ns: u64,
        last_ns: u64,
        rate: FrameRate,
        mut at: impl FnMut(u64) -> Sample,
    ) -> Result<Self, ReplayError> {
        let span_ns = u128::from(last_ns.saturating_sub(first_ns));
        let frames = span_ns * u128::from(rate.numerator) / (u128::from(rate.denominator) * 1_000_000_000);
        if frames > FRAMES_MAX {
            return Err(ReplayError::Span {
                span_s: span_ns as f64 * 1e-9,
                frames,
                frames_max: FRAMES_MAX,
                fps: rate.fps(),
            });
        }
        let mut timeline = Self { scene_start_ns: first_ns, ..Self::default() };
        for frame in 0u64.. {
            let offset_ns =
                u128::from(frame) * u128::from(rate.denominator) * 1_000_000_000 / u128::from(rate.numerator);
            let Some(time_ns) = u64::try_from(offset_ns).ok().and_then(|o| first_ns.checked_add(o)) else {
                break;
            };
            if time_ns > last_ns {
                break;
            }
            let Sample { pose, known, needle, needle_known } = at(time_ns);
            if let Some(pose) = pose.or(timeline.poses.last().copied()) {
                timeline.held.push(!known);
                timeline.poses.push(pose);
                timeline.needles.push(needle);
                timeline.needles_known.push(needle_known);
                timeline.times_ns.push(time_ns);
                timeline.scene_times_ns.push(time_ns);
            }
        }
        Ok(timeline)
    }

    /// Sets scene time 0 to the session's start, `start_ns`; the default is the first frame.
    #[must_use]
    pub fn since(mut self, start_ns: u64) -> Self {
        self.scene_start_ns = start_ns;
        self
    }

    /// Holds the poses of probe and needle and the scene time in frozen frames; `live` has the settings of each frame.
    pub fn freeze(&mut self, live: &[LiveSettings]) {
        let mut last = None;
        let frames = self.poses.iter_mut().zip(&mut self.needles).zip(&mut self.scene_times_ns);
        for (((pose, needle), time_ns), live) in frames.zip(live) {
            if live.frozen {
                (*pose, *needle, *time_ns) = last.unwrap_or((*pose, *needle, *time_ns));
            }
            last = Some((*pose, *needle, *time_ns));
        }
    }

    /// Number of frames in the range `frames` with a held (earlier) pose.
    pub fn held_in(&self, frames: std::ops::Range<usize>) -> usize {
        self.held.get(frames).unwrap_or_default().iter().filter(|held| **held).count()
    }

    /// Whether an earlier pose was held for a frame, because the pose at the frame's time was unknown.
    pub(crate) fn is_held(&self, frame: usize) -> bool {
        self.held.get(frame).copied().unwrap_or_default()
    }

    /// Whether the pose of the needle was known at a frame's time, and not held.
    pub(crate) fn is_needle_known(&self, frame: usize) -> bool {
        self.needles_known.get(frame).copied().unwrap_or_default()
    }

    /// Time of a frame since the first pose, s.
    pub fn seconds(&self, frame: usize) -> f64 {
        match (self.times_ns.first(), self.times_ns.get(frame)) {
            (Some(first), Some(time)) => (time - first) as f64 * 1e-9,
            _ => 0.0,
        }
    }

    /// Scene time of a frame, s.
    pub fn scene_s(&self, frame: usize) -> f64 {
        let time_ns = self.scene_times_ns.get(frame).copied().unwrap_or_default();
        time_ns.saturating_sub(self.scene_start_ns) as f64 * 1e-9
    }

    /// Index of the frame nearest to a host time.
    pub fn nearest(&self, time_ns: u64) -> usize {
        let after = self.times_ns.partition_point(|&t| t < time_ns);
        let candidates = [after.saturating_sub(1), after.min(self.times_ns.len().saturating_sub(1))];
        let distance = |i: &usize| self.times_ns.get(*i).map_or(u64::MAX, |t| t.abs_diff(time_ns));
        candidates.into_iter().min_by_key(distance).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(ms: u64, x: f64) -> TimedPose {
        let pose = Pose::from_components([x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
        TimedPose { host_time_ns: 5_000_000_000 + ms * 1_000_000, device_time_us: 0, pose }
    }

    fn timeline(poses: &[TimedPose], fps: f64) -> Timeline {
        Timeline::new(poses, FrameRate::new(fps).unwrap()).unwrap()
    }

    fn xs(timeline: &Timeline) -> Vec<f64> {
        timeline.poses.iter().map(|p| p.position_mm.x).collect()
    }

    #[test]
    fn frames_lie_between_poses_and_end_with_the_recording() {
        let timeline = timeline(&[pose(0, 0.0), pose(200, 2.0), pose(300, 4.0)], 10.0);
        assert_eq!(xs(&timeline), [0.0, 1.0, 2.0, 4.0]);
        assert_eq!(timeline.held_in(0..4), 0);
        assert!((timeline.seconds(3) - 0.3).abs() < 1e-12);
        assert_eq!(timeline.nearest(5_000_000_000 + 140_000_000), 1);
        assert_eq!((timeline.nearest(0), timeline.nearest(u64::MAX)), (0, 3));
    }

    #[test]
    fn a_gap_holds_the_last_pose_and_is_counted() {
        let timeline = timeline(&[pose(0, 0.0), pose(100, 1.0), pose(600, 6.0)], 5.0);
        assert_eq!(xs(&timeline), [0.0, 0.0, 0.0, 6.0]);
        assert_eq!((timeline.held_in(0..4), timeline.held_in(2..4)), (2, 1));
    }

    #[test]
    fn a_frozen_probe_stands_where_it_was() {
        let mut timeline = timeline(&[pose(0, 0.0), pose(200, 2.0), pose(400, 4.0)], 10.0);
        let live = [false, true, true, false, true].map(|frozen| LiveSettings { frozen, ..LiveSettings::default() });
        timeline.freeze(&live);
        assert_eq!(xs(&timeline), [0.0, 0.0, 0.0, 3.0, 3.0]);
        let scene: Vec<f64> = (0..5).map(|i| (10.0 * timeline.scene_s(i)).round()).collect();
        assert_eq!(scene, [0.0, 0.0, 0.0, 3.0, 3.0], "what moves in the scene stands still, too");
        assert!((timeline.seconds(2) - 0.2).abs() < 1e-12, "the frame's own time goes on");
        timeline.freeze(&[LiveSettings { frozen: true, ..LiveSettings::default() }]);
        assert_eq!(xs(&timeline)[0], 0.0, "frozen from the start, at the first pose");
    }

    #[test]
    fn a_frozen_needle_stands_where_it_was() {
        let needle = |x: f64| {
            let scene_from_needle = Pose::from_components([x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
            Some(Needle { scene_from_needle, bevel_known: true })
        };
        let mut timeline = timeline(&[pose(0, 0.0), pose(400, 4.0)], 10.0).with_standing_needle(needle(9.0).unwrap());
        assert_eq!(timeline.needles, [needle(9.0); 5]);
        timeline.needles = vec![needle(1.0), None, needle(3.0), needle(4.0), needle(5.0)];
        let live = [false, false, true, true, false].map(|frozen| LiveSettings { frozen, ..LiveSettings::default() });
        timeline.freeze(&live);
        assert_eq!(timeline.needles, [needle(1.0), None, None, None, needle(5.0)]);
    }

    #[test]
    fn a_scene_moves_as_in_its_session() {
        let timeline = timeline(&[pose(0, 0.0), pose(200, 2.0)], 10.0);
        assert_eq!(timeline.scene_s(0), 0.0);
        let session = timeline.clone().since(5_000_000_000 - 1_500_000_000);
        assert!((session.scene_s(0) - 1.5).abs() < 1e-9 && (session.scene_s(2) - 1.7).abs() < 1e-9);
        assert_eq!(session.seconds(0), 0.0);
        assert_eq!(timeline.since(6_000_000_000).scene_s(0), 0.0, "a start behind the poses: at rest");
    }

    #[test]
    fn no_poses_make_no_frames() {
        assert!(timeline(&[], 20.0).poses.is_empty());
        assert_eq!(timeline(&[pose(0, 3.0)], 20.0).poses.len(), 1);
    }
}
