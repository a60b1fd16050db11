//! Errors in calibrating the mounting of a sensor on a needle.

use thiserror::Error;

use super::super::pivot::PivotError;
use super::TILT_DEG;

/// Reason why the mounting of a needle is unknown or could not be calibrated.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum NeedleError {
    /// Neither tip nor axis is known.
    #[error(
        "the needle is not calibrated: `insonify calibrate pivot --of needle` finds its tip, `insonify calibrate spin --of needle` the axis of its shaft"
    )]
    Unknown,
    /// The tip is unknown.
    #[error("the needle's tip is unknown: `insonify calibrate pivot --of needle` finds it")]
    NoTip,
    /// The axis is unknown.
    #[error("the axis of the needle's shaft is unknown: `insonify calibrate spin --of needle` finds it")]
    NoAxis,
    /// The pivot calibration gives no tip.
    #[error(transparent)]
    Pivot(#[from] PivotError),
    /// A pivot without tilt.
    #[error(
        "the needle was tilted by {tilt_deg:.1}° RMS only, at least {TILT_DEG}: rest its tip in a dimple and tilt it by 30° to all sides (poses of a needle that is turned about its shaft are for `insonify calibrate spin --of needle`)"
    )]
    NoTilt {
        /// RMS tilt about the least tilted axis, degrees.
        tilt_deg: f64,
    },
    /// A tip that doesn't show the sense of the axis.
    #[error(
        "the axis {axis:?} may point either way: the tip is {away_mm:.1} mm from the sensor, but {along_mm:.1} mm along the axis. Was the needle turned about its own shaft? If the sensor is mounted level with the tip, state the sense by `insonify calibrate spin --of needle --towards-tip`, such as +z if the sensor's z points to the tip"
    )]
    Level {
        /// The axis of unknown sense, sensor's frame.
        axis: [f64; 3],
        /// Distance between sensor and tip along the axis, mm.
        along_mm: f64,
        /// Distance between sensor and tip, mm.
        away_mm: f64,
    },
    /// A stated sense that contradicts the tip.
    #[error(
        "the stated sense of the axis contradicts the tip, which lies {along_mm:.1} mm the other way: leave out --towards-tip (`points_to_tip` of the calibration file), or find tip and axis again if the sensor was mounted anew"
    )]
    Reversed {
        /// Distance between sensor and tip along the axis, mm.
        along_mm: f64,
    },
    /// A stated direction that doesn't show the sense of the axis.
    #[error(
        "--towards-tip is nearly perpendicular to the axis {axis:?} (sensor's frame); name the sensor's axis that is nearest to it"
    )]
    TowardsTip {
        /// The axis of unknown sense, sensor's frame.
        axis: [f64; 3],
    },
    /// A bevel's direction along the shaft.
    #[error(
        "the direction that the bevel faces is {angle_deg:.0}° from the shaft; hold the needle across that direction in the first pose, at about 90°"
    )]
    BevelAlongShaft {
        /// Angle between the direction and the shaft, degrees.
        angle_deg: f64,
    },
}
