//! Statistics of a tracker session as a line of text or JSON.

use std::fmt;

use insonify_core::pose::Reading;
use serde::Serialize;

use super::{SensorReport, TrackerReport};

/// Statistics as one line.
#[derive(Debug, Clone, Serialize)]
pub struct ReportLine<'a> {
    time_s: f64,
    state: &'static str,
    records: u64,
    rate_hz: Option<f64>,
    jitter_ms: Option<f64>,
    longest_ms: Option<f64>,
    missing: u64,
    reversals: u64,
    decode_errors: u64,
    sensor: Option<u16>,
    buttons: Option<u32>,
    position_mm: Option<[f64; 3]>,
    /// Quaternion of the last reading: w, x, y, z; `None` if it has no orientation.
    quaternion: Option<[f64; 4]>,
    /// Rates along x, y, z, then about them, −1..=1; `None` for devices that measure no rates.
    rates: Option<[f64; 6]>,
    /// Sensors received, including sensors that are left out.
    sensors: &'a [SensorReport],
    events: &'a [String],
}

impl<'a> ReportLine<'a> {
    /// Line of `report` at `time_s`, s. If no record arrived since the last report, the reading is left out: it must
    /// not look current.
    pub fn new(report: &'a TrackerReport, time_s: f64) -> Self {
        let last = report.last.as_ref().filter(|_| report.records > 0);
        let (mut position_mm, mut quaternion, mut rates) = (None, None, None);
        match last.map(|record| record.reading) {
            Some(Reading::Pose(pose)) => {
                let [x, y, z, qw, qx, qy, qz] = pose.components();
                (position_mm, quaternion) = (Some([x, y, z]), Some([qw, qx, qy, qz]));
            }
            Some(Reading::Orientation(q)) => quaternion = Some([q.w, q.x, q.y, q.z]),
            Some(Reading::Rates { translation: t, rotation: r }) => rates = Some([t.x, t.y, t.z, r.x, r.y, r.z]),
            Some(Reading::OutOfView) | None => {}
        }
        Self {
            time_s,
            state: report.state.name(),
            records: report.records,
            rate_hz: report.rate_hz,
            jitter_ms: report.jitter_ms,
            longest_ms: report.longest_ms,
            missing: report.missing,
            reversals: report.reversals,
            decode_errors: report.decode_errors,
            sensor: last.map(|record| record.sensor),
            buttons: last.map(|record| record.buttons),
            position_mm,
            quaternion,
            rates,
            sensors: &report.sensors,
            events: &report.events,
        }
    }
}

impl fmt::Display for ReportLine<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.1}"));
        let [rate, jitter, longest] = [self.rate_hz, self.jitter_ms, self.longest_ms].map(number);
        write!(f, "{:>7.1} s  {:<12} {rate:>6} Hz  jitter {jitter:>5} ms  ", self.time_s, self.state)?;
        write!(f, "longest {longest:>6} ms  lost {}  damaged {}", self.missing, self.decode_errors)?;
        if self.reversals > 0 {
            write!(f, "  back {}", self.reversals)?;
        }
        let readings = [
            ("mm", self.position_mm.as_ref().map(|v| &v[..]), 2),
            ("q", self.quaternion.as_ref().map(|v| &v[..]), 4),
            ("rates", self.rates.as_ref().map(|v| &v[..]), 3),
        ];
        if self.sensor.is_some() && readings.iter().all(|(_, values, _)| values.is_none()) {
            write!(f, "  out of view")?;
        }
        for (name, values, digits) in readings {
            let Some(values) = values else { continue };
            write!(f, "  {name} ")?;
            values.iter().try_for_each(|v| write!(f, "{v:9.digits$}"))?;
        }
        // A single sensor is shown in the line itself. Several are listed, so that the probe can be recognised by its
        // motion.
        let several = self.sensors.iter().filter(|_| self.sensors.len() > 1);
        several.into_iter().try_for_each(|sensor| write!(f, "\n{sensor}"))
    }
}

impl fmt::Display for SensorReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = || format!("sensor {}", self.sensor);
        let name = self.name.as_ref().map_or_else(number, |name| name.escape_debug().to_string());
        let tool = match (self.is_probe, self.is_needle) {
            (true, _) => "probe",
            (false, true) => "needle",
            (false, false) => "",
        };
        let rate = self.rate_hz.map_or_else(|| "-".to_owned(), |rate| format!("{rate:.1}"));
        let state = match (self.records, self.is_valid) {
            (0, _) => "silent",
            (_, true) => "valid",
            (_, false) => "not valid",
        };
        write!(f, "           {tool:<6} {name:<22} {rate:>6} Hz  {state:<9}")?;
        let Some(position_mm) = self.position_mm.filter(|_| self.records > 0) else { return Ok(()) };
        write!(f, "  mm ")?;
        position_mm.iter().try_for_each(|v| write!(f, "{v:9.2}"))
    }
}
