//! Time-stamped poses and their interpolation.

use super::Pose;

/// A pose and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedPose {
    /// Arrival of the measurement's first byte at the host, ns since 1970 (UTC).
    pub host_time_ns: u64,
    /// Clock of the tracker, µs from its own origin.
    pub device_time_us: u64,
    /// The pose.
    pub pose: Pose,
}

/// Pose at `host_time_ns`, interpolated between its neighbours in time: linear in position, on the shorter arc in
/// rotation.
///
/// `poses` must ascend in host time; among poses of equal time, the last is used. `None` outside the time range of
/// `poses`. `None` also within a gap longer than `gap_limit_ns`, where the probe's motion is unknown.
pub fn interpolate(poses: &[TimedPose], host_time_ns: u64, gap_limit_ns: u64) -> Option<Pose> {
    let after = poses.partition_point(|p| p.host_time_ns <= host_time_ns);
    let before = poses.get(after.checked_sub(1)?)?;
    if before.host_time_ns == host_time_ns {
        return Some(before.pose);
    }
    let next = poses.get(after)?;
    let gap_ns = next.host_time_ns - before.host_time_ns;
    if gap_ns > gap_limit_ns {
        return None;
    }
    let fraction = (host_time_ns - before.host_time_ns) as f64 / gap_ns as f64;
    // glam's slerp takes the shorter arc: q and −q are the same rotation.
    let orientation = before.pose.orientation.slerp(next.pose.orientation, fraction).normalize();
    Some(Pose { position_mm: before.pose.position_mm.lerp(next.pose.position_mm, fraction), orientation })
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;

    fn pose(host_time_ns: u64, x: f64, angle: f64) -> TimedPose {
        let pose = Pose { position_mm: DVec3::X * x, orientation: DQuat::from_rotation_z(angle) };
        TimedPose { host_time_ns, device_time_us: host_time_ns / 1000, pose }
    }

    #[test]
    fn an_interpolated_pose_is_between_its_neighbours() {
        let poses = [pose(100, 0.0, 0.2), pose(200, 4.0, 0.6)];
        let quarter = interpolate(&poses, 125, 100).unwrap();
        assert!((quarter.position_mm.x - 1.0).abs() < 1e-12);
        assert!(quarter.orientation.angle_between(DQuat::from_rotation_z(0.3)) < 1e-7);
        for p in &poses {
            assert_eq!(interpolate(&poses, p.host_time_ns, 100), Some(p.pose));
        }
    }

    #[test]
    fn a_negated_quaternion_does_not_turn_the_long_way() {
        let mut poses = [pose(0, 0.0, 0.1), pose(100, 0.0, 0.3)];
        poses[1].pose.orientation = -poses[1].pose.orientation;
        let middle = interpolate(&poses, 50, 100).unwrap().orientation;
        let turned = middle * DVec3::X;
        assert!(turned.distance(DQuat::from_rotation_z(0.2) * DVec3::X) < 1e-12, "{turned}");
        assert!(middle.is_normalized());
    }

    #[test]
    fn there_is_no_pose_outside_the_range_or_within_a_gap() {
        let poses = [pose(100, 0.0, 0.0), pose(200, 1.0, 0.0), pose(900, 2.0, 0.0)];
        assert_eq!(interpolate(&poses, 99, 500), None);
        assert_eq!(interpolate(&poses, 901, 500), None);
        assert_eq!(interpolate(&poses, 500, 500), None);
        assert!(interpolate(&poses, 500, 700).is_some());
        assert_eq!(interpolate(&[], 0, 1), None);
    }

    #[test]
    fn of_several_poses_at_one_time_the_last_is_used() {
        let poses = [pose(5, 0.0, 0.0), pose(10, 1.0, 0.0), pose(10, 2.0, 0.0), pose(20, 3.0, 0.0)];
        assert_eq!(interpolate(&poses, 10, 100).unwrap().position_mm.x, 2.0);
    }
}
