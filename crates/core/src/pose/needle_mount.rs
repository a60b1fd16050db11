//! Mounting of a sensor on a needle: the tip, the axis of the shaft and the side of the bevel in the sensor's frame.
//!
//! - The **tip** comes from a [`pivot`](mod@super::pivot) calibration: the needle is tilted about its tip in a dimple.
//! - The **axis** comes from a [`spin`](mod@super::spin) calibration: the needle is turned about its shaft. The sensor lies
//!   behind the tip, so the axis points from the sensor towards the tip.
//! - The **bevel** comes from the first pose of the spin, if its facet faced a known direction then.
//!
//! Tip and axis can be found in either order. [`NeedleCalibration`] holds what is known so far, [`NeedleMount`] the whole.

use std::fmt;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::pivot::{self, Pivot};
use super::spin::{self, Spin, steadiest_axis};
use super::{POSITION_LIMIT_MM, Pose};

mod error;
#[cfg(test)]
mod tests;

pub use error::NeedleError;

/// Smallest accepted RMS tilt of a pivoting needle about its least tilted axis, degrees. Below it, a turn about the
/// shaft with an unsteady hand passes for a pivot.
const TILT_DEG: f64 = 8.0;

/// Smallest distance between sensor and tip along the axis that determines its sense, as a fraction of the total
/// distance.
const SENSE: f64 = 0.25;

/// Smallest accepted component, along the axis, of the direction that `--towards-tip` names.
const TOWARDS: f64 = 0.2;

/// Smallest accepted angle between the bevel's direction and the shaft, degrees.
const BEVEL_DEG: f64 = 30.0;

/// Largest accepted deviation of a unit vector's length from 1.
const LENGTH_TOLERANCE: f64 = 0.01;

/// Decimals of directions in the file. They keep an axis to a billionth of a degree, and hide the last digits, which
/// depend on the order of the computations.
const DIRECTION_DECIMALS: i32 = 11;
/// Difference from the length 1 that comes from rounding.
const ROUNDING: f64 = 1e-10;

/// Largest change of the axis, degrees, after which an earlier bevel still holds. A larger one shows that the sensor was
/// mounted anew.
const SAME_MOUNT_DEG: f64 = 5.0;

/// Calibrated mounting of a sensor on a needle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeedleMount {
    /// The tip in the sensor's frame, mm.
    pub tip_mm: DVec3,
    /// Unit vector along the shaft from the hub to the tip, in the sensor's frame.
    pub axis: DVec3,
    /// Unit vector across the shaft to the side that the bevel's facet faces, in the sensor's frame; `None` if unknown.
    pub bevel: Option<DVec3>,
    /// RMS distance of the tip from the pivot, mm; `None` if the tip was not fitted.
    pub rms_mm: Option<f64>,
    /// Standard error of the axis, degrees; `None` if the axis was not fitted.
    pub axis_deg: Option<f64>,
}

impl NeedleMount {
    /// Pose of the needle's frame in the sensor's frame: origin at the tip, z along the shaft, x to the side that the
    /// bevel faces. With an unknown bevel, x is any direction across the shaft.
    pub fn sensor_from_needle(&self) -> Pose {
        Pose::looking(self.tip_mm, self.axis, self.bevel.unwrap_or_else(|| self.axis.any_orthonormal_vector()))
    }

    /// Distance between sensor and tip, mm.
    pub fn sensor_to_tip_mm(&self) -> f64 {
        self.tip_mm.length()
    }

    /// Standard error of the axis in mm across the shaft, at the distance between sensor and tip: 0.8 mm for 0.5° and
    /// 90 mm.
    pub fn across_mm(&self) -> Option<f64> {
        self.axis_deg.map(|deg| deg.to_radians() * self.sensor_to_tip_mm())
    }
}

impl fmt::Display for NeedleMount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (away_mm, axis) = (self.sensor_to_tip_mm(), self.axis);
        writeln!(f, "needle                        tip {away_mm:.1} mm from its sensor")?;
        writeln!(f, "  direction from hub to tip   [{:.5}, {:.5}, {:.5}]", axis.x, axis.y, axis.z)?;
        if let (Some(deg), Some(mm)) = (self.axis_deg, self.across_mm()) {
            writeln!(f, "  certain to                  {deg:.3}°, which is {mm:.2} mm over {away_mm:.0} mm")?;
        }
        match self.bevel {
            Some(b) => writeln!(f, "  bevel faces                 [{:.3}, {:.3}, {:.3}]", b.x, b.y, b.z),
            None => writeln!(f, "  bevel                       unknown"),
        }
    }
}

