//! Probe poses and their estimation.
//!
//! The **probe frame** has its origin at the centre of the transducer's face, `z` into the body, `x` lateral (towards
//! the last scanline) and `y` elevational, right-handed. The **scene frame** is the frame of the glTF file, in mm
//! (glTF metres × 1000).
//!
//! A live pose passes these stages: measurement → order by the device's counter and clock ([`stream_order`]) → time on
//! the host's clock ([`clock_regression`]) → `scene_from_tracker · tracker_from_sensor · sensor_from_probe`
//! ([`calibration`]) → [`jump_gate`] → filter ([`one_euro`]) → history ([`ring`]) → [`prediction`] to the time of
//! display, with a [`TrackingState`]. [`Estimator`] combines them. Calibrations come from [`registration`],
//! [`pivot`] and [`spin`].

use glam::{DMat3, DQuat, DVec3};
use thiserror::Error;

pub mod calibration;
pub mod clock_regression;
pub mod counters;
pub mod csv;
pub mod freehand;
pub mod jump_gate;
pub mod landmark;
mod landmark_fit;
pub mod mix_up;
pub mod needle_mount;
pub mod one_euro;
pub mod pivot;
pub mod prediction;
pub mod probe_mount;
pub mod rates;
pub mod registration;
pub mod ring;
pub mod settings;
pub mod spin;
pub mod stream_order;
pub mod stuck;
pub mod table;
pub mod tracking;

mod estimator;
mod history;
mod reading;
mod speed;
mod transform;

pub use calibration::{Calibration, CalibrationError, CalibrationSource, Fitted};
pub use counters::Counters;
pub use estimator::{Estimate, Estimator, Jump};
pub use history::{TimedPose, interpolate};
pub use landmark_fit::{LandmarkFit, LandmarkFitError, fit_so_far};
pub use reading::{Measurement, Reading};
pub use settings::{FilterSettings, Settings};
pub use speed::{BySpeed, LIMITS, ProbeSpeed, Speed};
pub use tracking::TrackingState;
pub use transform::angle_between;
pub use transform::rotation_vector;

/// Largest accepted deviation of a quaternion's norm from one.
pub const QUATERNION_NORM_TOLERANCE: f64 = 1e-3;

/// Largest accepted deviation of a rotation matrix from an orthonormal one: some programs print only four decimals.
pub const ROTATION_TOLERANCE: f64 = 1e-3;

/// Largest accepted coordinate, mm. Much larger ones are too coarse for an echo's phase: at one kilometre, f32 resolves
/// 0.06 mm.
pub const POSITION_LIMIT_MM: f64 = 1.0e5;

/// Reason why seven numbers are not a pose.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum PoseError {
    /// A component is NaN or infinite.
    #[error("pose component `{name}` is {value}; every component must be a finite number")]
    NotFinite {
        /// Component: one of x y z qw qx qy qz.
        name: &'static str,
        /// Value of the component.
        value: f64,
    },
    /// The quaternion does not have norm 1.
    #[error("the pose's quaternion (qw,qx,qy,qz) has norm {norm:.6}; it must be 1 within {QUATERNION_NORM_TOLERANCE}")]
    NotUnit {
        /// Norm found.
        norm: f64,
    },
    /// The position is too far from the scene's origin.
    #[error(
        "pose component `{name}` is {value} mm; positions reach ±{POSITION_LIMIT_MM} mm from the scene's origin (is the unit wrong?)"
    )]
    TooFar {
        /// Component: one of x y z.
        name: &'static str,
        /// Value of the component, mm.
        value: f64,
    },
    /// A matrix that is not a rotation.
    #[error("the matrix is no rotation: {fault}")]
    NotRotation {
        /// Fault of the matrix.
        fault: &'static str,
    },
    /// Not seven comma-separated numbers.
    #[error("`{text}` is not a pose: expected seven numbers `x,y,z,qw,qx,qy,qz` (mm and a unit quaternion)")]
    Syntax {
        /// Text given.
        text: String,
    },
}

/// Rigid transform `scene_from_probe`: position and orientation of the probe in the scene. Other rigid transforms have
/// this type, too; variables are named `a_from_b` for the transform from frame b to frame a.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Pose {
    /// Centre of the transducer's face in the scene, mm.
    pub position_mm: DVec3,
    /// Unit quaternion that turns probe axes into scene axes.
    pub orientation: DQuat,
}

impl Pose {
    /// A pose from its seven numbers `[x, y, z, qw, qx, qy, qz]`, checked and normalised.
    ///
    /// # Errors
    /// A component is not finite, a coordinate exceeds [`POSITION_LIMIT_MM`], or the quaternion's norm differs from 1
    /// by more than [`QUATERNION_NORM_TOLERANCE`].
    pub fn from_components([x, y, z, qw, qx, qy, qz]: [f64; 7]) -> Result<Self, PoseError> {
        Self::new(DVec3::new(x, y, z), DQuat::from_xyzw(qx, qy, qz, qw))
    }

