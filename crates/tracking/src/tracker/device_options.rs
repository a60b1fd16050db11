//! Options of a tracking device.

use std::time::Duration;

use insonify_core::settings::TrackerSettings;

use super::{NeedleSensor, ProbeSensor, ndi};

/// Device options of a station file.
#[derive(Debug, Clone, PartialEq)]
pub struct DeviceOptions {
    /// Number of the probe's sensor. `None` takes the only sensor received, or the device's first one if the protocol
    /// needs a number.
    pub sensor: Option<u16>,
    /// Name of the probe's tool (OpenIGTLink), if chosen. It takes precedence over `sensor`.
    pub tool: Option<String>,
    /// Sensor of the needle; `None` if no needle is tracked, or if a recording names its sensor.
    pub needle: Option<NeedleSensor>,
    /// Direction [x, y, z] from the magnetic source to the half space in which the sensor is used (Polhemus).
    pub hemisphere: [f64; 3],
    /// Start-up time of a device after a reset.
    pub reset_delay: Duration,
    /// Longest accepted silence of a streaming device.
    pub silence: Duration,
    /// Options of NDI devices.
    pub ndi: ndi::Options,
    /// Report value of a puck at full deflection, at least 1 (SpaceMouse).
    pub puck_range: f64,
}

impl Default for DeviceOptions {
    fn default() -> Self {
        let settings = TrackerSettings::default();
        Self {
            sensor: None,
            tool: None,
            needle: None,
            hemisphere: [0.0, 0.0, 1.0],
            reset_delay: Duration::from_secs_f64(settings.reset_delay_ms / 1000.0),
            silence: Duration::from_secs_f64(settings.silence_ms / 1000.0),
            ndi: ndi::Options::default(),
            puck_range: settings.puck_range,
        }
    }
}

impl DeviceOptions {
    /// Chosen sensor, if any.
    pub fn probe(&self) -> Option<ProbeSensor> {
        let tool = self.tool.clone().map(ProbeSensor::Tool);
        tool.or(self.sensor.map(ProbeSensor::Number))
    }

    /// Numbers of the sensors that a device has to switch on: the probe's, `usual` unless it was chosen, and the
    /// needle's.
    pub(super) fn stations(&self, usual: u16) -> Vec<u16> {
        let mut stations = vec![self.sensor.unwrap_or(usual)];
        if let Some(NeedleSensor::Number(needle)) = self.needle
            && !stations.contains(&needle)
        {
            stations.push(needle);
        }
        stations
    }

    /// Chooses the probe's sensor by number or name, replacing any earlier choice. Without either, the earlier choice
    /// stays. A sensor that was the needle's is no longer.
    pub fn choose(&mut self, sensor: Option<u16>, tool: Option<String>) {
        if sensor.is_some() || tool.is_some() {
            (self.sensor, self.tool) = (sensor, tool);
        }
        if let Some(probe) = self.probe() {
            self.needle = self.needle.take().filter(|needle| !needle.is_chosen_by(&probe));
        }
    }
}
