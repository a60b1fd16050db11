//! Speed of the probe, and classes of speed. Errors of the picture are known for each class.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{Pose, angle_between};

/// Lower limits of slow and of fast motion, mm/s and degrees/s; reaching one of the two is enough. At 14 frames/s and
/// 15 cm depth, a probe at rest keeps all nine angles of a live compounded picture, and a fast one keeps one.
pub const LIMITS: [Speed; 2] = [Speed { mm_s: 3.0, deg_s: 1.5 }, Speed { mm_s: 15.0, deg_s: 6.0 }];

/// Speed of the probe.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Speed {
    /// Speed of the face's centre, mm/s.
    pub mm_s: f64,
    /// Angular speed, degrees/s.
    pub deg_s: f64,
}

impl Speed {
    /// Speed from a velocity and an angular velocity.
    pub(super) fn of(velocity_mm_s: DVec3, angular_velocity_rad_s: DVec3) -> Self {
        Self { mm_s: velocity_mm_s.length(), deg_s: angular_velocity_rad_s.length().to_degrees() }
    }

    /// Mean speed of straight motion between two poses that are `time_s` apart.
    pub fn between(from: &Pose, to: &Pose, time_s: f64) -> Self {
        let over = 1.0 / time_s.max(1e-9);
        let deg = angle_between(from.orientation, to.orientation).to_degrees();
        Self { mm_s: over * from.position_mm.distance(to.position_mm), deg_s: over * deg }
    }

    /// Class of this speed, for [`LIMITS`] multiplied by `part`.
    pub fn class(&self, part: f64) -> ProbeSpeed {
        let reaches = |limit: &Speed| self.mm_s >= part * limit.mm_s || self.deg_s >= part * limit.deg_s;
        match LIMITS.each_ref().map(reaches) {
            [_, true] => ProbeSpeed::Fast,
            [true, false] => ProbeSpeed::Slow,
            [false, false] => ProbeSpeed::AtRest,
        }
    }
}

/// Class of the probe's speed; see [`LIMITS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum ProbeSpeed {
    /// Held still, with the tremor of a hand.
    #[default]
    AtRest,
    /// Slow motion, as for adjusting a plane.
    Slow,
    /// Fast motion to another position.
    Fast,
}

impl ProbeSpeed {
    /// All classes, in order of rising speed.
    pub const ALL: [Self; 3] = [Self::AtRest, Self::Slow, Self::Fast];

    /// Name of the class.
    pub fn name(self) -> &'static str {
        match self {
            Self::AtRest => "at rest",
            Self::Slow => "slow",
            Self::Fast => "fast",
        }
    }
}

/// A value for each class of the probe's speed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BySpeed {
    /// Value at rest.
    pub at_rest: f64,
    /// Value in slow motion.
    pub slow: f64,
    /// Value in fast motion.
    pub fast: f64,
}

impl BySpeed {
    /// The same value for all speeds.
    pub const fn all(value: f64) -> Self {
        Self { at_rest: value, slow: value, fast: value }
    }

    /// Values for the classes in the order of [`ProbeSpeed::ALL`].
    pub const fn new([at_rest, slow, fast]: [f64; 3]) -> Self {
        Self { at_rest, slow, fast }
    }

    /// The value for a class.
    pub const fn at(&self, speed: ProbeSpeed) -> f64 {
        match speed {
            ProbeSpeed::AtRest => self.at_rest,
            ProbeSpeed::Slow => self.slow,
            ProbeSpeed::Fast => self.fast,
        }
    }

    /// The values that `of` gives for the classes; `None` if it gives none for one of them.
    pub fn from_classes(of: impl Fn(ProbeSpeed) -> Option<f64>) -> Option<Self> {
        let [at_rest, slow, fast] = ProbeSpeed::ALL.map(of);
        Some(Self { at_rest: at_rest?, slow: slow?, fast: fast? })
    }

    /// All values multiplied by `factor`.
    pub fn times(&self, factor: f64) -> Self {
        Self::new(ProbeSpeed::ALL.map(|speed| factor * self.at(speed)))
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    #[test]
    fn either_way_of_moving_makes_the_class() {
        let class = |mm_s, deg_s| Speed { mm_s, deg_s }.class(1.0);
        assert_eq!([class(0.0, 0.0), class(2.9, 1.4)], [ProbeSpeed::AtRest; 2]);
        assert_eq!([class(3.0, 0.0), class(0.0, 1.5), class(14.9, 5.9)], [ProbeSpeed::Slow; 3]);
        assert_eq!([class(15.0, 0.0), class(0.0, 6.0), class(f64::INFINITY, 0.0)], [ProbeSpeed::Fast; 3]);
        assert_eq!(Speed { mm_s: 2.9, deg_s: 0.0 }.class(0.9), ProbeSpeed::Slow);
        assert_eq!(class(f64::NAN, f64::NAN), ProbeSpeed::AtRest);
    }

    #[test]
    fn the_speed_between_two_poses_counts_way_and_turn() {
        let to = Pose { position_mm: DVec3::new(0.0, 3.0, 4.0), orientation: DQuat::from_rotation_x(0.1) };
        let speed = Speed::between(&Pose::IDENTITY, &to, 0.5);
        assert!((speed.mm_s - 10.0).abs() < 1e-9 && (speed.deg_s - 0.2_f64.to_degrees()).abs() < 1e-6, "{speed:?}");
    }
}
