//! Writer of recordings.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::write::NoSeek;

use super::{
    EVENT_TOPIC, Event, FORMAT_VERSION, NEEDLE_POSE_TOPIC, ONLY, POSE_TOPIC, RAW_TOPIC, RecordingError, RecordingInfo,
    SessionPose, SessionSettings, attached, part, part_path, pose_json,
};
use crate::tracker::{NeedleSensor, ProbeSensor};

/// Longest duration of a chunk, ns: a killed recording loses at most this.
const CHUNK_NS: u64 = 1_000_000_000;

/// Largest size of a chunk, bytes.
const CHUNK_BYTES: u64 = 64 * 1024;

/// Writer of one recording.
///
/// The file is called `NAME.part` until [`finish`](Self::finish), which replaces `NAME` atomically. An unfinished
/// recording can be read from its `.part`, except for the last second. If another process is writing an existing
/// `.part`, creating the writer fails; a `.part` left by a killed process is renamed to `NAME.recovered-1.mcap`.
pub struct RecordingWriter {
    mcap: mcap::Writer<NoSeek<BufWriter<File>>>,
    path: PathBuf,
    part: PathBuf,
    raw_channel: u16,
    event_channel: u16,
    /// Channel of poses; `None` before the first pose.
    pose_channel: Option<u16>,
    /// Channel of the needle's poses; `None` before the first one.
    needle_channel: Option<u16>,
    /// Number of messages of each channel.
    counts: BTreeMap<u16, u32>,
    /// Text of the last pose message; kept to reuse its memory.
    pose_json: String,
    chunk_start_ns: u64,
}

impl RecordingWriter {
    /// Starts a recording at `path`.
    ///
    /// # Errors
    /// The file cannot be written, or another process is recording to it.
    pub fn create(path: &Path, info: &RecordingInfo) -> Result<Self, RecordingError> {
        let file = part::create(path)?;
        let part = part_path(path);
        // Without seeking, each chunk is one write: after a kill, all chunks are complete.
        let options = mcap::WriteOptions::new()
            .compression(None)
            .chunk_size(Some(CHUNK_BYTES))
            .disable_seeking(true)
            .library(concat!("insonify/", env!("CARGO_PKG_VERSION")))
            .profile("insonify");
        let mut mcap = options.create(NoSeek::new(BufWriter::new(file))).map_err(|error| fail(&part, error))?;
        let mut metadata = BTreeMap::from([
            ("protocol".to_owned(), info.protocol.name().to_owned()),
            ("device".to_owned(), info.device.clone()),
            ("scene".to_owned(), info.scene.clone()),
            ("start_time_ns".to_owned(), info.start_time_ns.to_string()),
            ("format_version".to_owned(), format_version(info).to_string()),
        ]);
        metadata.extend(info.sensor.as_ref().map(|sensor| {
            let (key, value) = match sensor {
                ProbeSensor::Only => ("probe", ONLY.to_owned()),
                ProbeSensor::Number(number) => ("sensor", number.to_string()),
                ProbeSensor::Tool(tool) => ("tool", tool.clone()),
            };
            (key.to_owned(), value)
        }));
        metadata.extend(info.needle.as_ref().map(|needle| {
            let (key, value) = match needle {
                NeedleSensor::Number(number) => ("needle_sensor", number.to_string()),
                NeedleSensor::Tool(tool) => ("needle_tool", tool.clone()),
            };
            (key.to_owned(), value)
        }));
        let mut channel = |topic, encoding, metadata: &BTreeMap<_, _>| {
            mcap.add_channel(0, topic, encoding, metadata).map_err(|error| fail(&part, error))
        };
        let raw_channel = channel(RAW_TOPIC, "application/octet-stream", &metadata)?;
        let event_channel = channel(EVENT_TOPIC, "json", &BTreeMap::new())?;
        // Flushed as a separate chunk, so the channels are written immediately.
        mcap.flush().map_err(|error| fail(&part, error))?;
        Ok(Self {
            mcap,
            path: path.to_owned(),
            part,
            raw_channel,
            event_channel,
            pose_channel: None,
            needle_channel: None,
            counts: BTreeMap::new(),
            pose_json: String::new(),
            chunk_start_ns: info.start_time_ns,
        })
    }