/// Calibrated parts of a needle's mounting: table `[needle]` of a calibration file. `None` for a part that is not known.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NeedleCalibration {
    /// The tip in the sensor's frame, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip_mm: Option<DVec3>,
    /// RMS distance of the tip from the pivot, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rms_mm: Option<f64>,
    /// Unit vector along the shaft in the sensor's frame. It points to the tip if that is known too.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<DVec3>,
    /// Standard error of the axis, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis_deg: Option<f64>,
    /// Whether the user states that `axis` points to the tip. Otherwise the place of the tip determines the sense.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub points_to_tip: bool,
    /// Unit vector across the shaft to the side that the bevel's facet faces, in the sensor's frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bevel: Option<DVec3>,
}

impl NeedleCalibration {
    /// Replaces the tip by that of a pivot calibration.
    ///
    /// # Errors
    /// The tip contradicts the stated sense of a known axis, or leaves the sense open.
    pub fn set_tip(&mut self, pivot: &Pivot) -> Result<(), NeedleError> {
        (self.tip_mm, self.rms_mm) = (Some(pivot.tip_mm), Some(pivot.rms_mm));
        self.settle()
    }

    /// Replaces the axis by that of a spin calibration. `towards_tip` is a direction of the sensor's frame that points
    /// roughly from the hub to the tip; it is needed only if the sensor is nearly level with the tip. Returns whether an
    /// earlier bevel was dropped, because the axis differs too much from the earlier one.
    ///
    /// # Errors
    /// `towards_tip` is nearly perpendicular to the axis. The axis contradicts a known tip, or the tip leaves the
    /// sense open.
    pub fn set_axis(&mut self, spin: &Spin, towards_tip: Option<DVec3>) -> Result<bool, NeedleError> {
        let along = towards_tip.map(|direction| spin.axis.dot(direction.normalize_or_zero()));
        if along.is_some_and(|along| along.abs() < TOWARDS) {
            return Err(NeedleError::TowardsTip { axis: rounded(spin.axis) });
        }
        let is_same = |old: DVec3| old.dot(spin.axis).abs() > SAME_MOUNT_DEG.to_radians().cos();
        let drops_bevel = self.bevel.is_some() && !self.axis.is_some_and(is_same);
        self.bevel = self.bevel.filter(|_| !drops_bevel).map(|bevel| across(bevel, spin.axis));
        self.axis = Some(spin.axis * along.map_or(1.0, f64::signum));
        (self.axis_deg, self.points_to_tip) = (Some(spin.axis_deg), along.is_some());
        self.settle().map(|()| drops_bevel)
    }

    /// Replaces the bevel: at `tracker_from_sensor`, its facet faced the direction `facing` of the tracker's frame.
    ///
    /// # Errors
    /// The axis is unknown, or `facing` is nearly along the shaft.
    pub fn set_bevel(&mut self, tracker_from_sensor: &Pose, facing: DVec3) -> Result<(), NeedleError> {
        let axis = self.axis.ok_or(NeedleError::NoAxis)?;
        let bevel = (tracker_from_sensor.orientation.conjugate() * facing).normalize_or_zero();
        let angle_deg = bevel.dot(axis).abs().min(1.0).acos().to_degrees();
        if angle_deg < BEVEL_DEG {
            return Err(NeedleError::BevelAlongShaft { angle_deg });
        }
        self.bevel = Some(across(bevel, axis));
        Ok(())
    }

    /// The complete mounting.
    ///
    /// # Errors
    /// The tip or the axis is unknown; the error names the command that finds it. The sense of the axis is open, or
    /// stated against the tip.
    pub fn mount(&self) -> Result<NeedleMount, NeedleError> {
        let mut settled = *self;
        settled.settle()?;
        let (tip_mm, axis) = match (settled.tip_mm, settled.axis) {
            (Some(tip_mm), Some(axis)) => (tip_mm, axis),
            (None, None) => return Err(NeedleError::Unknown),
            (None, _) => return Err(NeedleError::NoTip),
            (_, None) => return Err(NeedleError::NoAxis),
        };
        let Self { rms_mm, axis_deg, bevel, .. } = settled;
        Ok(NeedleMount { tip_mm, axis, bevel: bevel.map(|bevel| across(bevel, axis)), rms_mm, axis_deg })
    }

