//! Mounting of a sensor on a probe: the centre of the probe's face and the probe's axes in the sensor's frame.
//!
//! - The **centre** of the face comes from a [`pivot`](super::pivot) calibration: the probe turns about it in a dimple.
//! - The **lateral axis** comes from the two ends of the face, each rested in the same dimple: R⁻¹·(pivot − t) is the
//!   point of the probe in the dimple. Alternatively, it comes from a straight slide with the marker's side ahead.
//! - The **beam** axis comes from turning the upright probe about its own long axis, see `spin.rs`. Without
//!   a turn, the arc of a convex face gives the beam: the centre of the face lies ahead of the middle between its ends.
//!
//! The lateral axis is more certain than the beam, so the beam is made perpendicular to the lateral axis. The probe's
//! marker is at the first scanline, and the lateral axis points away from the marker.

use std::fmt;

use glam::{DMat3, DQuat, DVec3};
use nalgebra::Matrix3;
use serde::Serialize;

use super::Pose;
use super::pivot::{Pivot, calibrate, widest_turn};
use super::spin::{self, LEAST_TURN_DEG, steadiest_axis};
use super::transform::angle_between;

mod error;
#[cfg(test)]
mod tests;

pub use error::MountError;

/// Names of the steps that rest the ends of the face in the dimple, for errors.
const MARKER_END: &str = "the end of the face at the marker";
const OTHER_END: &str = "the other end of the face";

/// Largest accepted scatter of one end of the face: RMS distance of its positions from their mean, mm.
const END_RMS_MM: f64 = 3.0;

/// Range of accepted distances between the ends of the face, mm.
const WIDTH_MM: [f64; 2] = [5.0, 150.0];

/// Largest accepted distance of the face's centre from the plane midway between its ends, relative to the face's
/// width.
const OFF_CENTRE: f64 = 0.2;

/// Smallest height of the face's arc, mm, at which the arc determines the beam.
const ARC_MM: f64 = 4.0;

/// Largest accepted RMS deviation of the probe's axis while the probe is turned about it, degrees.
const WOBBLE_DEG: f64 = 8.0;

/// Smallest accepted cosine of the angle between the axis of the turn and the arc's direction. Below it, the turn was
/// not about the probe's long axis.
const LONG_AXIS: f64 = 0.7;

/// Smallest distance between sensor and face along the axis of the turn that determines the beam's sense, as a fraction
/// of the total distance. It is used for faces without an arc.
const SENSE: f64 = 0.5;

/// Largest accepted deviation of the angle between beam and lateral axis from 90°, degrees.
const SQUARE_DEG: f64 = 10.0;

/// Smallest accepted length of a slide, mm.
const SLIDE_MM: f64 = 30.0;

/// Largest accepted RMS deviation of a slide from a line, as a fraction of the slide's length.
const SLIDE_STRAIGHT: f64 = 0.05;

/// Largest accepted turn during a slide, degrees.
const SLIDE_TURN_DEG: f64 = 15.0;

/// Largest accepted angle between the lateral axes found from the ends of the face and from the slide, degrees.
const LATERAL_DEG: f64 = 25.0;

/// Poses `tracker_from_sensor` recorded in the steps of the calibration; `None` for a step that was left out.
#[derive(Debug, Clone, Copy, Default)]
pub struct MountSteps<'a> {
    /// Poses of the probe while it is tilted to all sides about the centre of its face, which rests in a dimple.
    pub pivot: &'a [Pose],
    /// Poses of the probe with an end of its face rested in the same dimple: first the end at the marker, then the
    /// other.
    pub ends: Option<[&'a [Pose]; 2]>,
    /// Poses of the probe during a straight sideways slide with the marker's side ahead.
    pub slide: Option<&'a [Pose]>,
    /// Poses of the upright probe while it turns about its own long axis.
    pub spin: Option<&'a [Pose]>,
}

/// Source of the beam's direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum BeamSource {
    /// The turn of the probe about its long axis.
    Spin,
    /// The arc of the convex face.
    Arc,
}

