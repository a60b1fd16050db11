//! Time in a session during which the probe is where no hand can hold it.

use std::fmt;

use serde::Serialize;

use super::track::{Track, length_s, stretches};
use crate::transducer::Misplacement;
use crate::transducer::placement::MISPLACED_FOR;

/// Time with the probe deep in the body, or facing away from the body.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MisplacedTime {
    /// Total time, s.
    pub time_s: f64,
    /// Start of the first such interval, s since the start.
    pub from_s: f64,
    /// Placement in the first interval, with its likely cause.
    #[serde(flatten)]
    pub first: Misplacement,
}

impl MisplacedTime {
    /// Sums up a session's track. `None` if a hand can have made the whole session, or if the scene has no skin.
    pub fn of(track: &Track) -> Option<Self> {
        let Track { time_s, misplaced, .. } = track;
        let held = stretches(time_s, |i| misplaced.get(i).is_some_and(Option::is_some));
        let long = held.iter().filter(|stretch| length_s(time_s, stretch) >= MISPLACED_FOR.as_secs_f64());
        let &(first, _) = long.clone().next()?;
        Some(Self {
            time_s: long.map(|stretch| length_s(time_s, stretch)).sum(),
            from_s: *time_s.get(first)?,
            first: (*misplaced.get(first)?)?,
        })
    }
}

impl fmt::Display for MisplacedTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "for {:.1} s, from {:.1} s on, {}", self.time_s, self.from_s, self.first)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use glam::{DVec3, Vec3};

    use super::super::Reference;
    use super::*;
    use crate::anatomy::{Skin, analytic};
    use crate::pose::{Pose, TimedPose};
    use crate::settings::ContactSettings;
    use crate::transducer::Probe;
    use crate::transducer::placement::{Cause, Fault};

    /// Result for a session of 20 poses per second on a ball of 100 mm. While `wrong` holds, its poses are in metres.
    fn misplaced(wrong: impl Fn(f64) -> bool) -> Option<MisplacedTime> {
        let ball = analytic::sphere(Vec3::ZERO, 100.0, 5);
        let skin = Skin::of_triangles(ball.corners_mm().collect::<Vec<_>>()).unwrap();
        let poses: Vec<TimedPose> = (0..200_u32)
            .map(|i| {
                let scale = if wrong(0.05 * f64::from(i)) { 1e-3 } else { 1.0 };
                let pose = Pose::looking(DVec3::Z * 98.0 * scale, DVec3::NEG_Z, DVec3::X);
                TimedPose { host_time_ns: 7_000_000_000 + 50_000_000 * u64::from(i), device_time_us: 0, pose }
            })
            .collect();
        let reference = Reference {
            planes: Vec::new(),
            scene_planes: Vec::new(),
            skin: Some(&skin),
            surfaces: &BTreeMap::new(),
            contact: &ContactSettings::default(),
            probe: &Probe::default(),
            depths_mm: &[],
        };
        MisplacedTime::of(&Track::of(&poses, &reference))
    }

    #[test]
    fn a_session_in_metres_is_told_with_its_cause() {
        let found = misplaced(|_| true).unwrap();
        assert!((found.time_s - 9.95).abs() < 1e-9 && found.from_s == 0.0);
        assert!(matches!(found.first, Misplacement { fault: Fault::Deep { .. }, likely: Some(Cause::Metres) }));
        assert!(found.to_string().contains("times 1000"), "{found}");
    }

    #[test]
    fn moments_are_no_fault() {
        assert_eq!(misplaced(|_| false), None);
        assert_eq!(misplaced(|t| t % 2.0 < 1.5), None);
        let found = misplaced(|t| t > 3.0).unwrap();
        assert!((found.from_s - 3.05).abs() < 1e-9, "{found:?}");
    }
}
