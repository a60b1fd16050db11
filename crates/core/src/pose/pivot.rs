//! Pivot calibration: finds the tip of a stylus in the frame of its sensor. The stylus is turned about its tip, which
//! rests in a dimple.
//!
//! Every pose (R, t) puts the tip at the pivot: R·tip + t = pivot. Subtracting the mean eliminates the pivot: (R −
//! R̄)·tip = −(t − t̄), linear least squares with three unknowns ("algebraic two-step" in Yaniv, Which pivot
//! calibration?, SPIE 9415, 2015).

use std::fmt;

use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;
use thiserror::Error;

use super::Pose;
use super::transform::angle_between;

/// Smallest accepted number of poses.
const LEAST_POSES: usize = 10;

/// Smallest accepted rotation between the two most different poses, degrees.
const LEAST_TURN_DEG: f64 = 30.0;

/// Largest accepted condition number of the least-squares problem.
const CONDITION_LIMIT: f64 = 25.0;

/// A calibrated tip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pivot {
    /// The tip in the frame of its sensor, mm.
    pub tip_mm: DVec3,
    /// Position of the resting tip in the tracker's frame, mm.
    pub pivot_mm: DVec3,
    /// RMS distance of the tip from the pivot, mm.
    pub rms_mm: f64,
    /// Largest distance of the tip from the pivot, mm.
    pub max_mm: f64,
    /// Standard error of the tip in its least certain direction, mm, if the errors of the poses are independent.
    pub tip_error_mm: f64,
    /// Condition number of the least-squares problem; 1 is best, for rotations about all axes.
    pub condition: f64,
    /// Largest rotation found between two poses, degrees: a lower bound, at least half of the true maximum.
    pub turn_deg: f64,
    /// Number of poses used.
    pub poses: usize,
}

/// Distance of a tip from its sensor, mm, below which the positions are likely in metres.
pub const METRES_BELOW_MM: f64 = 1.0;

/// Distance of a dimple from the tracker, mm, below which the positions are likely in metres.
const DIMPLE_BELOW_MM: f64 = 20.0;

impl Pivot {
    /// Whether the positions were likely in metres. The tip then seems to be a fraction of a millimetre from the
    /// sensor, and the dimple a few millimetres from the tracker. A tool with its origin at the tip is different: its
    /// dimple is far from the tracker.
    pub fn looks_like_metres(&self) -> bool {
        self.tip_mm.length() < METRES_BELOW_MM && self.pivot_mm.length() < DIMPLE_BELOW_MM
    }
}

/// Rewrites a quaternion from another component order or convention.
type Rewrite = fn(DQuat) -> DQuat;

/// Ways in which quaternions are misread: the remedy in words, and the function that applies it.
const MISREADINGS: [(&str, Rewrite); 3] = [
    ("read as x,y,z,w (the columns are qx,qy,qz,qw)", |q| DQuat::from_xyzw(q.w, q.x, q.y, q.z)),
    ("read as w,x,y,z (the columns are qw,qx,qy,qz)", |q| DQuat::from_xyzw(q.y, q.z, q.w, q.x)),
    ("with the opposite turn (conjugate: negate qx, qy and qz)", |q| q.conjugate()),
];

/// Limits of the RMS residual once a misreading is undone: this fraction of the original residual, and this many mm.
const MISREAD: (f64, f64) = (0.3, 3.0);

/// Finds the misreading of the quaternions that explains a moving tip: with the misreading undone, the tip rests.
/// Returns it in words; `None` if no misreading explains the movement.
pub fn misreading(tracker_from_sensor: &[Pose]) -> Option<String> {
    let rms_mm = |poses: &[Pose]| calibrate(poses).map_or(f64::INFINITY, |found| found.rms_mm);
    let limit_mm = MISREAD.1.min(MISREAD.0 * rms_mm(tracker_from_sensor));
    let tried = MISREADINGS.iter().map(|(what, rewrite)| {
        let poses = tracker_from_sensor.iter().map(|p| Pose { orientation: rewrite(p.orientation), ..*p });
        (what, rms_mm(&poses.collect::<Vec<_>>()))
    });
    let (what, rms_mm) = tried.min_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, rms_mm)| *rms_mm < limit_mm)?;
    Some(format!("the quaternions were likely misread: {what}, the point rests within {rms_mm:.2} mm RMS"))
}

/// Text of `fault`, followed by the misreading of quaternions that explains it, if there is one.
pub fn explained(fault: impl fmt::Display, tracker_from_sensor: &[Pose]) -> String {
    misreading(tracker_from_sensor).map_or_else(|| fault.to_string(), |likely| format!("{fault}; {likely}"))
}