/// Calibrated mounting of a sensor on a probe.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ProbeMount {
    /// Mounting of the sensor on the probe.
    #[serde(skip)]
    pub sensor_from_probe: Pose,
    /// Centre of the face in the sensor's frame, mm.
    pub position_mm: DVec3,
    /// Rotation from probe axes to sensor axes, `[qw, qx, qy, qz]`.
    pub quaternion: [f64; 4],
    /// Pivot calibration of the centre of the face.
    pub pivot: Pivot,
    /// Distance between the ends of the face, mm; `None` if the ends were not recorded.
    pub width_mm: Option<f64>,
    /// Height of the face's arc, mm; `None` if the ends of the face were not recorded.
    pub arc_mm: Option<f64>,
    /// Uncertainty of the lateral axis, degrees, from the scatter of the measured points.
    pub lateral_scatter_deg: f64,
    /// Source of the beam's direction.
    pub beam_from: BeamSource,
    /// Uncertainty of the beam's direction, degrees.
    pub beam_scatter_deg: f64,
    /// Deviation from 90° of the angle between the measured lateral axis and the measured beam, degrees.
    pub square_deg: f64,
}

impl fmt::Display for ProbeMount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (c, [w, x, y, z]) = (self.position_mm, self.quaternion);
        let Pivot { rms_mm, tip_error_mm, .. } = self.pivot;
        writeln!(f, "centre of the face in the sensor's frame  [{:.3}, {:.3}, {:.3}] mm", c.x, c.y, c.z)?;
        writeln!(f, "  residual RMS {rms_mm:.3} mm, standard error {tip_error_mm:.3} mm")?;
        writeln!(f, "turn of the probe's axes                  [{w:.6}, {x:.6}, {y:.6}, {z:.6}]")?;
        if let (Some(width), Some(arc)) = (self.width_mm, self.arc_mm) {
            writeln!(f, "  face {width:.1} mm wide, its arc {arc:.1} mm high")?;
        }
        let from = match self.beam_from {
            BeamSource::Spin => "the turn about the probe's axis",
            BeamSource::Arc => "the arc of the face",
        };
        writeln!(f, "  lateral axis certain to {:.2}°", self.lateral_scatter_deg)?;
        writeln!(f, "  beam from {from}, certain to {:.2}°", self.beam_scatter_deg)?;
        writeln!(f, "  measured axes {:.1}° off a right angle", self.square_deg)
    }
}

/// Unit vector in the sensor's frame, and its uncertainty in degrees.
type Direction = (DVec3, f64);

/// Width and arc of a probe's face, as vectors in the sensor's frame.
struct Face {
    /// Vector from the end at the marker to the other end.
    across_mm: DVec3,
    /// Vector from the middle between the ends to the centre of the face, without its component along `across_mm`.
    arc_mm: DVec3,
    /// RMS distance of an end's positions from their mean, mm; the larger one of both ends.
    rms_mm: f64,
}