    /// A pose from position (mm) and quaternion, checked and normalised.
    ///
    /// # Errors
    /// The errors of [`from_components`](Self::from_components).
    pub fn new(position_mm: DVec3, orientation: DQuat) -> Result<Self, PoseError> {
        const NAMES: [&str; 7] = ["x", "y", "z", "qw", "qx", "qy", "qz"];
        let components = Self { position_mm, orientation }.components();
        for (name, value) in NAMES.into_iter().zip(components) {
            if !value.is_finite() {
                return Err(PoseError::NotFinite { name, value });
            }
        }
        for (name, value) in NAMES.into_iter().zip(components).take(3) {
            if value.abs() > POSITION_LIMIT_MM {
                return Err(PoseError::TooFar { name, value });
            }
        }
        let norm = orientation.length();
        if (norm - 1.0).abs() > QUATERNION_NORM_TOLERANCE {
            return Err(PoseError::NotUnit { norm });
        }
        Ok(Self { position_mm, orientation: orientation.normalize() })
    }

    /// A pose from a rotation matrix and a position (mm).
    ///
    /// # Errors
    /// The columns are not orthonormal within [`ROTATION_TOLERANCE`], the determinant is negative, or the position is
    /// invalid as for [`from_components`](Self::from_components).
    pub fn from_matrix(rotation: DMat3, position_mm: DVec3) -> Result<Self, PoseError> {
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = rotation;
        // Comparisons with NaN are false, so NaN is refused.
        let is_unit = |v: DVec3| (v.length() - 1.0).abs() <= ROTATION_TOLERANCE;
        let is_square = |a: DVec3, b: DVec3| a.dot(b).abs() <= ROTATION_TOLERANCE;
        let fault = if !(is_unit(x) && is_unit(y) && is_unit(z)) {
            "its columns must have length 1 within 0.001"
        } else if !(is_square(x, y) && is_square(y, z) && is_square(z, x)) {
            "its columns must be perpendicular within 0.001"
        } else if rotation.determinant() < 0.0 {
            "it mirrors"
        } else {
            return Self::new(position_mm, DQuat::from_mat3(&rotation).normalize());
        };
        Err(PoseError::NotRotation { fault })
    }

    /// The pose's seven numbers `[x, y, z, qw, qx, qy, qz]`.
    pub fn components(&self) -> [f64; 7] {
        let (p, q) = (self.position_mm, self.orientation);
        [p.x, p.y, p.z, q.w, q.x, q.y, q.z]
    }

    /// Pose of a probe at `position_mm` that looks along `into_body`, with its lateral axis as close as possible to
    /// `lateral`.
    ///
    /// Falls back to an arbitrary perpendicular if `lateral` is parallel to `into_body`.
    pub fn looking(position_mm: DVec3, into_body: DVec3, lateral: DVec3) -> Self {
        let z = into_body.normalize_or(DVec3::Z);
        let x = (lateral - z * lateral.dot(z)).normalize_or(z.any_orthonormal_vector());
        let y = z.cross(x);
        Self { position_mm, orientation: DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize() }
    }

    /// Maps a point from the probe frame to the scene, mm.
    pub fn transform_point(&self, probe_mm: DVec3) -> DVec3 {
        self.position_mm + self.orientation * probe_mm
    }

    /// Maps a direction from the probe frame to the scene.
    pub fn transform_vector(&self, probe: DVec3) -> DVec3 {
        self.orientation * probe
    }
}

impl std::str::FromStr for Pose {
    type Err = PoseError;

    fn from_str(text: &str) -> Result<Self, PoseError> {
        let syntax = || PoseError::Syntax { text: text.to_owned() };
        let mut components = [0.0; 7];
        let mut fields = text.split(',');
        for slot in &mut components {
            *slot = fields.next().and_then(|f| f.trim().parse().ok()).ok_or_else(syntax)?;
        }
        if fields.next().is_some() {
            return Err(syntax());
        }
        Self::from_components(components)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_that_are_no_rotation_are_refused() {
        let accepted = |x: DVec3, y: DVec3, z: DVec3| Pose::from_matrix(DMat3::from_cols(x, y, z), DVec3::ZERO).is_ok();
        assert!(accepted(DVec3::X, DVec3::Y, DVec3::Z));
        assert!(!accepted(DVec3::X, DVec3::Y, -DVec3::Z));
        assert!(!accepted(2.0 * DVec3::X, DVec3::Y, DVec3::Z));
        assert!(!accepted(DVec3::X, DVec3::X, DVec3::Z));
        assert!(!accepted(DVec3::NAN, DVec3::Y, DVec3::Z));
    }
}