impl fmt::Display for Pivot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { tip_mm: tip, pivot_mm: pivot, rms_mm, max_mm, tip_error_mm, condition, turn_deg, poses } = self;
        writeln!(f, "tip in the sensor's frame     [{:.3}, {:.3}, {:.3}] mm", tip.x, tip.y, tip.z)?;
        writeln!(f, "pivot in the tracker's frame  [{:.3}, {:.3}, {:.3}] mm", pivot.x, pivot.y, pivot.z)?;
        writeln!(f, "residual                      RMS {rms_mm:.3} mm, at most {max_mm:.3} mm")?;
        writeln!(f, "standard error of the tip     {tip_error_mm:.3} mm")?;
        writeln!(f, "condition number              {condition:.1}; turned by {turn_deg:.0}° over {poses} poses")
    }
}

/// Reason for a failed pivot calibration.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum PivotError {
    /// Too few poses.
    #[error("{found} poses are too few: a pivot calibration needs at least {LEAST_POSES}, better a few hundred")]
    TooFew {
        /// Number of poses given.
        found: usize,
    },
    /// Too little rotation.
    #[error(
        "the tool was turned by {turn_deg:.1}° only; tilt it by at least {LEAST_TURN_DEG}° to all sides while its tip rests"
    )]
    TooLittleTurn {
        /// Largest rotation found, degrees.
        turn_deg: f64,
    },
    /// Rotation about one axis only.
    #[error(
        "the tool was turned about nearly one axis (condition number {condition:.0}, at most {CONDITION_LIMIT}): the tip's place along it is unknown; tilt it to all sides"
    )]
    OneAxis {
        /// Condition number found.
        condition: f64,
    },
}

/// Finds the tip from `tracker_from_sensor` of a stylus that turns about its tip.
///
/// # Errors
/// Fewer than ten poses, rotations of less than 30°, or rotation about nearly one axis only.
pub fn calibrate(tracker_from_sensor: &[Pose]) -> Result<Pivot, PivotError> {
    let poses = tracker_from_sensor;
    if poses.len() < LEAST_POSES {
        return Err(PivotError::TooFew { found: poses.len() });
    }
    let turn_deg = widest_turn(poses).to_degrees();
    if turn_deg < LEAST_TURN_DEG {
        return Err(PivotError::TooLittleTurn { turn_deg });
    }
    let n = poses.len() as f64;
    let translation = |p: &Pose| Vector3::from(p.position_mm.to_array());
    let mean_r = poses.iter().map(rotation_matrix).sum::<Matrix3<f64>>() / n;
    let mean_t = poses.iter().map(translation).sum::<Vector3<f64>>() / n;
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for pose in poses {
        let r = rotation_matrix(pose) - mean_r;
        normal += r.transpose() * r;
        right -= r.transpose() * (translation(pose) - mean_t);
    }
    // The condition number of the normal matrix is the square of the problem's. Up to the limit of 25, f64 is precise
    // enough.
    let eigen = normal.symmetric_eigen();
    let (least, most) = (eigen.eigenvalues.min(), eigen.eigenvalues.max());
    let condition = if least > 0.0 { (most / least).sqrt() } else { f64::INFINITY };
    if condition > CONDITION_LIMIT {
        return Err(PivotError::OneAxis { condition });
    }
    let tip = eigen.eigenvectors * (eigen.eigenvectors.transpose() * right).component_div(&eigen.eigenvalues);
    let tip_mm = DVec3::from_array(tip.into());
    let pivot_mm = DVec3::from_array((mean_r * tip + mean_t).into());
    let distance = |p: &Pose| p.transform_point(tip_mm).distance(pivot_mm);
    let squares: f64 = poses.iter().map(|p| distance(p).powi(2)).sum();
    // Each pose gives three equations; there are six unknowns.
    let deviation_mm = (squares / (3.0 * n - 6.0)).sqrt();
    Ok(Pivot {
        tip_mm,
        pivot_mm,
        rms_mm: (squares / n).sqrt(),
        max_mm: poses.iter().map(distance).fold(0.0, f64::max),
        tip_error_mm: deviation_mm / least.sqrt(),
        condition,
        turn_deg,
        poses: poses.len(),
    })
}

/// Rotation matrix of a pose.
pub(super) fn rotation_matrix(pose: &Pose) -> Matrix3<f64> {
    DMat3::from_quat(pose.orientation).to_cols_array_2d().into()
}