    /// Stores the settings of the session, before the first message.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn settings(&mut self, settings: &SessionSettings) -> Result<(), RecordingError> {
        let written = self
            .mcap
            .write_metadata(&attached::metadata(settings))
            .and_then(|()| self.mcap.attach(&attached::station(settings, self.chunk_start_ns)))
            .and_then(|()| self.mcap.flush());
        written.map_err(|error| fail(&self.part, error))
    }

    /// Appends bytes of the tracker; the first arrived at `host_time_ns`.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn raw(&mut self, host_time_ns: u64, bytes: &[u8]) -> Result<(), RecordingError> {
        self.message(self.raw_channel, host_time_ns, bytes)
    }

    /// Appends an event.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn event(&mut self, event: &Event) -> Result<(), RecordingError> {
        let mut json = serde_json::json!({ "name": event.name });
        if let Some(value) = &event.value {
            json["value"] = value.clone();
        }
        self.message(self.event_channel, event.host_time_ns, json.to_string().as_bytes())
    }

    /// Appends a pose of the probe used by the session.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn pose(&mut self, pose: &SessionPose) -> Result<(), RecordingError> {
        let channel_id = match self.pose_channel {
            Some(id) => id,
            None => {
                let id = self.add_pose_channel(POSE_TOPIC, pose_json::SCHEMA)?;
                *self.pose_channel.insert(id)
            }
        };
        self.pose_message(channel_id, pose)
    }

    /// Appends a pose of the needle used by the session.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn needle_pose(&mut self, pose: &SessionPose) -> Result<(), RecordingError> {
        let channel_id = match self.needle_channel {
            Some(id) => id,
            None => {
                let id = self.add_pose_channel(NEEDLE_POSE_TOPIC, &pose_json::needle_schema())?;
                *self.needle_channel.insert(id)
            }
        };
        self.pose_message(channel_id, pose)
    }

    fn add_pose_channel(&mut self, topic: &str, schema: &str) -> Result<u16, RecordingError> {
        let schema = self.mcap.add_schema(pose_json::SCHEMA_NAME, "jsonschema", schema.as_bytes());
        let channel = schema.and_then(|id| self.mcap.add_channel(id, topic, "json", &BTreeMap::new()));
        channel.map_err(|error| fail(&self.part, error))
    }

    fn pose_message(&mut self, channel_id: u16, pose: &SessionPose) -> Result<(), RecordingError> {
        let mut json = std::mem::take(&mut self.pose_json);
        pose_json::encode(pose, &mut json);
        let written = self.message(channel_id, pose.host_time_ns, json.as_bytes());
        self.pose_json = json;
        written
    }

    /// Flushes to the operating system. If the process is killed later, all earlier messages are safe.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.mcap.flush().map_err(|error| fail(&self.part, error))
    }

    fn message(&mut self, channel_id: u16, time_ns: u64, bytes: &[u8]) -> Result<(), RecordingError> {
        // In both directions: the chunk also ends if a wrong time far in the future is followed by right ones.
        if time_ns.abs_diff(self.chunk_start_ns) >= CHUNK_NS {
            self.flush()?;
            self.chunk_start_ns = time_ns;
        }
        let count = self.counts.entry(channel_id).or_default();
        let header = MessageHeader { channel_id, sequence: *count, log_time: time_ns, publish_time: time_ns };
        *count = count.wrapping_add(1);
        self.mcap.write_to_known_channel(&header, bytes).map_err(|error| fail(&self.part, error))
    }

    /// Writes the index, syncs the file to disk and renames it.
    ///
    /// # Errors
    /// The file cannot be written or renamed; the `.part` is kept.
    pub fn finish(mut self) -> Result<(), RecordingError> {
        self.mcap.finish().map_err(|error| fail(&self.part, error))?;
        let file = self.mcap.into_inner().into_inner().into_inner().map_err(io::Error::from);
        file.and_then(|file| file.sync_all()).map_err(|error| fail(&self.part, error))?;
        std::fs::rename(&self.part, &self.path).map_err(|error| fail(&self.path, error))
    }

    /// Removes the partial file; an existing file with the recording's name is kept.
    ///
    /// # Errors
    /// The `.part` cannot be removed.
    pub(crate) fn discard(self) -> Result<(), RecordingError> {
        let Self { mcap, part, .. } = self;
        // The file is closed first: some systems cannot remove an open file.
        drop(mcap);
        std::fs::remove_file(&part).map_err(|error| fail(&part, error))
    }
}

/// Earliest version of the format that can express `info`.
fn format_version(info: &RecordingInfo) -> u32 {
    match (&info.needle, &info.sensor) {
        (Some(_), _) => FORMAT_VERSION,
        (None, Some(ProbeSensor::Tool(_))) => 2,
        (None, _) => 1,
    }
}

/// Error with all its causes: MCAP's errors give the system's reason only as a cause.
fn fail(path: &Path, error: impl std::error::Error) -> RecordingError {
    let mut reason = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        reason = format!("{reason}: {error}");
        cause = error.source();
    }
    RecordingError::Write { path: path.to_owned(), reason }
}
