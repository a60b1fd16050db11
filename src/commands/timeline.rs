//! A recording's poses at the times of a video's frames.

use insonify::pose::{Pose, TimedPose, interpolate};
use insonify::sink::FrameRate;
use insonify::tracker::recording::GAP_NS;

use super::failure::Failure;

/// Longest time without a pose that is bridged: what the probe did in a longer one is not known.
pub(crate) const GAP_LIMIT_NS: u64 = GAP_NS;

/// Poses at equal distances in time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Timeline {
    /// A pose for each frame; in a gap of the recording the one before it.
    pub(crate) poses: Vec<Pose>,
    /// Host time of each frame, ns.
    pub(crate) times_ns: Vec<u64>,
    /// Which frames lie in gaps.
    held: Vec<bool>,
}

/// Most frames of a session: a day at ten a second.
const FRAMES_MAX: u128 = 1_000_000;

/// Refuses poses that would make more frames than a session can have: a wrong clock, most likely.
pub(crate) fn check_length(poses: &[TimedPose], rate: FrameRate) -> Result<(), Failure> {
    let (Some(first), Some(last)) = (poses.first(), poses.last()) else { return Ok(()) };
    let span_ns = u128::from(last.host_time_ns.saturating_sub(first.host_time_ns));
    let frames = span_ns * u128::from(rate.numerator) / (u128::from(rate.denominator) * 1_000_000_000);
    if frames > FRAMES_MAX {
        return Err(Failure::Input(anyhow::anyhow!(
            "the recording's host times span {:.0} s: {frames} frames at {:.1} a second, at most {FRAMES_MAX} are rendered; is a time stamp wrong?",
            span_ns as f64 * 1e-9,
            rate.fps()
        )));
    }
    Ok(())
}

impl Timeline {
    /// Samples `poses` from the first to the last at `rate`.
    pub(crate) fn new(poses: &[TimedPose], rate: FrameRate) -> Self {
        let mut timeline = Self { poses: Vec::new(), times_ns: Vec::new(), held: Vec::new() };
        let (Some(first), Some(last)) = (poses.first(), poses.last()) else { return timeline };
        let mut held = first.pose;
        for frame in 0u64.. {
            let offset_ns =
                u128::from(frame) * u128::from(rate.denominator) * 1_000_000_000 / u128::from(rate.numerator);
            let Some(time_ns) = u64::try_from(offset_ns).ok().and_then(|o| first.host_time_ns.checked_add(o)) else {
                break;
            };
            if time_ns > last.host_time_ns {
                break;
            }
            let pose = interpolate(poses, time_ns, GAP_LIMIT_NS);
            held = pose.unwrap_or(held);
            timeline.held.push(pose.is_none());
            timeline.poses.push(held);
            timeline.times_ns.push(time_ns);
        }
        timeline
    }

    /// How many of `frames` lie in gaps.
    pub(crate) fn held_in(&self, frames: std::ops::Range<usize>) -> usize {
        self.held.get(frames).unwrap_or_default().iter().filter(|held| **held).count()
    }

    /// Whether a frame lies in a gap.
    pub(crate) fn is_held(&self, frame: usize) -> bool {
        self.held.get(frame).copied().unwrap_or_default()
    }

    /// Time of a frame since the first pose, s.
    pub(crate) fn seconds(&self, frame: usize) -> f64 {
        match (self.times_ns.first(), self.times_ns.get(frame)) {
            (Some(first), Some(time)) => (time - first) as f64 * 1e-9,
            _ => 0.0,
        }
    }

    /// The frame nearest to a host time.
    pub(crate) fn nearest(&self, time_ns: u64) -> usize {
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

    fn xs(timeline: &Timeline) -> Vec<f64> {
        timeline.poses.iter().map(|p| p.position_mm.x).collect()
    }

    #[test]
    fn frames_lie_between_poses_and_end_with_the_recording() {
        let timeline = Timeline::new(&[pose(0, 0.0), pose(200, 2.0), pose(300, 4.0)], FrameRate::new(10.0).unwrap());
        assert_eq!(xs(&timeline), [0.0, 1.0, 2.0, 4.0]);
        assert_eq!(timeline.held_in(0..4), 0);
        assert!((timeline.seconds(3) - 0.3).abs() < 1e-12);
        assert_eq!(timeline.nearest(5_000_000_000 + 140_000_000), 1);
        assert_eq!((timeline.nearest(0), timeline.nearest(u64::MAX)), (0, 3));
    }

    #[test]
    fn a_gap_holds_the_last_pose_and_is_counted() {
        let timeline = Timeline::new(&[pose(0, 0.0), pose(100, 1.0), pose(600, 6.0)], FrameRate::new(5.0).unwrap());
        assert_eq!(xs(&timeline), [0.0, 0.0, 0.0, 6.0]);
        assert_eq!((timeline.held_in(0..4), timeline.held_in(2..4)), (2, 1));
    }

    #[test]
    fn no_poses_make_no_frames() {
        let rate = FrameRate::new(20.0).unwrap();
        assert!(Timeline::new(&[], rate).poses.is_empty());
        assert_eq!(Timeline::new(&[pose(0, 3.0)], rate).poses.len(), 1);
    }
}
