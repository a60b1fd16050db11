//! The One-Euro filter of Casiez, Roussel & Vogel (CHI 2012), for poses.
//!
//! A low-pass filter whose cutoff rises with speed: no jitter at rest, little lag in motion. Position and rotation
//! have separate filters. As in the authors' code, the speed is computed from the raw poses. A speed from filtered
//! poses would include the filter's lag and could not be used for prediction.

use std::f64::consts::TAU;

use glam::DVec3;

use super::transform::rotation_vector;
use super::{FilterSettings, Pose};

/// A pose with its velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// The pose.
    pub pose: Pose,
    /// Velocity, mm/s.
    pub velocity_mm_s: DVec3,
    /// Angular velocity, rad/s, in the pose's parent frame (not the probe frame).
    pub angular_velocity_rad_s: DVec3,
}

impl Motion {
    /// A pose at rest.
    pub fn at_rest(pose: Pose) -> Self {
        Self { pose, velocity_mm_s: DVec3::ZERO, angular_velocity_rad_s: DVec3::ZERO }
    }
}

/// Filter of one stream of poses.
#[derive(Debug, Clone)]
pub(crate) struct OneEuro {
    settings: FilterSettings,
    /// Last raw pose and last filtered motion; `None` before the first pose.
    state: Option<(Pose, Motion)>,
}

impl OneEuro {
    /// A filter without poses.
    pub(crate) fn new(settings: FilterSettings) -> Self {
        Self { settings, state: None }
    }

    /// Forgets all poses; the next one passes unchanged, at rest.
    pub(crate) fn reset(&mut self) {
        self.state = None;
    }

    /// Filters a pose that was measured `dt_s` after the last one. Returns the last motion if `dt_s` is not positive.
    pub(crate) fn push(&mut self, pose: Pose, dt_s: f64) -> Motion {
        let Some((raw, filtered)) = self.state else {
            let motion = Motion::at_rest(pose);
            self.state = Some((pose, motion));
            return motion;
        };
        if dt_s.is_nan() || dt_s <= 0.0 {
            return filtered;
        }
        let c = &self.settings;
        let speed_part = smoothing(c.speed_cutoff_hz, dt_s);
        let velocity = (pose.position_mm - raw.position_mm) / dt_s;
        let velocity_mm_s = filtered.velocity_mm_s.lerp(velocity, speed_part);
        // The rotation is on the shorter arc: q and −q are one rotation.
        let angular_velocity = rotation_vector(pose.orientation * raw.orientation.conjugate()) / dt_s;
        let angular_velocity_rad_s = filtered.angular_velocity_rad_s.lerp(angular_velocity, speed_part);

        let cutoff_hz = c.min_cutoff_hz + c.beta * velocity_mm_s.length();
        let position_mm = filtered.pose.position_mm.lerp(pose.position_mm, smoothing(cutoff_hz, dt_s));
        let cutoff_hz = c.rotation_min_cutoff_hz + c.rotation_beta * angular_velocity_rad_s.length().to_degrees();
        // glam's slerp aligns the signs.
        let orientation = filtered.pose.orientation.slerp(pose.orientation, smoothing(cutoff_hz, dt_s)).normalize();
        let motion = Motion { pose: Pose { position_mm, orientation }, velocity_mm_s, angular_velocity_rad_s };
        self.state = Some((pose, motion));
        motion
    }
}

