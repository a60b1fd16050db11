//! `[calibration]`: calibration of tracker, sensor and probe.

use std::path::Path;

use super::StationError;
use super::values::Values;
use crate::pose::CalibrationSource;

pub(super) fn source(values: &Values, dir: &Path) -> Result<CalibrationSource, StationError> {
    let [position, quaternion] = ["sensor_from_probe_mm", "sensor_from_probe_quaternion"];
    let is_given = values.has(position) || values.has(quaternion);
    let sensor_from_probe = is_given.then(|| values.pose(position, quaternion)).transpose();
    let sensor_from_probe = sensor_from_probe.map_err(StationError::SensorFromProbe)?;
    Ok(CalibrationSource { path: values.text("path").map(|path| dir.join(path)), sensor_from_probe })
}
