//! Spin calibration: finds the axis of a tool's shaft in the frame of its sensor. The tool is turned about its shaft,
//! which keeps its direction.
//!
//! The direction R·a of the shaft is the same in all poses, so a is the eigenvector of Σ(R − R̄)ᵀ(R − R̄) with the
//! smallest eigenvalue. A turn does not show the sense of the axis; `sense` takes it from a point at the shaft's end.

use std::fmt;

use glam::DVec3;
use nalgebra::Matrix3;
use serde::Serialize;
use thiserror::Error;

use super::Pose;
use super::pivot::{rotation_matrix, widest_turn};

/// Smallest accepted number of poses.
const LEAST_POSES: usize = 20;

/// Smallest accepted turn about a shaft, degrees.
pub(super) const LEAST_TURN_DEG: f64 = 60.0;

/// Largest accepted RMS deviation of the shaft's direction from its mean, degrees.
const WOBBLE_DEG: f64 = 5.0;

/// Largest accepted standard error of the axis, degrees.
const ERROR_DEG: f64 = 2.0;

/// Number of parts of a recording of which one at a time is left out for the standard error.
const PARTS: usize = 10;

/// Smallest distance along the axis, mm, that shows its sense.
const SENSE_MM: f64 = 5.0;

/// A calibrated axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Spin {
    /// Unit vector along the shaft in the frame of its sensor. Its sense is unknown: the largest component is positive.
    pub axis: DVec3,
    /// Standard error of the axis, degrees, also for errors that persist over a tenth of the recording (jackknife).
    pub axis_deg: f64,
    /// RMS deviation of the shaft's direction from its mean, degrees.
    pub wobble_deg: f64,
    /// Largest rotation found between two poses, degrees, up to 180: a lower bound, at least half of the true maximum.
    pub turn_deg: f64,
    /// Number of poses used.
    pub poses: usize,
}

impl fmt::Display for Spin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { axis, axis_deg, wobble_deg, turn_deg, poses } = self;
        writeln!(f, "axis in the sensor's frame    [{:.5}, {:.5}, {:.5}]", axis.x, axis.y, axis.z)?;
        writeln!(f, "standard error of the axis    {axis_deg:.3}°")?;
        writeln!(f, "movement of the shaft         {wobble_deg:.2}° RMS; turned by {turn_deg:.0}° over {poses} poses")
    }
}

/// Reason for a failed spin calibration.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum SpinError {
    /// Too few poses.
    #[error("{found} poses are too few: a spin calibration needs at least {LEAST_POSES}, better a few hundred")]
    TooFew {
        /// Number of poses given.
        found: usize,
    },
    /// Too little turn about the shaft.
    #[error(
        "the needle was turned by {turn_deg:.0}° only; turn it about its own shaft by at least {LEAST_TURN_DEG}°, better by half a turn each way (a sensor of five degrees of freedom doesn't measure this turn: its maker states the axis)"
    )]
    LittleTurn {
        /// Largest rotation found, degrees.
        turn_deg: f64,
    },
    /// A shaft whose direction changed.
    #[error(
        "the shaft moved by {wobble_deg:.1}° RMS, at most {WOBBLE_DEG}; turn the needle about its own shaft only, in a groove or a tube that doesn't move (poses of a needle that is tilted about its tip are for `insonify calibrate pivot --of needle`)"
    )]
    Wobble {
        /// RMS deviation of the shaft's direction from its mean, degrees.
        wobble_deg: f64,
    },
    /// An uncertain axis.
    #[error(
        "the axis is certain to {axis_deg:.1}° only, at most {ERROR_DEG}; turn the needle evenly to and fro during the whole recording, and don't move the shaft"
    )]
    Uncertain {
        /// Standard error of the axis, degrees.
        axis_deg: f64,
    },
}

/// Finds the axis from `tracker_from_sensor` of a needle that is turned about its shaft.
///
/// # Errors
/// Fewer than 20 poses, turns of less than 60°, a shaft that moved, or an uncertain axis.
pub fn calibrate(tracker_from_sensor: &[Pose]) -> Result<Spin, SpinError> {
    let poses = tracker_from_sensor;
    if poses.len() < LEAST_POSES {
        return Err(SpinError::TooFew { found: poses.len() });
    }
    let turn_deg = widest_turn(poses).to_degrees();
    if turn_deg < LEAST_TURN_DEG {
        return Err(SpinError::LittleTurn { turn_deg });
    }
    let (axis, wobble_deg) = steadiest_axis(poses);
    if wobble_deg > WOBBLE_DEG {
        return Err(SpinError::Wobble { wobble_deg });
    }
    let axis_deg = standard_error_deg(poses, axis);
    if axis_deg > ERROR_DEG {
        return Err(SpinError::Uncertain { axis_deg });
    }
    let axis = axis * largest_component(axis).signum();
    Ok(Spin { axis, axis_deg, wobble_deg, turn_deg, poses: poses.len() })
}