/// Finds the mounting of a sensor on a probe.
///
/// # Errors
/// A pivot that gives no centre, a step that fails, or steps that leave an axis unknown or contradict each other.
pub fn mount(steps: &MountSteps<'_>) -> Result<ProbeMount, MountError> {
    let pivot = calibrate(steps.pivot)?;
    let face = steps.ends.map(|ends| face(ends, &pivot)).transpose()?;
    let slide = steps.slide.map(|poses| slide(poses, pivot.tip_mm)).transpose()?;
    let by_ends = face.as_ref().map(|face| (face.across_mm.normalize_or_zero(), degrees(face.rms_mm, face.across_mm)));
    if let (Some((ends, _)), Some((slide, _))) = (by_ends, slide) {
        let off_deg = angle_deg(ends, slide);
        if off_deg > LATERAL_DEG {
            return Err(MountError::EndsAndSlide { off_deg });
        }
    }
    let (lateral, lateral_scatter_deg) = by_ends.or(slide).ok_or(MountError::NoLateral)?;
    let arc = face.as_ref().filter(|face| face.arc_mm.length() >= ARC_MM);
    let by_arc = arc.map(|face| (face.arc_mm.normalize_or_zero(), degrees(face.rms_mm.max(pivot.rms_mm), face.arc_mm)));
    let spin = steps.spin.map(|poses| beam(poses, pivot.tip_mm, by_arc)).transpose()?;
    let (beam_from, (beam, beam_scatter_deg)) = match (spin, by_arc) {
        (Some(spin), _) => (BeamSource::Spin, spin),
        (None, Some(arc)) => (BeamSource::Arc, arc),
        (None, None) => {
            let flat = |face: &Face| {
                format!("; the arc of the face is {:.1} mm high, too flat to tell it", face.arc_mm.length())
            };
            return Err(MountError::NoBeam { why: face.as_ref().map_or_else(String::new, flat) });
        }
    };
    let square_deg = lateral.dot(beam).clamp(-1.0, 1.0).asin().to_degrees().abs();
    if square_deg > SQUARE_DEG {
        return Err(MountError::NotSquare { square_deg });
    }
    let z = (beam - lateral * beam.dot(lateral)).normalize_or(DVec3::Z);
    let orientation = DQuat::from_mat3(&DMat3::from_cols(lateral, z.cross(lateral), z)).normalize();
    let DQuat { x, y, z, w } = orientation;
    Ok(ProbeMount {
        sensor_from_probe: Pose { position_mm: pivot.tip_mm, orientation },
        position_mm: pivot.tip_mm,
        quaternion: [w, x, y, z],
        pivot,
        width_mm: face.as_ref().map(|face| face.across_mm.length()),
        arc_mm: face.as_ref().map(|face| face.arc_mm.length()),
        lateral_scatter_deg,
        beam_from,
        beam_scatter_deg,
        square_deg,
    })
}

/// Checks the recorded ends of the face (the end at the marker and, if recorded, the other one) against `pivot`, in
/// whose dimple they were rested.
///
/// # Errors
/// An end that was not in the dimple, ends at an impossible distance, or a centre that is not in the middle.
pub fn check_ends(pivot: &Pivot, marker: &[Pose], other: Option<&[Pose]>) -> Result<(), MountError> {
    match other {
        Some(other) => face([marker, other], pivot).map(drop),
        None => end(marker, pivot.pivot_mm, MARKER_END).map(drop),
    }
}

/// Angle between two directions of length 1, degrees.
fn angle_deg(a: DVec3, b: DVec3) -> f64 {
    a.dot(b).clamp(-1.0, 1.0).acos().to_degrees()
}

/// Angular uncertainty, degrees, of the vector `over_mm` whose ends are uncertain by `rms_mm`.
fn degrees(rms_mm: f64, over_mm: DVec3) -> f64 {
    rms_mm.atan2(over_mm.length()).to_degrees()
}

/// Ends of the face and its arc, from the poses of the two ends rested in the dimple of `pivot`.
fn face(ends: [&[Pose]; 2], pivot: &Pivot) -> Result<Face, MountError> {
    let [first, second] = ends;
    let (marker, marker_rms) = end(first, pivot.pivot_mm, MARKER_END)?;
    let (other, other_rms) = end(second, pivot.pivot_mm, OTHER_END)?;
    let across_mm = other - marker;
    let width_mm = across_mm.length();
    if !(WIDTH_MM[0]..=WIDTH_MM[1]).contains(&width_mm) {
        return Err(MountError::Width { width_mm });
    }
    let lateral = across_mm / width_mm;
    let from_middle = pivot.tip_mm - 0.5 * (marker + other);
    let off_mm = from_middle.dot(lateral).abs();
    if off_mm > OFF_CENTRE * width_mm {
        return Err(MountError::OffCentre { off_mm, width_mm });
    }
    let arc_mm = from_middle - lateral * from_middle.dot(lateral);
    Ok(Face { across_mm, arc_mm, rms_mm: marker_rms.max(other_rms) })
}

