//! Report on a recording.

use std::path::Path;

use serde::Serialize;

use super::RecordingSummary;

/// Contents of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecordingReport<'a> {
    /// File.
    pub path: String,
    /// Name of the tracker.
    pub device: &'a str,
    /// Scene that defines the frame of the poses.
    pub scene: &'a str,
    /// Number of decoded records.
    pub records: u64,
    /// Duration from the first record to the last, s.
    pub duration_s: f64,
    /// Whether everything in the file was used.
    pub clean: bool,
    /// Reason for an early end of the file; `None` if the file is complete.
    pub truncated: Option<&'a str>,
    /// Number of damaged parts that were left out.
    pub damaged_parts: u64,
    /// Number of pieces of the stream that are not records.
    pub decode_errors: u64,
    /// Number of records missing, according to gaps in their counter.
    pub missing_records: u64,
    /// Number of records whose counter did not rise.
    pub sequence_reversals: u64,
    /// Number of poses dropped because their host time decreases or is implausible.
    pub time_reversals: u64,
    /// Number of records of other sensors.
    pub other_sensors: u64,
}

impl<'a> RecordingReport<'a> {
    /// Report of `summary` for the recording at `path`.
    pub fn new(path: &Path, summary: &'a RecordingSummary) -> Self {
        Self {
            path: path.display().to_string(),
            device: &summary.info.device,
            scene: &summary.info.scene,
            records: summary.records,
            duration_s: summary.duration.as_secs_f64(),
            clean: summary.is_clean(),
            truncated: summary.damage.truncated.as_deref(),
            damaged_parts: summary.damage.damaged,
            decode_errors: summary.decode_errors,
            missing_records: summary.missing_records,
            sequence_reversals: summary.sequence_reversals,
            time_reversals: summary.time_reversals,
            other_sensors: summary.other_sensors,
        }
    }
}