/// Weight α of the new value in a first-order low-pass filter: α = 1/(1 + τ/dt), τ = 1/(2πf), with the cutoff f =
/// `cutoff_hz` and the time step dt = `dt_s`.
pub(crate) fn smoothing(cutoff_hz: f64, dt_s: f64) -> f64 {
    let tau_s = 1.0 / (TAU * cutoff_hz);
    dt_s / (dt_s + tau_s)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;
    use proptest::prelude::*;

    use super::*;
    use crate::pose::transform::angle_between;

    fn filter() -> OneEuro {
        OneEuro::new(FilterSettings {
            min_cutoff_hz: 2.0,
            beta: 0.1,
            rotation_min_cutoff_hz: 2.0,
            rotation_beta: 0.1,
            speed_cutoff_hz: 2.0,
            ..FilterSettings::default()
        })
    }

    const DT_S: f64 = 1.0 / 60.0;

    fn pose(x: f64, angle: f64) -> Pose {
        Pose { position_mm: DVec3::X * x, orientation: DQuat::from_rotation_z(angle) }
    }

    #[test]
    fn a_constant_pose_passes_and_a_step_is_approached() {
        let mut filter = filter();
        for _ in 0..10 {
            let motion = filter.push(pose(3.0, 0.5), DT_S);
            assert!(motion.pose.position_mm.distance(DVec3::X * 3.0) < 1e-12);
            assert!(angle_between(motion.pose.orientation, pose(3.0, 0.5).orientation) < 1e-12);
            assert!(motion.velocity_mm_s.length() < 1e-9 && motion.angular_velocity_rad_s.length() < 1e-9);
        }
        let mut last = 3.0;
        for _ in 0..200 {
            let x = filter.push(pose(4.0, 0.5), DT_S).pose.position_mm.x;
            assert!(x >= last && x <= 4.0);
            last = x;
        }
        assert!(last > 3.999);
    }

    #[test]
    fn steady_motion_lags_by_the_time_constant_and_shows_its_speed() {
        let (speed, turn) = (50.0, 0.6);
        let mut filter = filter();
        let mut motion = Motion::at_rest(pose(0.0, 0.0));
        for i in 0..300 {
            motion = filter.push(pose(speed * DT_S * f64::from(i), turn * DT_S * f64::from(i)), DT_S);
        }
        assert!((motion.velocity_mm_s.x - speed).abs() < 1e-6 && (motion.angular_velocity_rad_s.z - turn).abs() < 1e-6);
        let tau_s = |cutoff_hz: f64| 1.0 / (TAU * cutoff_hz);
        let lag_s = 299.0 * DT_S - motion.pose.position_mm.x / speed;
        assert!((lag_s - tau_s(2.0 + 0.1 * speed)).abs() < 1e-6, "{lag_s}");
        let lag_rad = angle_between(motion.pose.orientation, pose(0.0, turn * DT_S * 299.0).orientation);
        assert!((lag_rad / turn - tau_s(2.0 + 0.1 * turn.to_degrees())).abs() < 1e-6, "{lag_rad}");
    }

    #[test]
    fn unchanged_time_changes_nothing() {
        let mut filter = filter();
        let first = filter.push(pose(0.0, 0.0), DT_S);
        for dt_s in [0.0, -1.0, f64::NAN] {
            assert_eq!(filter.push(pose(9.0, 1.0), dt_s), first);
        }
    }

    #[test]
    fn half_turns_stay_rotations() {
        let mut filter = filter();
        for i in 0..100 {
            let angle = if i % 2 == 0 { 0.0 } else { std::f64::consts::PI };
            let motion = filter.push(pose(0.0, angle), DT_S);
            assert!(motion.pose.orientation.is_normalized() && motion.angular_velocity_rad_s.is_finite());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn quaternion_signs_make_no_difference(
            poses in prop::collection::vec((-50.0..50.0_f64, -9.0..9.0_f64, any::<bool>(), 1e-6..0.5_f64), 1..60),
        ) {
            let (mut plain, mut mixed) = (filter(), filter());
            for (x, angle, negate, dt_s) in poses {
                let p = pose(x, angle);
                let q = Pose { orientation: if negate { -p.orientation } else { p.orientation }, ..p };
                let (a, b) = (plain.push(p, dt_s), mixed.push(q, dt_s));
                prop_assert!(a.pose.orientation.is_normalized() && b.pose.position_mm.is_finite());
                prop_assert!((a.pose.position_mm.x).abs() <= 50.0);
                prop_assert_eq!(a.velocity_mm_s, b.velocity_mm_s);
                let apart = angle_between(a.pose.orientation, b.pose.orientation);
                // At exactly half a turn, either direction is correct.
                prop_assert!(apart < 1e-6 || (a.angular_velocity_rad_s + b.angular_velocity_rad_s).length() < 1e-3);
            }
        }
    }
}
