//! Decoded content of a recording.

use std::collections::VecDeque;
use std::io::Read;

use insonify_core::pose::{Measurement, Reading};

use super::{Entry, Event, RecordingError, RecordingReader, RecordingSummary, SessionPose};
use crate::tracker::arrival::StampedBuffer;
use crate::tracker::selection::{Selection, Verdict};
use crate::tracker::{AxisMap, Decoder, NeedleSensor, ProbeSensor, Record, Settings, Transport, counter_step};

/// Item of a recording.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// A measurement of the probe's sensor, with the host time of its first byte.
    Measurement(Measurement),
    /// A measurement of the needle's sensor, with the host time of its first byte.
    NeedleMeasurement(Measurement),
    /// An event.
    Event(Event),
    /// A pose of the probe used by the session.
    Pose(SessionPose),
    /// A pose of the needle used by the session.
    NeedlePose(SessionPose),
}

/// Decodes a recording by its own protocol, in the order of the live session.
///
/// The intact parts of a damaged recording are used; [`finish`](Self::finish) reports the rest.
pub struct DecodedRecording<R> {
    reader: RecordingReader<R>,
    decoder: Decoder,
    axis_map: AxisMap,
    selection: Selection,
    buffer: StampedBuffer,
    items: VecDeque<Item>,
    sequence: Option<u32>,
    summary: RecordingSummary,
    ended: bool,
}

impl<R: Read> DecodedRecording<R> {
    /// Decodes the recording of `reader` with default device settings.
    pub fn new(reader: RecordingReader<R>) -> Self {
        Self::with_settings(reader, &Settings::default())
    }

    /// Decodes the recording of `reader` with the range and axis map of a puck (3D mouse) in `settings`, as a live
    /// session does. Protocol and sensors come from the recording. If no sensor was chosen for it, or none for the
    /// needle, the choice in `settings` applies, provided that it fits the recording's protocol.
    pub(crate) fn with_settings(reader: RecordingReader<R>, settings: &Settings) -> Self {
        let decoder = reader.info().protocol.decoder_of(&settings.device);
        let axis_map = settings.axis_map;
        let info = reader.info().clone();
        let is_for_these =
            settings.protocol == info.protocol || matches!(settings.transport, Transport::Recording { .. });
        let wanted = match &info.sensor {
            Some(ProbeSensor::Only) => {
                let is_possible = |probe: &ProbeSensor| match probe {
                    ProbeSensor::Tool(_) => info.protocol.has_names(),
                    _ => true,
                };
                let given = settings.device.probe().filter(|probe| is_for_these && is_possible(probe));
                Some(given.unwrap_or(ProbeSensor::Only))
            }
            chosen => chosen.clone(),
        };
        let needle = info.needle.clone().or_else(|| {
            let is_possible = |needle: &NeedleSensor| match needle {
                NeedleSensor::Tool(_) => info.protocol.has_names(),
                NeedleSensor::Number(_) => true,
            };
            let given = settings.device.needle.clone().filter(|needle| is_for_these && is_possible(needle));
            given.filter(|needle| !wanted.as_ref().is_some_and(|probe| needle.is_chosen_by(probe)))
        });
        let selection = Selection::new(wanted, needle);
        let summary = RecordingSummary { info, ..RecordingSummary::default() };
        let (buffer, items) = (StampedBuffer::default(), VecDeque::new());
        Self { reader, decoder, axis_map, selection, buffer, items, sequence: None, summary, ended: false }
    }

    /// Next item; `None` at the end of the readable part.
    ///
    /// # Errors
    /// The file cannot be read, or has compressed chunks.
    pub fn next_item(&mut self) -> Result<Option<Item>, RecordingError> {
        while self.items.is_empty() && !self.ended {
            match self.reader.next_entry()? {
                Some(Entry::Raw { host_time_ns, bytes }) => self.raw(host_time_ns, &bytes),
                Some(Entry::Event(event)) => {
                    self.summary.events.push(event.clone());
                    self.items.push_back(Item::Event(event));
                }
                Some(Entry::Pose(pose)) => {
                    self.summary.session_poses += 1;
                    self.items.push_back(Item::Pose(pose));
                }
                Some(Entry::NeedlePose(pose)) => {
                    self.summary.needle_session_poses += 1;
                    self.items.push_back(Item::NeedlePose(pose));
                }
                None => {
                    self.ended = true;
                    if let Err(error) = self.decoder.finish(&mut self.buffer.bytes) {
                        self.summary.decode_error(error);
                    }
                }
            }
        }
        Ok(self.items.pop_front())
    }

    /// Summary so far. The functions that collect poses set `time_reversals`, `duration` and `timing` afterwards.
    pub fn finish(mut self) -> RecordingSummary {
        self.summary.damage = self.reader.damage().clone();
        self.summary.settings = self.reader.settings().cloned();
        self.summary.sensor = self.selection.used().cloned();
        self.summary.undecided = self.selection.is_undecided();
        self.summary.needle = self.selection.needle().cloned();
        self.summary
    }

    fn raw(&mut self, host_time_ns: u64, bytes: &[u8]) {
        self.summary.messages += 1;
        self.summary.bytes += bytes.len() as u64;
        self.buffer.push(bytes, host_time_ns);
        loop {
            let first_byte_ns = self.buffer.first_byte_ns();
            match self.decoder.decode(&mut self.buffer.bytes) {
                Ok(Some(record)) => self.record(first_byte_ns, record),
                Ok(None) => break,
                Err(error) => self.summary.decode_error(error),
            }
        }
    }

    fn record(&mut self, host_time_ns: u64, mut record: Record) {
        self.summary.records += 1;
        let name = self.decoder.name_of(record.sensor);
        let (verdict, at) = self.selection.judge(&mut record, name);
        if let Some(sensor) = at.and_then(|at| self.selection.heard().get(at)) {
            self.summary.heard(sensor, host_time_ns, record.reading != Reading::OutOfView);
        }
        match verdict {
            Verdict::Probe => {}
            Verdict::Needle => {
                self.summary.needle_records += 1;
                let measurement = self.axis_map.apply(record).measurement(host_time_ns);
                self.items.push_back(Item::NeedleMeasurement(measurement));
                return;
            }
            Verdict::Other | Verdict::Undecided => {
                self.summary.other_sensors += 1;
                return;
            }
        }
        let last = std::mem::replace(&mut self.sequence, record.sequence);
        let (missing, reversed) = counter_step(last, record.sequence);
        self.summary.missing_records += missing;
        self.summary.sequence_reversals += u64::from(reversed);
        let record = self.axis_map.apply(record);
        if !matches!(record.reading, Reading::Pose(_)) {
            self.summary.without_pose += 1;
        }
        self.items.push_back(Item::Measurement(record.measurement(host_time_ns)));
    }
}