/// Mean position of the dimple in the sensor's frame, and the RMS distance of the positions from it, mm. `step` names
/// the step in errors.
fn end(poses: &[Pose], dimple_mm: DVec3, step: &'static str) -> Result<(DVec3, f64), MountError> {
    if poses.is_empty() {
        return Err(MountError::Empty { step });
    }
    let points: Vec<DVec3> = poses.iter().map(|pose| pose.inverse().transform_point(dimple_mm)).collect();
    let n = points.len() as f64;
    let mean = points.iter().sum::<DVec3>() / n;
    let rms_mm = (points.iter().map(|point| point.distance_squared(mean)).sum::<f64>() / n).sqrt();
    if rms_mm > END_RMS_MM {
        return Err(MountError::EndMoved { step, rms_mm });
    }
    Ok((mean, rms_mm))
}

/// Direction of the beam: the axis about which the probe was turned. It points along the arc or, without an arc, from
/// the sensor to the face.
fn beam(poses: &[Pose], centre_mm: DVec3, arc: Option<Direction>) -> Result<Direction, MountError> {
    if poses.is_empty() {
        return Err(MountError::Empty { step: "the turn about the probe's axis" });
    }
    let turn_deg = widest_turn(poses).to_degrees();
    if turn_deg < LEAST_TURN_DEG {
        return Err(MountError::LittleTurn { turn_deg });
    }
    let (axis, wobble_deg) = steadiest_axis(poses);
    if wobble_deg > WOBBLE_DEG {
        return Err(MountError::Wobble { wobble_deg });
    }
    let sense = match arc {
        Some((arc, _)) if axis.dot(arc).abs() < LONG_AXIS => {
            let off_deg = angle_deg(axis * axis.dot(arc).signum(), arc);
            return Err(MountError::OtherAxis { off_deg });
        }
        Some((arc, _)) => axis.dot(arc).signum(),
        None => spin::sense(axis, centre_mm, SENSE)
            .ok_or_else(|| MountError::Sense { along_mm: axis.dot(centre_mm).abs(), away_mm: centre_mm.length() })?,
    };
    Ok((axis * sense, wobble_deg))
}

/// Direction of the lateral axis from the poses of a slide with the marker's side ahead.
fn slide(poses: &[Pose], centre_mm: DVec3) -> Result<Direction, MountError> {
    let (Some(first), Some(last)) = (poses.first(), poses.last()) else {
        return Err(MountError::Empty { step: "the slide" });
    };
    let points: Vec<DVec3> = poses.iter().map(|pose| pose.transform_point(centre_mm)).collect();
    let n = points.len() as f64;
    let mean = points.iter().sum::<DVec3>() / n;
    let spread = points.iter().fold(Matrix3::<f64>::zeros(), |sum, point| {
        let d = nalgebra::Vector3::from((*point - mean).to_array());
        sum + d * d.transpose()
    });
    let eigen = spread.symmetric_eigen();
    let axis = DVec3::from_array(eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned().into());
    let net = last.transform_point(centre_mm) - first.transform_point(centre_mm);
    let ahead = axis * axis.dot(net).signum();
    let off = |point: &DVec3| (*point - mean - ahead * ahead.dot(*point - mean)).length_squared();
    let off_mm = (points.iter().map(off).sum::<f64>() / n).sqrt();
    let path_mm = net.dot(ahead);
    let turn_deg = poses.iter().map(|pose| angle_between(first.orientation, pose.orientation)).fold(0.0, f64::max);
    let turn_deg = turn_deg.to_degrees();
    if path_mm < SLIDE_MM || off_mm > SLIDE_STRAIGHT * path_mm || turn_deg > SLIDE_TURN_DEG {
        return Err(MountError::Slide { path_mm, off_mm, turn_deg });
    }
    let in_sensor = poses.iter().map(|pose| pose.orientation.conjugate() * ahead).sum::<DVec3>() / n;
    // The lateral axis points away from the marker.
    Ok((-in_sensor.normalize_or_zero(), off_mm.atan2(path_mm).to_degrees().max(0.5 * turn_deg)))
}