    /// Makes the axis point to the tip, if both are known.
    fn settle(&mut self) -> Result<(), NeedleError> {
        let (Some(tip_mm), Some(axis)) = (self.tip_mm, self.axis) else { return Ok(()) };
        let along_mm = axis.dot(tip_mm);
        match spin::sense(axis, tip_mm, SENSE) {
            Some(sense) if self.points_to_tip && sense < 0.0 => Err(NeedleError::Reversed { along_mm: along_mm.abs() }),
            Some(sense) => {
                self.axis = Some(sense * axis);
                Ok(())
            }
            None if self.points_to_tip => Ok(()),
            None => Err(NeedleError::Level { along_mm: along_mm.abs(), away_mm: tip_mm.length(), axis: rounded(axis) }),
        }
    }

    /// The same values with directions as they are written to a file.
    pub(super) fn rounded(self) -> Self {
        let scale = 10f64.powi(DIRECTION_DECIMALS);
        // Adding zero turns -0 into 0.
        let rounded = |v: DVec3| (v * scale).round() / scale + DVec3::ZERO;
        Self { axis: self.axis.map(rounded), bevel: self.bevel.map(rounded), ..self }
    }

    /// The same values with directions of length 1, and the bevel across the axis. Directions that a file has rounded
    /// stay as they are, so that a file that is read and written again is the same. On failure the key and its fault.
    pub(super) fn checked(mut self) -> Result<Self, (&'static str, String)> {
        if let Some(tip) = self.tip_mm
            && !(tip.is_finite() && tip.abs().max_element() <= POSITION_LIMIT_MM)
        {
            return Err(("needle.tip_mm", out_of_range(tip)));
        }
        self.axis = self.axis.map(unit).transpose().map_err(|fault| ("needle.axis", fault))?;
        self.bevel = self.bevel.map(unit).transpose().map_err(|fault| ("needle.bevel", fault))?;
        if let (Some(axis), Some(bevel)) = (self.axis, self.bevel) {
            let angle_deg = bevel.dot(axis).abs().min(1.0).acos().to_degrees();
            if angle_deg < BEVEL_DEG {
                let fault =
                    format!("at an angle of {angle_deg:.0}° to `needle.axis`; the bevel faces across it, at 90°");
                return Err(("needle.bevel", fault));
            }
            // A bevel that a file has rounded is across already.
            self.bevel = Some(if bevel.dot(axis).abs() <= ROUNDING { bevel } else { across(bevel, axis) });
        }
        for (key, value) in [("needle.rms_mm", self.rms_mm), ("needle.axis_deg", self.axis_deg)] {
            if let Some(value) = value.filter(|value| !(value.is_finite() && *value >= 0.0)) {
                return Err((key, format!("{value}; it must be a number from 0 on")));
            }
        }
        Ok(self)
    }
}

/// Pivot calibration of a needle from `tracker_from_sensor`.
///
/// # Errors
/// An error of [`pivot::calibrate`], or poses of a needle that was turned about its shaft rather than tilted.
pub fn pivot(tracker_from_sensor: &[Pose]) -> Result<Pivot, NeedleError> {
    let found = pivot::calibrate(tracker_from_sensor);
    let (_, tilt_deg) = steadiest_axis(tracker_from_sensor);
    match found {
        Ok(_) | Err(pivot::PivotError::OneAxis { .. }) if tilt_deg < TILT_DEG => Err(NeedleError::NoTilt { tilt_deg }),
        found => Ok(found?),
    }
}

/// Message for a position that is not finite or too far away.
pub(super) fn out_of_range(position_mm: DVec3) -> String {
    format!("{:?}; it must be three numbers within ±{POSITION_LIMIT_MM} mm", position_mm.to_array())
}

/// The part of `direction` perpendicular to the unit vector `axis`, normalised.
fn across(direction: DVec3, axis: DVec3) -> DVec3 {
    (direction - axis * direction.dot(axis)).normalize_or(axis.any_orthonormal_vector())
}

/// `v` with length 1, or its fault in words.
fn unit(v: DVec3) -> Result<DVec3, String> {
    let length = v.length();
    let off = (length - 1.0).abs();
    if off <= LENGTH_TOLERANCE {
        return Ok(if off <= ROUNDING { v } else { v / length });
    }
    Err(format!(
        "{:?}, of length {length:.3}; it must be a direction of length 1 within {LENGTH_TOLERANCE}",
        v.to_array()
    ))
}

/// Components with two decimals, for messages.
fn rounded(v: DVec3) -> [f64; 3] {
    v.to_array().map(|x| (100.0 * x).round() / 100.0)
}