/// Rotation between the pose B farthest from the first pose, and the pose farthest from B, rad. It is at least half of
/// the largest rotation between two poses.
pub(super) fn widest_turn(poses: &[Pose]) -> f64 {
    let farthest = |from: &Pose| {
        let angles = poses.iter().map(|p| (angle_between(from.orientation, p.orientation), p));
        angles.max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let second = poses.first().and_then(farthest).and_then(|(_, p)| farthest(p));
    second.map_or(0.0, |(angle, _)| angle)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use proptest::prelude::*;

    use super::*;

    const TIP: DVec3 = DVec3::new(3.0, -8.0, 145.0);
    const PIVOT: DVec3 = DVec3::new(210.0, -90.0, 40.0);

    /// A stylus that circles about its pivot, tilted by up to `tilt` and spun by up to `spin`, rad.
    fn circling(count: usize, tilt: f64, spin: f64) -> Vec<Pose> {
        let pose = |i: usize| {
            let part = i as f64 / count as f64;
            let axis = DVec3::new((5.0 * TAU * part).cos(), (5.0 * TAU * part).sin(), 0.0);
            let lean = DQuat::from_axis_angle(axis, tilt * (0.3 + 0.7 * part));
            let orientation = lean * DQuat::from_rotation_z(spin * (3.0 * TAU * part).sin());
            Pose { position_mm: PIVOT - orientation * TIP, orientation }
        };
        (0..count).map(pose).collect()
    }

    #[test]
    fn exact_poses_give_the_tip_and_the_pivot() {
        let found = calibrate(&circling(200, 0.6, 0.5)).unwrap();
        assert!(found.tip_mm.distance(TIP) < 1e-9 && found.pivot_mm.distance(PIVOT) < 1e-9, "{found:?}");
        assert!(found.rms_mm < 1e-9 && found.condition < 10.0 && found.turn_deg > 60.0, "{found:?}");
    }

    #[test]
    fn too_little_rotation_and_one_axis_are_refused() {
        assert_eq!(calibrate(&circling(9, 0.6, 0.5)), Err(PivotError::TooFew { found: 9 }));
        let little = calibrate(&circling(200, 0.1, 0.0)).unwrap_err();
        assert!(matches!(little, PivotError::TooLittleTurn { turn_deg } if turn_deg < 12.0), "{little}");
        let spun = calibrate(&circling(200, 0.0, 1.5)).unwrap_err();
        assert!(spun.to_string().contains("about nearly one axis"), "{spun}");
        let still = calibrate(&[circling(1, 0.6, 0.0)[0]; 50]).unwrap_err();
        assert!(matches!(still, PivotError::TooLittleTurn { .. }), "{still}");
    }

    #[test]
    fn misread_quaternions_are_recognised_and_slips_are_not() {
        let all = circling(200, 0.6, 0.5);
        let written = |rewrite: Rewrite| -> Vec<Pose> {
            all.iter().map(|p| Pose { orientation: rewrite(p.orientation), ..*p }).collect()
        };
        // Each misreading is undone by another one or by itself.
        for (rewrite, words) in [
            (MISREADINGS[1].1, "read as x,y,z,w (the columns are qx,qy,qz,qw), the point rests within 0.00 mm"),
            (MISREADINGS[0].1, "read as w,x,y,z"),
            (MISREADINGS[2].1, "with the opposite turn"),
        ] {
            let found = explained("it moved", &written(rewrite));
            assert!(found.starts_with("it moved; ") && found.contains(words), "{found}");
        }
        let slipped =
            |(i, p): (usize, &Pose)| Pose { position_mm: p.position_mm + DVec3::X * (i % 2 * 20) as f64, ..*p };
        let slipped: Vec<Pose> = all.iter().enumerate().map(slipped).collect();
        assert_eq!((misreading(&slipped), misreading(&all), misreading(&[])), (None, None, None));
        assert_eq!(explained("it moved", &slipped), "it moved");
    }

    #[test]
    fn metres_are_told_from_a_tool_whose_origin_is_its_tip() {
        let metres = |p: Pose| Pose { position_mm: 1e-3 * p.position_mm, ..p };
        let small = circling(200, 0.6, 0.5).into_iter().map(metres).collect::<Vec<_>>();
        assert!(calibrate(&small).unwrap().looks_like_metres());
        let at_tip = |p: Pose| Pose { position_mm: PIVOT, ..p };
        let resting = circling(200, 0.6, 0.5).into_iter().map(at_tip).collect::<Vec<_>>();
        assert!(!calibrate(&resting).unwrap().looks_like_metres());
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn noise_moves_the_tip_by_about_its_standard_error(
            noise in prop::collection::vec(prop::array::uniform3(-0.5..0.5_f64), 300),
            signs in prop::collection::vec(any::<bool>(), 300),
        ) {
            let mut poses = circling(300, 0.6, 0.5);
            for ((pose, noise), negate) in poses.iter_mut().zip(noise).zip(signs) {
                pose.position_mm += DVec3::from_array(noise);
                pose.orientation = if negate { -pose.orientation } else { pose.orientation };
            }
            let found = calibrate(&poses).unwrap();
            // Uniform noise of ±0.5 mm on three axes has an RMS of 0.5 mm.
            prop_assert!((found.rms_mm - 0.5).abs() < 0.06, "{:?}", found);
            prop_assert!(found.tip_mm.distance(TIP) < 6.0 * found.tip_error_mm, "{:?}", found);
            prop_assert!(found.tip_error_mm < 0.2, "{:?}", found);
        }
    }
}
