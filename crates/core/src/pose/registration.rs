//! Registration of tracker and scene: a rigid fit of paired landmarks.
//!
//! Least squares by singular values (Kabsch, Acta Cryst A 32:922, 1976; Arun, Huang & Blostein, IEEE PAMI 9:698, 1987;
//! with the proper rotation of Umeyama, IEEE PAMI 13:376, 1991). Horn's quaternion method gives the same rotation.

use std::ops::RangeInclusive;

use glam::{DMat3, DQuat, DVec3};
use nalgebra::{Matrix3, Vector3};
use thiserror::Error;

use super::{POSITION_LIMIT_MM, Pose};

/// Points are collinear if the ratio of their second to their first principal extent is below this.
const COLLINEAR: f64 = 0.05;

/// Points are coplanar if the ratio of their third to their first principal extent is below this.
const COPLANAR: f64 = 0.05;

/// Points coincide if their RMS distance from their centroid is below this, mm.
const LEAST_EXTENT_MM: f64 = 5.0;

/// Largest accepted ratio of distances in the tracker's frame to distances in the scene, or vice versa.
const SCALE_TOLERANCE: f64 = 1.25;

/// Ratios of distances that a wrong unit explains, from units of 0.1 mm to units of 10 m.
const UNIT_RATIOS: RangeInclusive<f64> = 1e-4..=1e4;

/// Two point sets have the same shape if, scaled to one size, they fit with a smaller RMS residual than this fraction
/// of their extent.
const SAME_SHAPE: f64 = 0.1;

/// A mirror image is reported if its fit is better by this factor and by this many mm.
const MIRRORED: (f64, f64) = (2.0, 1.0);

/// Limit on the iterations of the singular value decomposition; a few suffice.
const SVD_STEPS: usize = 1000;

/// One landmark in both frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointPair {
    /// Coordinates in the scene, mm.
    pub scene_mm: DVec3,
    /// Coordinates measured by the tracker, mm.
    pub tracker_mm: DVec3,
}

/// A transform fitted to landmarks.
#[derive(Debug, Clone, PartialEq)]
pub struct Registration {
    /// Rigid transform with the smallest sum of squared residuals.
    pub scene_from_tracker: Pose,
    /// Fiducial registration error: RMS of the residuals, mm.
    pub rms_mm: f64,
    /// Distance of each landmark from its transformed measurement, mm, in the order of the pairs.
    pub residuals_mm: Vec<f64>,
    /// Whether all landmarks are near one plane: a mirrored tracker axis then cannot be detected.
    pub coplanar: bool,
}

/// Reason for a failed registration.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum RegistrationError {
    /// Fewer than three pairs.
    #[error("{found} landmarks are too few: a rigid fit needs at least 3, better 6 or more around the field of view")]
    TooFew {
        /// Number of pairs given.
        found: usize,
    },
    /// A coordinate that is not finite or is out of range.
    #[error(
        "coordinate `{name}` of landmark {number} is {value}; it must be a number within ±{POSITION_LIMIT_MM} mm (is the unit wrong?)"
    )]
    Coordinate {
        /// Number of the landmark, from 1.
        number: usize,
        /// One of x y z (scene) or tx ty tz (tracker).
        name: &'static str,
        /// Value of the coordinate.
        value: f64,
    },
    /// All points coincide.
    #[error(
        "the {frame}'s landmarks lie within {extent_mm:.2} mm (RMS) of one point; spread them over at least {LEAST_EXTENT_MM} mm, better over the whole field"
    )]
    OnePoint {
        /// Frame of the points: `scene` or `tracker`.
        frame: &'static str,
        /// RMS distance from the centroid, mm.
        extent_mm: f64,
    },
    /// All points are on one line.
    #[error(
        "the {frame}'s landmarks lie on one line ({length_mm:.1} mm long, {width_mm:.2} mm wide, RMS): the turn about it is unknown; add one well beside it"
    )]
    Collinear {
        /// Frame of the points: `scene` or `tracker`.
        frame: &'static str,
        /// RMS extent along the line, mm.
        length_mm: f64,
        /// RMS extent across the line, mm.
        width_mm: f64,
    },
    /// Distances between the points differ between tracker and scene.
    #[error(
        "distances between the tracker's points are {ratio:.4} times those between the scene's: is a unit wrong (cm 0.1, inches 0.0394, m 0.001), or are landmarks mixed up?"
    )]
    Scale {
        /// Ratio of distances: tracker over scene.
        ratio: f64,
    },
    /// The singular value decomposition did not converge.
    #[error("the landmarks could not be fitted: the singular values of their covariance did not converge")]
    Unsolved,
    /// The mirror image of the landmarks fits better.
    #[error(
        "the tracker's points are a mirror image of the scene's (RMS {mirrored_rms_mm:.2} mm mirrored, {rms_mm:.2} mm as they are): an axis of the tracker is reversed, or left and right landmarks are swapped"
    )]
    Mirrored {
        /// RMS residual of the proper fit, mm.
        rms_mm: f64,
        /// RMS residual of the mirrored fit, mm.
        mirrored_rms_mm: f64,
    },
}