/// Direction in the sensor's frame that moves least in the tracker's frame, and the RMS deviation from its mean,
/// degrees. The sense of the direction is arbitrary.
pub(super) fn steadiest_axis(poses: &[Pose]) -> (DVec3, f64) {
    least_moved(sum_of_rotations(poses), poses.len())
}

/// Sense of an axis: 1 if it points from the sensor to `end_mm` (sensor's frame), −1 if away from it. `None` if the end
/// lies too near the plane through the sensor across the axis: within 5 mm, or within `part` of its distance.
pub(super) fn sense(axis: DVec3, end_mm: DVec3, part: f64) -> Option<f64> {
    let along_mm = axis.dot(end_mm);
    (along_mm.abs() >= SENSE_MM.max(part * end_mm.length())).then(|| along_mm.signum())
}

fn sum_of_rotations(poses: &[Pose]) -> Matrix3<f64> {
    poses.iter().map(rotation_matrix).sum()
}

/// [`steadiest_axis`] of `count` rotations with this sum. Rotations are orthogonal, so Σ(R − R̄)ᵀ(R − R̄) = n(1 − R̄ᵀR̄).
fn least_moved(sum: Matrix3<f64>, count: usize) -> (DVec3, f64) {
    let mean = sum / count.max(1) as f64;
    let eigen = (Matrix3::identity() - mean.transpose() * mean).symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    let axis = DVec3::from_array(eigen.eigenvectors.column(least).into_owned().into());
    (axis, eigen.eigenvalues[least].max(0.0).sqrt().to_degrees())
}

/// Standard error of `axis`, degrees, from the axes of recordings with one part left out (jackknife).
fn standard_error_deg(poses: &[Pose], axis: DVec3) -> f64 {
    let all = sum_of_rotations(poses);
    let squares = (0..PARTS).map(|part| {
        let left_out = &poses[part * poses.len() / PARTS..(part + 1) * poses.len() / PARTS];
        let (other, _) = least_moved(all - sum_of_rotations(left_out), poses.len() - left_out.len());
        axis.cross(other).length().atan2(axis.dot(other).abs()).powi(2)
    });
    let n = PARTS as f64;
    ((n - 1.0) / n * squares.sum::<f64>()).sqrt().to_degrees()
}

