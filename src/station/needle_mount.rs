//! Mounting of the needle's sensor, from the table `[needle]` of the calibration file.

use glam::DVec3;
use serde::Deserialize;

use super::StationError;
use crate::files::{self, FileError, FileKind};
use crate::pose::{CalibrationError, CalibrationSource, POSITION_LIMIT_MM, Pose};

/// Mounting of the sensor on the needle, in the sensor's frame.
#[derive(Debug, Deserialize)]
struct NeedleMount {
    /// Position of the tip, mm.
    tip_mm: [f64; 3],
    /// Direction of the shaft from the hub to the tip.
    axis: [f64; 3],
    /// Direction to the side that the bevel's facet faces; `None` if it is unknown.
    bevel: Option<[f64; 3]>,
}

impl NeedleMount {
    fn sensor_from_needle(&self) -> Pose {
        let axis = DVec3::from_array(self.axis);
        let bevel = self.bevel.map_or_else(|| axis.any_orthogonal_vector(), DVec3::from_array);
        Pose::looking(self.tip_mm.into(), axis, bevel)
    }
}

/// `sensor_from_needle`, and whether the side of the bevel is known; `None` without a calibration file or its table
/// `[needle]`.
pub(super) fn needle_mount(source: &CalibrationSource) -> Result<Option<(Pose, bool)>, StationError> {
    #[derive(Deserialize)]
    struct File {
        needle: Option<NeedleMount>,
    }
    let Some(path) = &source.path else { return Ok(None) };
    let text =
        files::read_text(path, FileKind::Calibration).map_err(FileError::at("read the calibration file", path))?;
    let in_file = |reason: String| {
        let source = Box::new(CalibrationError::Syntax { reason });
        StationError::Calibration(CalibrationError::InFile { path: path.clone(), source })
    };
    let file: File = toml::from_str(&text).map_err(|error| in_file(files::toml_reason(&text, &error)))?;
    let Some(mount) = file.needle else { return Ok(None) };
    let is_direction = |v: [f64; 3]| v.iter().all(|x| x.is_finite()) && DVec3::from_array(v).length() > 1e-6;
    if !mount.tip_mm.iter().all(|x| x.abs() <= POSITION_LIMIT_MM) {
        return Err(in_file(format!("`needle.tip_mm` must be three numbers within ±{POSITION_LIMIT_MM} mm")));
    }
    if !is_direction(mount.axis) || !mount.bevel.is_none_or(is_direction) {
        return Err(in_file(
            "`needle.axis` and `needle.bevel` must be directions: three numbers, not all 0".to_owned(),
        ));
    }
    Ok(Some((mount.sensor_from_needle(), mount.bevel.is_some())))
}