/// Fits `scene_from_tracker` to landmarks.
///
/// # Errors
/// Fewer than three pairs, coordinates out of range, coincident or collinear landmarks, distances that differ by more
/// than a quarter, or points whose mirror image fits much better.
pub fn register(pairs: &[PointPair]) -> Result<Registration, RegistrationError> {
    if pairs.len() < 3 {
        return Err(RegistrationError::TooFew { found: pairs.len() });
    }
    pairs.iter().enumerate().try_for_each(|(i, pair)| check(i + 1, pair))?;
    let centred = Centred::of(pairs);
    let scene_spread = centred.mean(|s, _| s * s.transpose());
    let tracker_spread = centred.mean(|_, t| t * t.transpose());
    let ratio = (tracker_spread.trace() / scene_spread.trace()).sqrt();
    // A wrong unit also makes points lie close together; then the unit is reported.
    let named = |fault: RegistrationError| match fault {
        RegistrationError::OnePoint { .. } if is_other_unit(pairs, ratio, scene_spread.trace().sqrt()) => {
            RegistrationError::Scale { ratio }
        }
        fault => fault,
    };
    let scene_extent = extent("scene", &scene_spread).map_err(named)?;
    let tracker_extent = extent("tracker", &tracker_spread).map_err(named)?;
    if !(1.0 / SCALE_TOLERANCE..=SCALE_TOLERANCE).contains(&ratio) {
        return Err(RegistrationError::Scale { ratio });
    }

    let [rotation, mirrored] = centred.rotations().ok_or(RegistrationError::Unsolved)?;
    let (rms_mm, mirrored_rms_mm) = (centred.rms_mm(rotation), centred.rms_mm(mirrored));
    if rms_mm > MIRRORED.0 * mirrored_rms_mm && rms_mm - mirrored_rms_mm > MIRRORED.1 {
        return Err(RegistrationError::Mirrored { rms_mm, mirrored_rms_mm });
    }

    let columns: [[f64; 3]; 3] = rotation.into();
    let orientation = DQuat::from_mat3(&DMat3::from_cols_array_2d(&columns)).normalize();
    let scene_from_tracker = Pose { position_mm: centred.scene_mean - orientation * centred.tracker_mean, orientation };
    let residual = |p: &PointPair| p.scene_mm.distance(scene_from_tracker.transform_point(p.tracker_mm));
    let coplanar = [scene_extent, tracker_extent].iter().any(|e| e[2] < COPLANAR * e[0]);
    Ok(Registration { scene_from_tracker, rms_mm, residuals_mm: pairs.iter().map(residual).collect(), coplanar })
}

