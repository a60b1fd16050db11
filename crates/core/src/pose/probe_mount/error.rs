//! Errors in calibrating the mounting of a sensor.

use thiserror::Error;

use super::super::pivot::PivotError;
use super::super::spin::LEAST_TURN_DEG;
use super::{END_RMS_MM, LATERAL_DEG, SLIDE_MM, SQUARE_DEG, WIDTH_MM, WOBBLE_DEG};

/// Reason why the mounting could not be calibrated.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum MountError {
    /// The pivot calibration gives no centre of the face.
    #[error("the pivot about the centre of the face: {0}")]
    Pivot(#[from] PivotError),
    /// A step without poses.
    #[error("{step}: there are no poses")]
    Empty {
        /// Name of the step.
        step: &'static str,
    },
    /// No step determines the lateral axis.
    #[error("the lateral axis is unknown: give both ends of the face (--marker-end, --other-end) or a --slide")]
    NoLateral,
    /// No step determines the beam's direction.
    #[error("the beam's direction is unknown: record the upright probe turned about its own long axis (--spin){why}")]
    NoBeam {
        /// Reason why the ends of the face don't determine the beam, or empty.
        why: String,
    },
    /// An end of the face that was not in the dimple.
    #[error(
        "{step}: the end of the face moved by {rms_mm:.1} mm RMS from its mean, at most {END_RMS_MM}; rest it in the dimple of the pivot, and leave dimple and tracker where they are between the steps"
    )]
    EndMoved {
        /// Name of the step.
        step: &'static str,
        /// RMS distance of the end from its mean position, mm.
        rms_mm: f64,
    },
    /// Ends of the face at an impossible distance.
    #[error(
        "the ends of the face lie {width_mm:.1} mm apart; {} to {} mm are possible: was each end rested in the dimple of the pivot, and is the unit of the poses mm?", WIDTH_MM[0], WIDTH_MM[1]
    )]
    Width {
        /// Distance, mm.
        width_mm: f64,
    },
    /// A centre of the face that is not in the middle between its ends.
    #[error(
        "the centre of the face lies {off_mm:.1} mm from the middle between its ends ({width_mm:.1} mm apart): were centre and ends mixed up?"
    )]
    OffCentre {
        /// Distance of the centre from the middle along the lateral axis, mm.
        off_mm: f64,
        /// Distance between the ends, mm.
        width_mm: f64,
    },
    /// Too little turn of the probe about its axis.
    #[error("the turn about the probe's axis: {turn_deg:.0}° only; turn it by at least {LEAST_TURN_DEG}°")]
    LittleTurn {
        /// Largest rotation found, degrees.
        turn_deg: f64,
    },
    /// A turn whose axis moved.
    #[error(
        "the turn about the probe's axis: the axis moved by {wobble_deg:.1}° RMS, at most {WOBBLE_DEG}; keep the probe upright while it turns"
    )]
    Wobble {
        /// RMS deviation of the axis, degrees.
        wobble_deg: f64,
    },
    /// A turn about an axis that is not the probe's long one.
    #[error(
        "the probe was turned about another axis than its long one: {off_deg:.0}° off the direction in which the arc of its face bulges; hold it upright and turn it about its own long axis"
    )]
    OtherAxis {
        /// Angle between the axis of the turn and the arc, degrees.
        off_deg: f64,
    },
    /// A beam whose sense is unknown, or a turn about another axis.
    #[error(
        "the beam may point either way: the sensor is {away_mm:.1} mm from the centre of the face, but {along_mm:.1} mm along the axis of the turn; turn the upright probe about its own long axis, rest both ends of a convex face in the dimple, or mount the sensor higher"
    )]
    Sense {
        /// Distance between sensor and face along the axis of the turn, mm.
        along_mm: f64,
        /// Distance between sensor and face, mm.
        away_mm: f64,
    },
    /// Ends of the face and a slide that contradict each other.
    #[error(
        "the ends of the face and the slide contradict each other: their lateral axes are {off_deg:.0}° apart, at most {LATERAL_DEG}; were the ends exchanged, or was the marker's side not ahead in the slide?"
    )]
    EndsAndSlide {
        /// Angle between the two lateral axes, degrees.
        off_deg: f64,
    },
    /// A slide that determines no direction.
    #[error(
        "the slide: {path_mm:.0} mm long, off a line by {off_mm:.1} mm RMS, turned by {turn_deg:.0}°; slide along a ruler by at least {SLIDE_MM} mm without turning the probe"
    )]
    Slide {
        /// Length of the slide, mm.
        path_mm: f64,
        /// RMS distance of the slide from a line, mm.
        off_mm: f64,
        /// Largest turn during the slide, degrees.
        turn_deg: f64,
    },
    /// A beam and a lateral axis that are not perpendicular.
    #[error(
        "the measured lateral axis and the beam are {square_deg:.1}° off a right angle, at most {SQUARE_DEG}: was the probe upright while it turned, and slid sideways?"
    )]
    NotSquare {
        /// Deviation of the angle between them from 90°, degrees.
        square_deg: f64,
    },
}
