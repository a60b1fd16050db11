//! Prediction of the probe's pose to the time of display.

use glam::DQuat;

use super::Pose;
use super::one_euro::Motion;

/// Pose after `horizon_s` at constant velocity.
pub(crate) fn predict(motion: &Motion, horizon_s: f64) -> Pose {
    let Motion { pose, velocity_mm_s, angular_velocity_rad_s } = motion;
    Pose {
        position_mm: pose.position_mm + *velocity_mm_s * horizon_s,
        orientation: (DQuat::from_scaled_axis(*angular_velocity_rad_s * horizon_s) * pose.orientation).normalize(),
    }
}

/// Interval of the prediction from `from_ns` to `display_ns`, s; 0 for earlier times and at most `cap_ms`/1000.
pub(crate) fn horizon_s(from_ns: u64, display_ns: u64, cap_ms: f64) -> f64 {
    (display_ns.saturating_sub(from_ns) as f64 * 1e-9).min(cap_ms * 1e-3)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn prediction_continues_at_constant_velocity() {
        let pose = Pose { position_mm: DVec3::new(1.0, 2.0, 3.0), orientation: DQuat::from_rotation_x(0.3) };
        let motion = Motion { pose, velocity_mm_s: DVec3::X * 100.0, angular_velocity_rad_s: DVec3::X * 2.0 };
        let later = predict(&motion, 0.03);
        assert!(later.position_mm.distance(DVec3::new(4.0, 2.0, 3.0)) < 1e-12);
        assert!(later.orientation.angle_between(DQuat::from_rotation_x(0.36)) < 1e-7);
        assert_eq!(predict(&motion, 0.0).position_mm, pose.position_mm);
    }

    #[test]
    fn the_horizon_is_capped_and_never_negative() {
        assert_eq!(horizon_s(1_000, 11_000_000, 30.0), 0.010999);
        assert_eq!(horizon_s(0, u64::MAX, 30.0), 0.03);
        assert_eq!(horizon_s(5, 3, 30.0), 0.0);
        assert_eq!(horizon_s(5, 3_000_000, 0.0), 0.0);
    }
}
