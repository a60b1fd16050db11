//! Integration of a puck's rates into a pose.

use glam::{DQuat, DVec3};

use super::one_euro::Motion;
use super::{POSITION_LIMIT_MM, Pose};

/// Longest time over which one rate is integrated, s: in a longer gap, the duration of the deflection is unknown.
const LONGEST_S: f64 = 0.1;

/// Integrator of the rates of a puck (a SpaceMouse) into a pose. The rates are along and about the probe's axes.
///
/// A rate applies from its report to the next one. A puck at rest sends no reports.
#[derive(Debug, Clone)]
pub(crate) struct RateIntegrator {
    speed_mm_s: f64,
    speed_rad_s: f64,
    pose: Pose,
    /// Rates of the last report, along (mm/s) and about (rad/s) the probe's axes.
    rates: (DVec3, DVec3),
}

impl RateIntegrator {
    /// Integrator that starts at `start` (`scene_from_probe`), with the given speeds at full deflection.
    pub(crate) fn new(start: Pose, speed_mm_s: f64, speed_deg_s: f64) -> Self {
        let rates = (DVec3::ZERO, DVec3::ZERO);
        Self { speed_mm_s, speed_rad_s: speed_deg_s.to_radians(), pose: start, rates }
    }

    /// Takes a report that came `dt_s` after the last one. Its rates are in −1..=1; larger ones are clamped.
    pub(crate) fn push(&mut self, translation: DVec3, rotation: DVec3, dt_s: f64) -> Motion {
        let (velocity, turn) = self.rates;
        // No motion unless time advances.
        let dt_s = if dt_s > 0.0 { dt_s.min(LONGEST_S) } else { 0.0 };
        let position_mm = self.pose.position_mm + self.pose.orientation * (velocity * dt_s);
        let limit = DVec3::splat(POSITION_LIMIT_MM);
        self.pose = Pose {
            position_mm: position_mm.clamp(-limit, limit),
            orientation: (self.pose.orientation * DQuat::from_scaled_axis(turn * dt_s)).normalize(),
        };
        let full = |rate: DVec3| rate.clamp(DVec3::NEG_ONE, DVec3::ONE);
        self.rates = (full(translation) * self.speed_mm_s, full(rotation) * self.speed_rad_s);
        Motion {
            pose: self.pose,
            velocity_mm_s: self.pose.orientation * self.rates.0,
            angular_velocity_rad_s: self.pose.orientation * self.rates.1,
        }
    }

    /// Whether all rates are zero.
    pub(crate) fn is_resting(&self) -> bool {
        self.rates == (DVec3::ZERO, DVec3::ZERO)
    }

    /// Sets the rates to zero: the device is disconnected.
    pub(crate) fn release(&mut self) {
        self.rates = (DVec3::ZERO, DVec3::ZERO);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn puck() -> RateIntegrator {
        let start = Pose { position_mm: DVec3::new(1.0, 2.0, 3.0), orientation: DQuat::from_rotation_z(0.5) };
        RateIntegrator::new(start, 80.0, 45.0)
    }

    #[test]
    fn full_deflection_moves_at_full_speed_along_the_probes_axes() {
        for reports in [10, 100] {
            let mut puck = puck();
            let start = puck.pose;
            let dt_s = 0.5 / f64::from(reports);
            for _ in 0..=reports {
                puck.push(DVec3::X, DVec3::ZERO, dt_s.min(1.0));
            }
            let moved = puck.pose.position_mm - start.position_mm;
            // The first report moves nothing: its rate applies from then on.
            let expected = start.orientation * DVec3::X * 40.0;
            assert!(moved.distance(expected) < 1e-9, "{moved}");
        }
        let mut puck = puck();
        for _ in 0..=20 {
            puck.push(DVec3::ZERO, DVec3::Z * 7.0, 0.1);
        }
        let expected = DQuat::from_rotation_z(0.5 + std::f64::consts::FRAC_PI_2);
        assert!(puck.pose.orientation.angle_between(expected) < 1e-7);
    }

    #[test]
    fn gaps_move_little_and_rest_moves_nothing() {
        let mut puck = puck();
        let start = puck.pose;
        puck.push(DVec3::X, DVec3::ZERO, 0.01);
        let motion = puck.push(DVec3::ZERO, DVec3::ZERO, 60.0);
        assert!((motion.pose.position_mm.distance(start.position_mm) - 8.0).abs() < 1e-9);
        assert!(puck.is_resting() && motion.velocity_mm_s == DVec3::ZERO);
        let before = puck.pose.position_mm;
        assert_eq!(puck.push(DVec3::X, DVec3::ZERO, 60.0).pose.position_mm, before);
        assert_eq!(puck.push(DVec3::X, DVec3::ZERO, -1.0).pose.position_mm, before);
    }

    #[test]
    fn hours_of_deflection_stay_in_range() {
        let mut puck = puck();
        for _ in 0..50_000 {
            puck.push(DVec3::splat(1.0), DVec3::ZERO, 0.1);
        }
        assert!(Pose::from_components(puck.pose.components()).is_ok());
    }
}