/// Component with the largest magnitude.
fn largest_component(v: DVec3) -> f64 {
    v.to_array().into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use glam::DQuat;
    use proptest::prelude::*;

    use super::super::transform::any_pose;
    use super::*;
    use crate::random::SplitMix64;

    fn shaft() -> DVec3 {
        DVec3::new(0.1, -0.3, 0.9).normalize()
    }

    /// Poses of a needle that is turned to and fro by up to `spin` rad about `shaft()`. Its shaft wanders slowly by up to
    /// `wander` rad, and each axis of the sensor has noise with a standard deviation of `noise_deg`.
    fn spun(count: usize, spin: f64, wander: f64, noise_deg: f64, seed: u64) -> Vec<Pose> {
        let mut random = SplitMix64::new(seed);
        // The sum of twelve numbers of 0..1 has the variance 1 and is nearly normal.
        let mut normal = || (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
        let pose = |i: usize| {
            let part = i as f64 / count as f64;
            let lean = DVec3::new((3.0 * TAU * part).cos(), (7.1 * TAU * part).sin(), 0.0);
            let noise = noise_deg.to_radians() * DVec3::new(normal(), normal(), normal());
            let orientation = DQuat::from_scaled_axis(wander * lean)
                * DQuat::from_rotation_x(1.1)
                * DQuat::from_axis_angle(shaft(), spin * (2.0 * TAU * part).sin())
                * DQuat::from_scaled_axis(noise);
            Pose { position_mm: DVec3::new(200.0, -40.0, 90.0), orientation }
        };
        (0..count).map(pose).collect()
    }

    fn off_deg(axis: DVec3) -> f64 {
        axis.cross(shaft()).length().atan2(axis.dot(shaft()).abs()).to_degrees()
    }

    #[test]
    fn exact_poses_give_the_axis() {
        let found = calibrate(&spun(200, 1.5, 0.0, 0.0, 1)).unwrap();
        assert!(off_deg(found.axis) < 1e-6 && found.axis.z > 0.0, "{found:?}");
        assert!(found.axis_deg < 1e-6 && found.wobble_deg < 1e-5 && found.turn_deg > 160.0, "{found:?}");
    }

    #[test]
    fn noise_of_a_third_of_a_degree_costs_some_hundredths() {
        let (mut squares, mut predicted) = (0.0, 0.0);
        for seed in 0..64 {
            let found = calibrate(&spun(300, 1.5, 0.0, 0.3, seed)).unwrap();
            assert!(off_deg(found.axis) < 0.12, "{seed}: {found:?}");
            squares += off_deg(found.axis).powi(2) / 64.0;
            predicted += found.axis_deg.powi(2) / 64.0;
        }
        let [rms, predicted] = [squares, predicted].map(f64::sqrt);
        assert!((0.01..0.05).contains(&rms), "{rms}");
        assert!((0.7..1.5).contains(&(predicted / rms)), "predicted {predicted}°, found {rms}°");
    }

    #[test]
    fn the_standard_error_covers_a_shaft_that_wanders() {
        for wander in [0.01, 0.03] {
            let found = calibrate(&spun(300, 1.5, wander, 0.3, 5)).unwrap();
            assert!(off_deg(found.axis) < 3.0 * found.axis_deg, "{} {found:?}", off_deg(found.axis));
            assert!(found.axis_deg < 0.7 * found.wobble_deg, "{found:?}");
        }
    }

    #[test]
    fn wrong_motions_are_refused_with_what_to_do() {
        let refused = |poses: &[Pose]| calibrate(poses).unwrap_err().to_string();
        assert_eq!(calibrate(&spun(19, 1.5, 0.0, 0.0, 1)), Err(SpinError::TooFew { found: 19 }));
        let little = refused(&spun(200, 0.4, 0.0, 0.3, 1));
        assert!(little.starts_with("the needle was turned by 4") && little.contains("at least 60°"), "{little}");
        let shaky = refused(&spun(200, 1.5, 0.2, 0.3, 1));
        assert!(shaky.contains("° RMS, at most 5") && shaky.contains("in a groove or a tube"), "{shaky}");
        let mut pivoted = spun(200, 0.0, 0.0, 0.0, 1);
        for (i, pose) in pivoted.iter_mut().enumerate() {
            let angle = 5.0 * TAU * i as f64 / 200.0;
            let lean = DQuat::from_axis_angle(DVec3::new(angle.cos(), angle.sin(), 0.0), 0.6);
            pose.orientation = lean * pose.orientation;
        }
        let pivoted = refused(&pivoted);
        assert!(pivoted.contains("`insonify calibrate pivot --of needle`"), "{pivoted}");
        // One damaged pose doesn't make a turn.
        let mut glitch = spun(200, 0.0, 0.0, 0.3, 1);
        glitch[70].orientation *= DQuat::from_rotation_y(1.5);
        let glitch = calibrate(&glitch);
        assert!(matches!(glitch, Err(SpinError::Uncertain { .. })), "{glitch:?}");
    }

    #[test]
    fn the_sense_is_told_by_an_end_that_is_not_level_with_the_sensor() {
        assert_eq!(sense(DVec3::Z, DVec3::new(20.0, 0.0, 90.0), 0.25), Some(1.0));
        assert_eq!(sense(DVec3::NEG_Z, DVec3::new(20.0, 0.0, 90.0), 0.25), Some(-1.0));
        assert_eq!(sense(DVec3::Z, DVec3::new(90.0, 0.0, 20.0), 0.25), None);
        assert_eq!(sense(DVec3::Z, DVec3::new(0.0, 0.0, 4.0), 0.25), None);
        assert_eq!(sense(DVec3::Z, DVec3::NAN, 0.25), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn the_axis_follows_the_sensor_and_not_the_tracker(
            tracker in any_pose(),
            sensor in any_pose(),
            signs in prop::collection::vec(any::<bool>(), 100),
        ) {
            let poses = spun(100, 1.2, 0.02, 0.3, 9);
            let before = calibrate(&poses).unwrap();
            let moved: Vec<Pose> = poses.iter().zip(signs).map(|(pose, negate)| {
                let pose = tracker * *pose * sensor;
                Pose { orientation: if negate { -pose.orientation } else { pose.orientation }, ..pose }
            }).collect();
            let found = calibrate(&moved).unwrap();
            let expected = sensor.inverse().transform_vector(before.axis);
            prop_assert!(found.axis.cross(expected).length() < 1e-9, "{:?} {:?}", found.axis, expected);
            prop_assert!((found.axis_deg - before.axis_deg).abs() < 1e-6);
            prop_assert!((found.wobble_deg - before.wobble_deg).abs() < 1e-6);
        }
    }
}