/// Whether the tracker's points have the same shape as the scene's points, with distances `ratio` times as large.
/// `scene_extent_mm` is the RMS extent of the scene's points.
fn is_other_unit(pairs: &[PointPair], ratio: f64, scene_extent_mm: f64) -> bool {
    if !UNIT_RATIOS.contains(&ratio) {
        return false;
    }
    let scaled = |p: &PointPair| PointPair { tracker_mm: p.tracker_mm / ratio, ..*p };
    let rms_mm = rms_of_fit(&pairs.iter().map(scaled).collect::<Vec<_>>());
    rms_mm.is_some_and(|rms_mm| rms_mm < SAME_SHAPE * scene_extent_mm)
}

/// RMS residual of the best rigid fit, mm, without the checks of [`register`]; `None` if there is no fit.
pub(crate) fn rms_of_fit(pairs: &[PointPair]) -> Option<f64> {
    if pairs.is_empty() {
        return None;
    }
    let centred = Centred::of(pairs);
    let [rotation, _] = centred.rotations()?;
    Some(centred.rms_mm(rotation))
}

/// Landmarks relative to their centroids.
struct Centred {
    scene_mean: DVec3,
    tracker_mean: DVec3,
    /// Points in the scene and in the tracker's frame, each relative to their mean, mm.
    points: Vec<(Vector3<f64>, Vector3<f64>)>,
}

impl Centred {
    /// Landmarks of `pairs` relative to their centroids; `pairs` must not be empty.
    fn of(pairs: &[PointPair]) -> Self {
        let n = pairs.len() as f64;
        let scene_mean = pairs.iter().map(|p| p.scene_mm).sum::<DVec3>() / n;
        let tracker_mean = pairs.iter().map(|p| p.tracker_mm).sum::<DVec3>() / n;
        let centred = |p: &PointPair| (vector(p.scene_mm - scene_mean), vector(p.tracker_mm - tracker_mean));
        Self { scene_mean, tracker_mean, points: pairs.iter().map(centred).collect() }
    }

    /// Mean over all landmarks of `product`, a function of the points in scene and tracker.
    fn mean(&self, product: impl Fn(Vector3<f64>, Vector3<f64>) -> Matrix3<f64>) -> Matrix3<f64> {
        let sum = self.points.iter().fold(Matrix3::<f64>::zeros(), |sum, &(s, t)| sum + product(s, t));
        sum / self.points.len() as f64
    }

    /// Rotation that fits the tracker's points to the scene's best, and the best rotation with a reflection; `None` if
    /// there is no fit.
    fn rotations(&self) -> Option<[Matrix3<f64>; 2]> {
        let covariance = self.mean(|s, t| s * t.transpose());
        if !covariance.iter().all(|value| value.is_finite()) {
            return None;
        }
        let svd = covariance.try_svd(true, true, 5.0 * f64::EPSILON, SVD_STEPS)?;
        let (u, v_t) = svd.u.zip(svd.v_t)?;
        // The last singular value is the smallest. If the best orthogonal fit is a reflection, reversing its axis gives
        // the best rotation.
        let handedness = (u * v_t).determinant().signum();
        let orthogonal = |sign: f64| u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
        Some([orthogonal(handedness), orthogonal(-handedness)])
    }

    /// RMS distance between the scene's points and the rotated points of the tracker, mm.
    fn rms_mm(&self, rotation: Matrix3<f64>) -> f64 {
        let squares: f64 = self.points.iter().map(|&(s, t)| (s - rotation * t).norm_squared()).sum();
        (squares / self.points.len() as f64).sqrt()
    }
}

