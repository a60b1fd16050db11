//! The poses of a recording.

use std::fmt;
use std::io::Read;
use std::path::Path;
use std::time::Duration;

use bytes::BytesMut;

use super::{Damage, Entry, Event, RecordingError, RecordingInfo, RecordingReader};
use crate::pose::{Reading, TimedPose};
use crate::tracker::arrival::ArrivalTimes;
use crate::tracker::{DecodeError, Record};

/// Most decode errors that are described; all are counted.
const DESCRIBED: usize = 8;

/// What a recording held, and what of it could not be used. [`Display`](fmt::Display) prints it for people.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingSummary {
    /// What the recording says about itself.
    pub info: RecordingInfo,
    /// Messages of tracker bytes.
    pub messages: u64,
    /// Bytes in them.
    pub bytes: u64,
    /// Records that were decoded, with those that were then left out.
    pub records: u64,
    /// Pieces of the stream that were no record.
    pub decode_errors: u64,
    /// The first few of those.
    pub decode_errors_first: Vec<DecodeError>,
    /// Records that the device's counter says are missing between others.
    pub missing_records: u64,
    /// Records whose device counter stands still or runs backward: repeated, or the device started anew. Their poses
    /// are used.
    pub sequence_reversals: u64,
    /// Records that hold no pose: the sensor was out of view, or the device knows no position.
    pub without_pose: u64,
    /// Poses left out since their host time lies before that of an earlier one.
    pub time_reversals: u64,
    /// Events.
    pub events: Vec<Event>,
    /// What of the file could not be read.
    pub damage: Damage,
    /// From the first pose to the last.
    pub duration: Duration,
}

impl RecordingSummary {
    /// Whether everything in the file was used.
    pub fn is_clean(&self) -> bool {
        let lost = self.decode_errors + self.missing_records + self.sequence_reversals + self.time_reversals;
        lost == 0 && self.damage == Damage::default()
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
            (self.time_reversals, "poses left out since their time runs backward"),
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

/// The poses of the recording at `path`, ascending in host time, decoded by the protocol that it names.
///
/// Several records of one message share its host time. What is whole in a damaged recording is used; the summary
/// says what was not.
///
/// # Errors
/// The file cannot be read, is no recording, or holds no whole pose.
pub fn poses(path: &Path) -> Result<(Vec<TimedPose>, RecordingSummary), RecordingError> {
    poses_of(RecordingReader::open(path)?, path)
}

/// [`poses`] of an open recording; errors call it `path`.
///
/// # Errors
/// The source cannot be read, or holds no whole pose.
pub fn poses_of<R: Read>(
    mut reader: RecordingReader<R>,
    path: &Path,
) -> Result<(Vec<TimedPose>, RecordingSummary), RecordingError> {
    let mut collector = Collector::new(reader.info().clone());
    let mut decoder = reader.info().protocol.decoder();
    let mut buffer = BytesMut::new();
    let mut times = ArrivalTimes::default();
    while let Some(entry) = reader.next_entry()? {
        match entry {
            Entry::Event(event) => collector.summary.events.push(event),
            Entry::Raw { host_time_ns, bytes } => {
                collector.summary.messages += 1;
                collector.summary.bytes += bytes.len() as u64;
                times.push(bytes.len(), host_time_ns);
                buffer.extend_from_slice(&bytes);
                loop {
                    let first_byte_ns = times.of_first_of(buffer.len());
                    match decoder.decode(&mut buffer) {
                        Ok(Some(record)) => collector.record(first_byte_ns, record),
                        Ok(None) => break,
                        Err(error) => collector.error(error),
                    }
                }
            }
        }
    }
    if let Err(error) = decoder.finish(&mut buffer) {
        collector.error(error);
    }
    collector.summary.damage = reader.damage().clone();
    collector.finish(path)
}

struct Collector {
    poses: Vec<TimedPose>,
    summary: RecordingSummary,
    sequence: Option<u32>,
}

impl Collector {
    fn new(info: RecordingInfo) -> Self {
        let summary = RecordingSummary {
            info,
            messages: 0,
            bytes: 0,
            records: 0,
            decode_errors: 0,
            decode_errors_first: Vec::new(),
            missing_records: 0,
            sequence_reversals: 0,
            without_pose: 0,
            time_reversals: 0,
            events: Vec::new(),
            damage: Damage::default(),
            duration: Duration::ZERO,
        };
        Self { poses: Vec::new(), summary, sequence: None }
    }

    fn record(&mut self, host_time_ns: u64, record: Record) {
        self.summary.records += 1;
        let last = std::mem::replace(&mut self.sequence, record.sequence);
        if let (Some(last), Some(sequence)) = (last, record.sequence) {
            // The counter wraps: what looks like more than half of its range forward is a step back.
            match sequence.wrapping_sub(last) {
                step @ 1..=0x7fff_ffff => self.summary.missing_records += u64::from(step - 1),
                _ => self.summary.sequence_reversals += 1,
            }
        }
        let Reading::Pose(pose) = record.reading else {
            self.summary.without_pose += 1;
            return;
        };
        if self.poses.last().is_some_and(|last| host_time_ns < last.host_time_ns) {
            self.summary.time_reversals += 1;
        } else {
            self.poses.push(TimedPose {
                host_time_ns,
                device_time_us: record.device_time_us.unwrap_or(host_time_ns / 1000),
                pose,
            });
        }
    }

    fn error(&mut self, error: DecodeError) {
        self.summary.decode_errors += 1;
        if self.summary.decode_errors_first.len() < DESCRIBED {
            self.summary.decode_errors_first.push(error);
        }
    }

    fn finish(mut self, path: &Path) -> Result<(Vec<TimedPose>, RecordingSummary), RecordingError> {
        let (Some(first), Some(last)) = (self.poses.first(), self.poses.last()) else {
            let summary = &self.summary;
            let damage = summary.damage.truncated.clone().or_else(|| summary.damage.damaged_first.first().cloned());
            let reason = damage
                .or_else(|| summary.decode_errors_first.first().map(DecodeError::to_string))
                .unwrap_or_else(|| "it has no message of tracker bytes".to_owned());
            return Err(RecordingError::NoPose { path: path.to_owned(), reason });
        };
        self.summary.duration = Duration::from_nanos(last.host_time_ns - first.host_time_ns);
        Ok((self.poses, self.summary))
    }
}
