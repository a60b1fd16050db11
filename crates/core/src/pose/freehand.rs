//! Simulated hand motion of a probe: movements between views, with pauses and tremor.

use glam::{DQuat, DVec3, EulerRot};

use crate::random::SplitMix64;

/// RMS tremor along each axis of a hand that rests on the skin, mm (assumed).
pub const TREMOR_MM: f64 = 0.3;

/// RMS tremor about each axis of a hand that rests on the skin, degrees (assumed).
pub(crate) const TREMOR_DEG: f64 = 0.5;

/// Frequency band of the tremor, Hz: from slow drift to the physiological tremor of a hand.
const TREMOR_BAND_HZ: (f64, f64) = (0.3, 9.0);

/// Number of sinusoids per component of the tremor.
const TREMOR_PARTIALS: usize = 12;

/// A view that the hand moves to and holds for a while.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint {
    /// Time of arrival, s from the start.
    pub arrive_s: f64,
    /// Time of departure, s from the start.
    pub leave_s: f64,
    /// Scene point at which the probe looks, mm.
    pub target_mm: DVec3,
    /// Orientation of the probe: turns probe axes into scene axes.
    pub orientation: DQuat,
}

/// Target point (mm) and orientation of the probe `time_s` after the start; `None` without waypoints.
///
/// `waypoints` must ascend in time. Between two waypoints, the target moves on a line and the probe turns on the
/// shorter arc, both with minimum jerk (Flash & Hogan, J Neurosci 5:1688, 1985).
pub fn view_at(waypoints: &[Waypoint], time_s: f64) -> Option<(DVec3, DQuat)> {
    let next = waypoints.partition_point(|w| w.arrive_s <= time_s);
    let Some(from) = next.checked_sub(1).and_then(|i| waypoints.get(i)) else {
        return waypoints.first().map(|w| (w.target_mm, w.orientation));
    };
    let Some(to) = waypoints.get(next).filter(|_| time_s > from.leave_s) else {
        return Some((from.target_mm, from.orientation));
    };
    let s = minimum_jerk((time_s - from.leave_s) / (to.arrive_s - from.leave_s));
    let orientation = from.orientation.slerp(to.orientation, s).normalize();
    Some((from.target_mm.lerp(to.target_mm, s), orientation))
}

/// Fraction of a minimum-jerk path covered after the fraction `t` of the time, 0..=1. Velocity and acceleration vanish
/// at both ends.
pub fn minimum_jerk(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * t * (10.0 + t * (-15.0 + t * 6.0))
}

/// Tremor of a hand: band-limited noise from a seed.
#[derive(Debug, Clone)]
pub struct Tremor {
    /// Amplitude, angular frequency (rad/s) and phase of each sinusoid, for three translations and three rotations.
    components: [[(f64, f64, f64); TREMOR_PARTIALS]; 6],
}

impl Tremor {
    /// Tremor with this seed.
    pub fn new(seed: u64) -> Self {
        let mut random = SplitMix64::new(seed);
        let (low, high) = TREMOR_BAND_HZ;
        let components = std::array::from_fn(|_| {
            let mut partials: [_; TREMOR_PARTIALS] = std::array::from_fn(|i| {
                // Each sinusoid has its own part of the band, of equal logarithmic width. Displacement falls as 1/f.
                let part = (i as f64 + random.unit()) / TREMOR_PARTIALS as f64;
                let frequency_hz = low * (high / low).powf(part);
                (1.0 / frequency_hz, std::f64::consts::TAU * frequency_hz, std::f64::consts::TAU * random.unit())
            });
            let rms = partials.iter().map(|(a, ..)| 0.5 * a * a).sum::<f64>().sqrt();
            partials.iter_mut().for_each(|(a, ..)| *a /= rms);
            partials
        });
        Self { components }
    }

    /// Displacement (mm) and rotation, both in the probe frame, at `time_s`.
    pub fn at(&self, time_s: f64) -> (DVec3, DQuat) {
        let value =
            |i: usize| self.components[i].iter().map(|(a, w, phase)| a * (w * time_s + phase).sin()).sum::<f64>();
        let angle = |i| TREMOR_DEG.to_radians() * value(i);
        let shift_mm = TREMOR_MM * DVec3::new(value(0), value(1), value(2));
        (shift_mm, DQuat::from_euler(EulerRot::XYZ, angle(3), angle(4), angle(5)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waypoints() -> [Waypoint; 2] {
        let second = DQuat::from_rotation_z(1.0);
        [
            Waypoint { arrive_s: 1.0, leave_s: 2.0, target_mm: DVec3::ZERO, orientation: DQuat::IDENTITY },
            Waypoint { arrive_s: 4.0, leave_s: 5.0, target_mm: DVec3::X * 10.0, orientation: second },
        ]
    }

    #[test]
    fn rests_at_waypoints_and_is_half_way_at_half_time() {
        let waypoints = waypoints();
        for time_s in [0.0, 1.0, 1.5, 2.0] {
            assert_eq!(view_at(&waypoints, time_s), Some((DVec3::ZERO, DQuat::IDENTITY)));
        }
        let (target, orientation) = view_at(&waypoints, 3.0).unwrap();
        assert!((target.x - 5.0).abs() < 1e-12);
        assert!(orientation.angle_between(DQuat::from_rotation_z(0.5)) < 1e-7);
        assert_eq!(view_at(&waypoints, 9.0).unwrap().0, DVec3::X * 10.0);
        assert_eq!(view_at(&[], 0.0), None);
    }

    #[test]
    fn the_hand_starts_and_stops_smoothly() {
        let waypoints = waypoints();
        let x = |t: f64| view_at(&waypoints, t).unwrap().0.x;
        let h = 1e-3;
        let mut fastest: f64 = 0.0;
        for i in 0..4000 {
            let t = 1.0 + f64::from(i) * h;
            let speed = (x(t + h) - x(t - h)) / (2.0 * h);
            let acceleration = (x(t + h) - 2.0 * x(t) + x(t - h)) / (h * h);
            fastest = fastest.max(speed);
            // Minimum jerk over d = 10 mm in T = 2 s peaks at a speed of 15/8·d/T and an acceleration of 10/√3·d/T².
            assert!(speed >= -1e-9 && acceleration.abs() < 5.78 * 10.0 / 4.0, "{t}: {speed} {acceleration}");
        }
        assert!((fastest - 1.875 * 5.0).abs() < 0.01, "{fastest}");
    }

    #[test]
    fn tremor_has_its_rms_and_depends_only_on_its_seed() {
        let samples = |seed| {
            let tremor = Tremor::new(seed);
            (0..6000).map(move |i| tremor.at(f64::from(i) / 60.0)).collect::<Vec<_>>()
        };
        let a = samples(7);
        assert_eq!(a, samples(7));
        assert_ne!(a, samples(8));
        let rms =
            |f: &dyn Fn(&(DVec3, DQuat)) -> f64| (a.iter().map(|s| f(s).powi(2)).sum::<f64>() / a.len() as f64).sqrt();
        for axis in 0..3 {
            let shift = rms(&|(shift, _)| shift[axis]);
            assert!((shift - TREMOR_MM).abs() < 0.03, "{shift}");
            let turn = rms(&|(_, turn)| 2.0 * turn.to_array()[axis]).to_degrees();
            assert!((turn - TREMOR_DEG).abs() < 0.05, "{turn}");
        }
        let fastest = a.windows(2).map(|w| w[0].0.distance(w[1].0)).fold(0.0, f64::max);
        assert!(fastest < 0.5, "a jump of {fastest} mm within a frame");
    }
}