fn vector(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn check(number: usize, pair: &PointPair) -> Result<(), RegistrationError> {
    let names = ["x", "y", "z", "tx", "ty", "tz"];
    let values = pair.scene_mm.to_array().into_iter().chain(pair.tracker_mm.to_array());
    match names.into_iter().zip(values).find(|(_, value)| !value.is_finite() || value.abs() > POSITION_LIMIT_MM) {
        Some((name, value)) => Err(RegistrationError::Coordinate { number, name, value }),
        None => Ok(()),
    }
}

/// RMS extents of points along their principal axes, mm, descending; an error if they leave the rigid fit undetermined.
fn extent(frame: &'static str, spread: &Matrix3<f64>) -> Result<[f64; 3], RegistrationError> {
    let mut extents: [f64; 3] = spread.symmetric_eigenvalues().into();
    extents.sort_by(|a, b| b.total_cmp(a));
    let extents = extents.map(|variance| variance.max(0.0).sqrt());
    let [length_mm, width_mm, _] = extents;
    let extent_mm = spread.trace().max(0.0).sqrt();
    if extent_mm < LEAST_EXTENT_MM {
        return Err(RegistrationError::OnePoint { frame, extent_mm });
    }
    if width_mm < COLLINEAR * length_mm {
        return Err(RegistrationError::Collinear { frame, length_mm, width_mm });
    }
    Ok(extents)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::pose::transform::{angle_between, any_pose};

    /// Landmarks about a belly, mm.
    const SCENE: [[f64; 3]; 6] = [
        [0.0, 0.0, 80.0],
        [-120.0, 10.0, 20.0],
        [118.0, -6.0, 22.0],
        [3.0, 140.0, 35.0],
        [-4.0, -130.0, 30.0],
        [60.0, 70.0, 61.0],
    ];

    fn pairs(tracker: impl Fn(DVec3) -> DVec3) -> Vec<PointPair> {
        SCENE.map(|p| PointPair { scene_mm: p.into(), tracker_mm: tracker(p.into()) }).to_vec()
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn exact_landmarks_give_back_their_transform(truth in any_pose(), count in 3..=6_usize) {
            let found = register(&pairs(|p| truth.inverse().transform_point(p))[..count]).unwrap();
            prop_assert!(found.rms_mm < 1e-9);
            prop_assert!(found.scene_from_tracker.position_mm.distance(truth.position_mm) < 1e-8);
            prop_assert!(angle_between(found.scene_from_tracker.orientation, truth.orientation) < 1e-9);
            prop_assert_eq!(found.coplanar, count == 3);
        }

        #[test]
        fn no_other_transform_fits_better(
            truth in any_pose(),
            noise in prop::array::uniform6(prop::array::uniform3(-3.0..3.0_f64)),
            shift in prop::array::uniform3(-0.5..0.5_f64),
            turn in prop::array::uniform3(-0.01..0.01_f64),
        ) {
            let mut pairs = pairs(|p| truth.inverse().transform_point(p));
            pairs.iter_mut().zip(noise).for_each(|(p, n)| p.tracker_mm += DVec3::from_array(n));
            let found = register(&pairs).unwrap();
            let sum = |pose: Pose| pairs.iter().map(|p| p.scene_mm.distance_squared(pose.transform_point(p.tracker_mm))).sum::<f64>();
            let fit = found.scene_from_tracker;
            let turned = DQuat::from_scaled_axis(turn.into()) * fit.orientation;
            let other = Pose { position_mm: fit.position_mm + DVec3::from_array(shift), orientation: turned };
            prop_assert!(sum(fit) <= sum(other) + 1e-9);
            prop_assert!((found.rms_mm - (sum(fit) / 6.0).sqrt()).abs() < 1e-9);
            prop_assert!((found.rms_mm - (found.residuals_mm.iter().map(|r| r * r).sum::<f64>() / 6.0).sqrt()).abs() < 1e-9);
        }

        #[test]
        fn a_mirrored_tracker_is_refused(truth in any_pose(), axis in 0..3_usize) {
            let mirrored = pairs(|p| {
                let mut q = truth.inverse().transform_point(p);
                q[axis] = -q[axis];
                q
            });
            let error = register(&mirrored).unwrap_err();
            prop_assert!(matches!(error, RegistrationError::Mirrored { mirrored_rms_mm, .. } if mirrored_rms_mm < 1e-9), "{error}");
        }

        #[test]
        fn no_input_panics(points in prop::collection::vec(prop::array::uniform6(prop_oneof![
            Just(0.0), Just(1.0), Just(f64::NAN), Just(f64::MAX), -1e5..1e5_f64, any::<f64>(),
        ]), 0..8)) {
            let pair = |[a, b, c, d, e, f]: [f64; 6]| PointPair { scene_mm: DVec3::new(a, b, c), tracker_mm: DVec3::new(d, e, f) };
            if let Ok(found) = register(&points.into_iter().map(pair).collect::<Vec<_>>()) {
                prop_assert!(found.rms_mm.is_finite() && found.scene_from_tracker.orientation.is_normalized());
            }
        }
    }

    #[test]
    fn one_wrong_landmark_has_the_largest_residual() {
        let mut pairs = pairs(|p| p);
        pairs[3].tracker_mm.x += 20.0;
        let found = register(&pairs).unwrap();
        let worst = (0..6).max_by(|a, b| found.residuals_mm[*a].total_cmp(&found.residuals_mm[*b]));
        assert_eq!(worst, Some(3), "{found:?}");
        assert!((3.0..10.0).contains(&found.rms_mm));
    }

    #[test]
    fn landmarks_that_cannot_be_fitted_are_refused_with_the_reason() {
        let refusal = |points: &[PointPair]| register(points).unwrap_err().to_string();
        assert!(refusal(&pairs(|p| p)[..2]).starts_with("2 landmarks are too few"));
        let line = pairs(|p| p).into_iter().map(|p| PointPair { scene_mm: DVec3::X * p.scene_mm.x, ..p });
        assert!(refusal(&line.collect::<Vec<_>>()).starts_with("the scene's landmarks lie on one line"));
        assert!(refusal(&pairs(|_| DVec3::ONE)).starts_with("the tracker's landmarks lie within 0.00 mm"));
        // A wrong unit of either side is reported, rather than the small spread that it causes.
        assert!(refusal(&pairs(|p| p / 25.4)).contains("are 0.0394 times"));
        let metres = refusal(&pairs(|p| 1e-3 * p));
        assert!(metres.contains("are 0.0010 times") && metres.contains("m 0.001"), "{metres}");
        let scene = pairs(|p| p).into_iter().map(|p| PointPair { scene_mm: 1e-3 * p.scene_mm, ..p });
        assert!(refusal(&scene.collect::<Vec<_>>()).contains("are 1000.0000 times"));
        // One position touched repeatedly is not a wrong unit.
        let shaken = pairs(|p| DVec3::new(0.1 * (7.0 * p.x).sin(), 0.1 * (5.0 * p.y).cos(), 0.1 * (3.0 * p.z).sin()));
        assert!(refusal(&shaken).starts_with("the tracker's landmarks lie within"), "{}", refusal(&shaken));
        assert!(refusal(&pairs(|p| p * 0.1)).contains("are 0.1000 times"));
        let mut nan = pairs(|p| p);
        nan[4].tracker_mm.y = f64::NAN;
        assert!(refusal(&nan).starts_with("coordinate `ty` of landmark 5 is NaN"), "{}", refusal(&nan));
    }

    #[test]
    fn noise_on_coplanar_landmarks_is_not_taken_for_a_mirror_image() {
        let flat: Vec<_> = SCENE
            .iter()
            .enumerate()
            .map(|(i, p)| {
                let scene_mm = DVec3::new(p[0], p[1], 0.0);
                let wobble = if i % 2 == 0 { 0.4 } else { -0.4 };
                PointPair { scene_mm: scene_mm + DVec3::Z * wobble, tracker_mm: scene_mm - DVec3::Z * wobble }
            })
            .collect();
        let found = register(&flat).unwrap();
        assert!(found.coplanar && found.rms_mm < 1.0);
    }
}
