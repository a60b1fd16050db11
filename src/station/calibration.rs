//! `[calibration]`: where tracker, sensor and probe are.

use std::path::Path;

use super::StationError;
use super::values::Values;
use crate::pose::{CalibrationSource, Pose};

pub(super) fn source(values: &Values, dir: &Path) -> Result<CalibrationSource, StationError> {
    let position = values.numbers("sensor_from_probe_mm");
    let quaternion = values.numbers("sensor_from_probe_quaternion");
    let sensor_from_probe = if position.is_some() || quaternion.is_some() {
        let [x, y, z] = position.unwrap_or_default();
        let [qw, qx, qy, qz] = quaternion.unwrap_or([1.0, 0.0, 0.0, 0.0]);
        Some(Pose::from_components([x, y, z, qw, qx, qy, qz]).map_err(StationError::SensorFromProbe)?)
    } else {
        None
    };
    Ok(CalibrationSource { path: values.text("path").map(|path| dir.join(path)), sensor_from_probe })
}
