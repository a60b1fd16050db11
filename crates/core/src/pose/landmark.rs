//! Landmarks touched with a stylus whose tip is held still.

use glam::DVec3;
use thiserror::Error;

use super::Pose;

/// Conditions under which a tip counts as still.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StillSettings {
    /// Number of consecutive poses that must be still; they are averaged.
    pub samples: usize,
    /// Largest accepted distance of a tip position from the mean, mm.
    pub tolerance_mm: f64,
    /// Number of poses after which the attempt fails.
    pub poses_max: usize,
}

impl Default for StillSettings {
    /// Defaults: still for one second within 1 mm; attempts of half a minute, at 60 poses per second.
    fn default() -> Self {
        Self { samples: 60, tolerance_mm: 1.0, poses_max: 1800 }
    }
}

/// Touched landmark in the tracker's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touched {
    /// Mean position of the tip in the tracker's frame, mm.
    pub tracker_mm: DVec3,
    /// RMS distance of the tip from its mean position, mm.
    pub rms_mm: f64,
}

/// Reason for a failed landmark.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum LandmarkError {
    /// The poses ended before the tip was still.
    #[error("the tracker gave {found} poses only; {needed} of a still tip are needed (is the sensor in view?)")]
    Ended {
        /// Poses received.
        found: usize,
        /// Poses needed.
        needed: usize,
    },
    /// The tip was never still.
    #[error(
        "the tip moved by {best_mm:.2} mm from its mean at best in {poses} poses; hold it within {tolerance_mm} mm for {samples} poses"
    )]
    Unsteady {
        /// Smallest distance from its mean within which the tip stayed for the needed number of poses, mm.
        best_mm: f64,
        /// Poses examined.
        poses: usize,
        /// Largest accepted distance of the tip from its mean, mm.
        tolerance_mm: f64,
        /// Poses needed.
        samples: usize,
    },
}

/// Mean tip position over the first poses in which the tip is still. Poses are `tracker_from_sensor` of the stylus.
///
/// The poses may come from a live tracker or a recording; only as many as needed are taken. `tip_mm` is in the
/// sensor's frame.
///
/// # Errors
/// The poses end, or [`StillSettings::poses_max`] is reached, before the tip is still.
pub fn touch(
    tracker_from_sensor: impl IntoIterator<Item = Pose>,
    tip_mm: DVec3,
    settings: &StillSettings,
) -> Result<Touched, LandmarkError> {
    let needed = settings.samples.max(1);
    let mut tips: Vec<DVec3> = Vec::with_capacity(needed);
    let (mut found, mut best_mm) = (0, f64::INFINITY);
    for pose in tracker_from_sensor.into_iter().take(settings.poses_max.max(needed)) {
        if tips.len() == needed {
            tips.remove(0);
        }
        tips.push(pose.transform_point(tip_mm));
        found += 1;
        if tips.len() < needed {
            continue;
        }
        let mean = tips.iter().sum::<DVec3>() / needed as f64;
        let spread_mm = tips.iter().map(|tip| tip.distance(mean)).fold(0.0, f64::max);
        best_mm = best_mm.min(spread_mm);
        if spread_mm <= settings.tolerance_mm {
            let squares: f64 = tips.iter().map(|tip| tip.distance_squared(mean)).sum();
            return Ok(Touched { tracker_mm: mean, rms_mm: (squares / needed as f64).sqrt() });
        }
    }
    if found < settings.poses_max {
        return Err(LandmarkError::Ended { found, needed });
    }
    Err(LandmarkError::Unsteady { best_mm, poses: found, tolerance_mm: settings.tolerance_mm, samples: needed })
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    fn pose(x: f64) -> Pose {
        Pose { position_mm: DVec3::X * x, orientation: DQuat::from_rotation_y(0.5) }
    }

    #[test]
    fn touch_waits_until_the_tip_rests_and_takes_no_further_poses() {
        let settings = StillSettings { samples: 10, tolerance_mm: 0.5, poses_max: 100 };
        let approach = (0..30).map(|i| 90.0 - 3.0 * f64::from(i));
        let rest = (0..50).map(|i| if i % 2 == 0 { 0.1 } else { -0.1 });
        let mut poses = approach.chain(rest).map(pose);
        let tip = DVec3::new(0.0, 5.0, 100.0);
        let found = touch(&mut poses, tip, &settings).unwrap();
        assert!(found.tracker_mm.distance(pose(0.0).transform_point(tip)) < 1e-9);
        assert!((found.rms_mm - 0.1).abs() < 1e-9);
        assert_eq!(poses.count(), 40);
    }

    #[test]
    fn a_failed_landmark_gives_its_reason() {
        let settings = StillSettings { samples: 10, tolerance_mm: 0.5, poses_max: 50 };
        let error = touch((0..5).map(|_| pose(0.0)), DVec3::Z, &settings).unwrap_err();
        assert_eq!(error, LandmarkError::Ended { found: 5, needed: 10 });
        let mut moving = (0..).map(|i| pose(2.0 * f64::from(i)));
        let error = touch(&mut moving, DVec3::Z, &settings).unwrap_err().to_string();
        assert!(error.starts_with("the tip moved by 9.00 mm from its mean at best in 50 poses"), "{error}");
    }
}
