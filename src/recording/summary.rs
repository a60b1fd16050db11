//! Summary of a recording's content.

use std::fmt;
use std::path::Path;
use std::time::Duration;

use super::{Damage, Event, RecordingInfo, SessionSettings};
use crate::tracker::DecodeError;

/// Largest number of described decode errors; all are counted.
const DESCRIBED: usize = 8;

/// Content of a recording, and its unusable parts. [`Display`](fmt::Display) formats it as a report.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecordingSummary {
    /// Description of the recording.
    pub info: RecordingInfo,
    /// Messages of tracker bytes.
    pub messages: u64,
    /// Bytes in them.
    pub bytes: u64,
    /// Decoded records, including those dropped afterwards.
    pub records: u64,
    /// Pieces of the stream that are not records.
    pub decode_errors: u64,
    /// The first few of those errors.
    pub decode_errors_first: Vec<DecodeError>,
    /// Records missing by the device's counter.
    pub missing_records: u64,
    /// Records whose device counter does not rise: repetitions, or after a restart of the device. Their poses are used.
    pub sequence_reversals: u64,
    /// Records without a pose: the sensor was out of view, or the device measures no position.
    pub without_pose: u64,
    /// Records of sensors other than the selected one.
    pub other_sensors: u64,
    /// Selected sensor; `None` before any record.
    pub sensor: Option<u16>,
    /// Poses dropped because their host time decreases or is implausible.
    pub time_reversals: u64,
    /// Events.
    pub events: Vec<Event>,
    /// Number of recorded poses used by the session.
    pub session_poses: u64,
    /// Settings of the session, if recorded.
    pub settings: Option<SessionSettings>,
    /// Unreadable parts of the file.
    pub damage: Damage,
    /// Time from the first pose to the last.
    pub duration: Duration,
}

impl RecordingSummary {
    /// Counts bytes that are not a record.
    pub(super) fn decode_error(&mut self, error: DecodeError) {
        self.decode_errors += 1;
        if self.decode_errors_first.len() < DESCRIBED {
            self.decode_errors_first.push(error);
        }
    }

    /// Whether everything in the file was used.
    pub fn is_clean(&self) -> bool {
        let lost = self.decode_errors + self.missing_records + self.sequence_reversals + self.time_reversals;
        lost == 0 && self.damage == Damage::default()
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
            write!(f, "\nthe file is not whole: {truncated}")?;
        }
        let counted = [
            (self.damage.damaged, "damaged parts of the file left out"),
            (self.decode_errors, "pieces of the tracker's stream are no record"),
            (self.missing_records, "records missing by the tracker's counter"),
            (self.sequence_reversals, "records whose counter does not rise"),
            (self.without_pose, "records without a pose"),
            (self.other_sensors, "records of other sensors"),
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
        Ok(())
    }
}
