//! Ring buffer of the latest poses.

use std::collections::VecDeque;

use super::{Pose, TimedPose, interpolate};

/// History of poses in ascending time. At its capacity, a new pose replaces the oldest.
#[derive(Debug, Clone)]
pub(crate) struct PoseRing {
    poses: VecDeque<TimedPose>,
    capacity: usize,
}

impl PoseRing {
    /// An empty history for `capacity` poses (at least one). It allocates nothing later.
    pub(crate) fn new(capacity: usize) -> Self {
        let capacity = capacity.max(1);
        Self { poses: VecDeque::with_capacity(capacity), capacity }
    }

    /// Appends a pose. A pose that is not later than the newest starts a new history.
    pub(crate) fn push(&mut self, pose: TimedPose) {
        if self.poses.back().is_some_and(|newest| pose.host_time_ns <= newest.host_time_ns) {
            self.poses.clear();
        }
        if self.poses.len() == self.capacity {
            self.poses.pop_front();
        }
        self.poses.push_back(pose);
    }

    /// Forgets all poses.
    pub(crate) fn clear(&mut self) {
        self.poses.clear();
    }

    /// Moves all poses `by_ns` earlier, after the host clock was set back.
    pub(crate) fn set_back(&mut self, by_ns: u64) {
        self.poses.iter_mut().for_each(|p| p.host_time_ns = p.host_time_ns.saturating_sub(by_ns));
    }

    /// Pose at `host_time_ns` by [`interpolate`]; before the history, its oldest pose. `None` after the newest pose
    /// and in an empty history.
    pub(crate) fn at(&mut self, host_time_ns: u64) -> Option<Pose> {
        let poses: &[TimedPose] = self.poses.make_contiguous();
        let oldest = poses.first()?;
        if host_time_ns <= oldest.host_time_ns {
            return Some(oldest.pose);
        }
        interpolate(poses, host_time_ns, u64::MAX)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn pose(host_time_ns: u64) -> TimedPose {
        let pose = Pose { position_mm: DVec3::X * host_time_ns as f64, ..Pose::IDENTITY };
        TimedPose { host_time_ns, device_time_us: 0, pose }
    }

    #[test]
    fn the_latest_poses_are_kept_and_interpolated() {
        let mut ring = PoseRing::new(4);
        let room = ring.poses.capacity();
        assert_eq!((ring.at(5), ring.poses.is_empty()), (None, true));
        (1..=9).for_each(|t| ring.push(pose(10 * t)));
        assert_eq!((ring.poses.len(), ring.poses.capacity()), (4, room));
        assert_eq!(ring.at(75).unwrap().position_mm.x, 75.0);
        assert_eq!(ring.at(1).unwrap().position_mm.x, 60.0);
        assert_eq!(ring.at(90).unwrap().position_mm.x, 90.0);
        assert_eq!(ring.at(91), None);
    }

    #[test]
    fn a_time_that_does_not_rise_starts_a_new_history() {
        let mut ring = PoseRing::new(4);
        ring.push(pose(20));
        ring.push(pose(30));
        ring.set_back(15);
        assert_eq!(ring.poses.back().unwrap().host_time_ns, 15);
        ring.push(pose(15));
        assert_eq!((ring.poses.len(), ring.at(15).unwrap().position_mm.x), (1, 15.0));
    }
}
