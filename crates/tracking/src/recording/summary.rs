//! Summary of a recording's content.

use std::fmt;
use std::path::Path;
use std::time::Duration;

use serde::Serialize;

use super::{Damage, Event, RecordingInfo, SessionSettings, Timing};
use crate::tracker::{DecodeError, SensorName};

/// Largest number of decode errors that are described; all are counted.
const DESCRIBED: usize = 8;

/// Content of a recording, and its unusable parts. [`Display`](fmt::Display) formats it as a report.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecordingSummary {
    /// Description of the recording.
    pub info: RecordingInfo,
    /// Number of messages of tracker bytes.
    pub messages: u64,
    /// Number of bytes in these messages.
    pub bytes: u64,
    /// Number of decoded records, including records dropped afterwards.
    pub records: u64,
    /// Number of pieces of the stream that are not records.
    pub decode_errors: u64,
    /// The first decode errors.
    pub decode_errors_first: Vec<DecodeError>,
    /// Number of missing records, according to the device's counter.
    pub missing_records: u64,
    /// Number of records whose device counter does not rise: repetitions, and the first record after a restart of the
    /// device. Their poses are used.
    pub sequence_reversals: u64,
    /// Number of records without a pose: the sensor was out of view, or the device measures no position.
    pub without_pose: u64,
    /// Number of records of the needle.
    pub needle_records: u64,
    /// Sensor that is the needle; `None` before its first record, or without a needle.
    pub needle: Option<SensorName>,
    /// Number of records of sensors other than the tools'. If there are several sensors and none was chosen, all records
    /// count here.
    pub other_sensors: u64,
    /// Sensor that is the probe; `None` before any record, and if there are several sensors and none was chosen.
    pub sensor: Option<SensorName>,
    /// Whether several sensors were received and none was chosen.
    pub undecided: bool,
    /// Sensors received, in the order of their first records.
    pub sensors: Vec<RecordedSensor>,
    /// Number of poses dropped because their host time decreases or is implausible.
    pub time_reversals: u64,
    /// Events.
    pub events: Vec<Event>,
    /// Number of recorded poses of the probe used by the session.
    pub session_poses: u64,
    /// Number of recorded poses of the needle used by the session.
    pub needle_session_poses: u64,
    /// Settings of the session, if recorded.
    pub settings: Option<SessionSettings>,
    /// Unreadable parts of the file.
    pub damage: Damage,
    /// Time from the first record of the probe to the last.
    pub duration: Duration,
    /// Regularity of the poses; if there are none, regularity of the records.
    pub timing: Option<Timing>,
}

/// Sensor whose poses a recording holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordedSensor {
    /// Number of the Polhemus station, NDI port handle or tool.
    pub sensor: u16,
    /// Name of the tool, if the protocol has names.
    pub name: Option<String>,
    /// Number of records.
    pub records: u64,
    /// Number of records that hold a measurement.
    pub valid: u64,
    /// Times of the first and the last record, ns since 1970 (UTC).
    #[serde(skip)]
    span_ns: (u64, u64),
}

impl RecordedSensor {
    /// Name or number for messages.
    fn name(&self) -> SensorName {
        SensorName { number: self.sensor, name: self.name.clone() }
    }

    /// Mean record rate, Hz; `None` for fewer than two records.
    pub fn rate_hz(&self) -> Option<f64> {
        let (first, last) = self.span_ns;
        (last > first).then(|| (self.records - 1) as f64 / ((last - first) as f64 * 1e-9))
    }
}

impl fmt::Display for RecordedSensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} records, {} valid", self.name(), self.records, self.valid)?;
        self.rate_hz().map_or(Ok(()), |rate| write!(f, ", {rate:.1} a second"))
    }
}

impl RecordingSummary {
    /// Counts bytes that are not a record.
    pub(super) fn decode_error(&mut self, error: DecodeError) {
        self.decode_errors += 1;
        if self.decode_errors_first.len() < DESCRIBED {
            self.decode_errors_first.push(error);
        }
    }

    /// Counts a record of any sensor.
    pub(super) fn heard(&mut self, name: &SensorName, host_time_ns: u64, is_valid: bool) {
        let known = self.sensors.iter_mut().find(|known| known.sensor == name.number && known.name == name.name);
        match known {
            Some(known) => {
                known.records += 1;
                known.valid += u64::from(is_valid);
                known.span_ns.1 = known.span_ns.1.max(host_time_ns);
            }
            None => {
                let SensorName { number: sensor, name } = name.clone();
                let span_ns = (host_time_ns, host_time_ns);
                let first = RecordedSensor { sensor, name, records: 1, valid: u64::from(is_valid), span_ns };
                self.sensors.push(first);
            }
        }
    }

    /// Advice on choosing the probe in a recording with several sensors; `None` if it was chosen.
    pub fn advice(&self) -> Option<String> {
        let key = self.sensors.first().filter(|_| self.undecided)?.name().key();
        let list: Vec<String> = self.sensors.iter().map(RecordedSensor::to_string).collect();
        let list = list.join("; ");
        Some(format!(
            "it holds several sensors, and none was chosen as the probe ({list}): choose one by a station with `[tracker] \
             transport = \"recording\"`, its path and `{key}`, and `insonify record` it anew"
        ))
    }

    /// Whether everything in the file was used.
    pub fn is_clean(&self) -> bool {
        let lost = self.decode_errors + self.missing_records + self.sequence_reversals + self.time_reversals;
        lost == 0 && !self.undecided && self.damage == Damage::default()
    }

    /// Logs a warning unless everything in the file at `path` was used.
    pub fn warn_of_damage(&self, path: &Path) {
        if !self.is_clean() {
            tracing::warn!("{}: {self}", path.display());
        }
    }
}

impl fmt::Display for RecordingSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let seconds = self.duration.as_secs_f64();
        write!(f, "{} records in {} messages over {seconds:.1} s", self.records, self.messages)?;
        if let Some(truncated) = &self.damage.truncated {
            write!(f, "\nthe file is not whole: {truncated}; what was read ends after {seconds:.1} s")?;
        }
        let counted = [
            (self.damage.damaged, "damaged parts of the file left out"),
            (self.decode_errors, "pieces of the tracker's stream are no record"),
            (self.missing_records, "records missing by the tracker's counter"),
            (self.sequence_reversals, "records whose counter does not rise"),
            (self.without_pose, "records without a pose"),
            (self.needle_records, "records of the needle"),
            (
                self.other_sensors,
                if self.undecided {
                    "records of several sensors, of which none was chosen"
                } else {
                    "records of other sensors"
                },
            ),
            (self.time_reversals, "poses left out since their time does not fit among the others"),
        ];
        for (count, what) in counted {
            if count > 0 {
                write!(f, "\n{count} {what}")?;
            }
        }
        let examples = self.damage.damaged_first.iter().cloned();
        for example in examples.chain(self.decode_errors_first.iter().map(DecodeError::to_string)) {
            write!(f, "\n  {example}")?;
        }
        self.advice().map_or(Ok(()), |advice| write!(f, "\n{advice}"))
    }
}
