//! Recordings of raw tracker bytes. A replay runs the same decoder as the live session.
//!
//! A recording is an [MCAP](https://mcap.dev) file without compression. Its times are ns since 1970 (UTC).
//!
//! | channel | message encoding | content |
//! |---|---|---|
//! | [`RAW_TOPIC`] | `application/octet-stream` | bytes as received from the tracker, split anywhere; `log_time` is the arrival of the message's first byte |
//! | [`EVENT_TOPIC`] | `json` | `{"name": "...", "value": ...}`: a marked moment, for example a key frame, or a changed control; `value` is optional |
//! | [`POSE_TOPIC`] | `json`, schema `foxglove.PoseInFrame` | `scene_from_probe` as the session used it, and its `state`; **metres**, as viewers expect; frame `scene` |
//! | [`NEEDLE_POSE_TOPIC`] | as [`POSE_TOPIC`] | `scene_from_needle` as the session used it; only in sessions with a needle |
//!
//! Marks on pictures (measurements, texts, body marks) are also events ([`Marks`]). [`EXAM_EVENT`] names the planes to
//! find in a session. Events whose names begin with `needle.` tell what the tip of a needle did. Events whose names begin
//! with `truth.` describe a generated session, for training: reports use them only for the planes of a recording without
//! [`EXAM_EVENT`].
//!
//! Metadata of the raw channel: `protocol` (a name of [`Protocol`]), `device`, `scene` (frame of the poses),
//! `start_time_ns` and `format_version`. The choice of the probe among several sensors is `sensor` (a number), `tool`
//! (a name; `format_version` is 2 then), or `probe` = `only` if none was chosen. Without any of these, the first
//! sensor received is the probe. The choice of the needle is `needle_sensor` or `needle_tool` (`format_version` is 3
//! then). A `device` that begins with `imported from` marks poses that are `scene_from_probe`
//! already: no station's calibration applies to them.
//!
//! The bytes come from one sender: datagrams of a second sender are left out, and an event names it.
//!
//! A live session adds a metadata record [`SETTINGS_NAME`] (version, seed, adapter, station_path) and the text of its
//! station file as the attachment [`STATION_NAME`]; see [`SessionSettings`].
//!
//! A live station writes through a [`Recorder`], on a separate thread.

use std::path::PathBuf;

use insonify_core::files::FileError;
use insonify_core::pose::{Pose, TrackingState};
use thiserror::Error;

use crate::tracker::{NeedleSensor, ProbeSensor, Protocol, TrackerEvent, TrackerStream, UnknownProtocol};

#[cfg(feature = "recordings")]
mod attached;
mod caliper;
#[cfg(feature = "live")]
mod capture;
#[cfg(feature = "recordings")]
mod decoded;
#[cfg(feature = "recordings")]
mod in_order;
#[cfg(feature = "recordings")]
mod inspection;
pub mod interchange;
mod mark_report;
mod marked;
mod marks;
#[cfg(feature = "recordings")]
mod mcap_record;
#[cfg(feature = "recordings")]
mod part;
#[cfg(feature = "live")]
mod playback;
#[cfg(feature = "recordings")]
mod pose_json;
#[cfg(feature = "recordings")]
mod poses;
#[cfg(not(feature = "recordings"))]
#[path = "no_poses.rs"]
mod poses;
#[cfg(feature = "recordings")]
mod reader;
#[cfg(feature = "recordings")]
mod recorder;
#[cfg(feature = "recordings")]
mod report;
#[cfg(feature = "recordings")]
mod summary;
mod timing;
#[cfg(feature = "recordings")]
mod writer;
#[cfg(not(feature = "recordings"))]
#[path = "no_writer.rs"]
mod writer;

pub use caliper::ellipse_circumference_mm;
pub use caliper::{CALIPER_EVENT, CaliperEvent, MeasureKind};
#[cfg(feature = "live")]
pub use capture::Capture;
#[cfg(feature = "recordings")]
pub use decoded::{DecodedRecording, Item};
#[cfg(feature = "recordings")]
pub use inspection::Inspection;
pub use mark_report::MarkReport;
pub use marked::MarkedFrame;
pub use marks::{BODY_MARK_EVENT, Marks, REMOVAL_EVENT, RecordedMark, TEXT_EVENT, mark_event, removal_event};
#[cfg(feature = "recordings")]
pub use part::part_path;
#[cfg(feature = "live")]
pub use playback::{RecordingPlayback, spawn, stream_of};
pub use poses::calibration_for;
pub use poses::poses;
#[cfg(feature = "recordings")]
pub use poses::{RecordedMeasurements, measurements, poses_of, read_all};
#[cfg(feature = "recordings")]
pub use poses::{RecordedTools, ToolPoses, read_tools};
#[cfg(feature = "recordings")]
pub use reader::{Damage, RecordingReader};
#[cfg(feature = "recordings")]
pub use recorder::{QueueLimits, Recorded, Recorder, RecorderError, RecorderHandle};
#[cfg(feature = "recordings")]
pub use report::RecordingReport;
#[cfg(feature = "recordings")]
pub use summary::{RecordedSensor, RecordingSummary};
pub use timing::{GAP_NS, Timing};
pub use writer::RecordingWriter;

/// Channel of the tracker's bytes.
pub const RAW_TOPIC: &str = "/tracker/raw";

/// Channel of events.
pub const EVENT_TOPIC: &str = "/exam/events";

/// Channel of the poses used by a session.
pub const POSE_TOPIC: &str = "/probe/pose";

/// Channel of the needle's poses used by a session.
pub const NEEDLE_POSE_TOPIC: &str = "/needle/pose";

/// Name of the metadata record with a session's settings.
pub const SETTINGS_NAME: &str = "insonify.settings";

/// Name of the attachment with the text of the station file.
pub const STATION_NAME: &str = "station.toml";

/// Latest version of this format; readers refuse later versions. Version 2 can name a tool as the probe, version 3 the
/// needle's sensor.
pub const FORMAT_VERSION: u32 = 3;

/// Prefix of `device` in imported recordings. Their poses are `scene_from_probe` already, so no calibration applies.
pub(crate) const IMPORTED: &str = "imported from ";

/// Value of the metadata `probe` if no sensor was chosen.
#[cfg(feature = "recordings")]
const ONLY: &str = "only";

/// Description of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RecordingInfo {
    /// Wire format of the bytes.
    pub protocol: Protocol,
    /// Name of the tracker, for information. A name that begins with `imported from` marks poses that are in the scene
    /// frame.
    pub device: String,
    /// Scene that defines the frame of the poses, for information.
    pub scene: String,
    /// Start of the recording, ns since 1970 (UTC). For a live session, time 0 of its clock and of the scene's motion.
    pub start_time_ns: u64,
    /// Choice of the probe among several sensors; `None` takes the first sensor received, as earlier builds did.
    pub sensor: Option<ProbeSensor>,
    /// Choice of the needle; `None` if no needle was tracked.
    pub needle: Option<NeedleSensor>,
}

impl RecordingInfo {
    /// Protocol of the bytes, and the sensors of probe and needle.
    pub fn stream(&self) -> TrackerStream {
        TrackerStream { protocol: self.protocol, sensor: self.sensor.clone(), needle: self.needle.clone() }
    }
}

/// Settings of a session. Together with the tracker's bytes and the events, they determine its frames.
#[derive(Debug, Clone, PartialEq, Eq, Default, serde::Serialize)]
pub struct SessionSettings {
    /// Version of insonify.
    pub version: String,
    /// Seed of all random choices.
    pub seed: u32,
    /// Name of the rendering device; empty if nothing was rendered.
    pub adapter: String,
    /// Path of the station file, for information.
    pub station_path: String,
    /// Text of the station file.
    pub station: String,
}

/// A marked moment of a session.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Event {
    /// Time, ns since 1970 (UTC).
    pub host_time_ns: u64,
    /// Name of the event.
    pub name: String,
    /// Value of a changed control (gain in dB, frozen or not, ...), or other content of the event; `None` if there is
    /// none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<serde_json::Value>,
}

impl Event {
    /// An event without a value.
    pub fn new(host_time_ns: u64, name: impl Into<String>) -> Self {
        Self { host_time_ns, name: name.into(), value: None }
    }

    /// The same event with a value.
    #[must_use]
    pub fn with(mut self, value: impl Into<serde_json::Value>) -> Self {
        self.value = Some(value.into());
        self
    }
}

/// Name of the event that lists the planes to find in a session.
pub const EXAM_EVENT: &str = "exam.planes";

/// Name of the event for a lost tracker port.
pub const DISCONNECTED_EVENT: &str = "tracker-disconnected";

/// Event to record for a tracker event; `None` for damaged bytes, which the recording contains anyway.
pub fn event_of(host_time_ns: u64, event: &TrackerEvent) -> Option<Event> {
    let name = match event {
        TrackerEvent::DecodeError(_) | TrackerEvent::Damaged(_) => return None,
        TrackerEvent::Disconnected { .. } => DISCONNECTED_EVENT,
        _ => "tracker",
    };
    Some(Event::new(host_time_ns, name).with(event.to_string()))
}

/// A pose used by a session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SessionPose {
    /// Time for which the pose was estimated, ns since 1970 (UTC).
    pub host_time_ns: u64,
    /// `scene_from_probe`, or `scene_from_needle` of a needle's pose.
    pub pose: Pose,
    /// Tracking state of the pose.
    pub state: TrackingState,
}

/// One message of a recording.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// Bytes from the tracker.
    Raw {
        /// Arrival of the first byte, ns since 1970 (UTC).
        host_time_ns: u64,
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// An event.
    Event(Event),
    /// A pose of the probe used by the session.
    Pose(SessionPose),
    /// A pose of the needle used by the session.
    NeedlePose(SessionPose),
}

/// Errors in reading or writing a recording.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The build lacks the feature `recordings`.
    #[error("cannot use {path}: insonify was built without the feature `recordings`; build it with that feature")]
    NotBuilt {
        /// File.
        path: PathBuf,
    },
    /// The file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file doesn't exist, but the partial file of an interrupted recording does.
    #[error("the recording {path} was not finished; what was written of it is {part}")]
    Unfinished {
        /// Requested file.
        path: PathBuf,
        /// The partial file.
        part: PathBuf,
    },
    /// Another process is writing this recording.
    #[error("another process is recording to {path}")]
    Busy {
        /// File.
        path: PathBuf,
    },
    /// The file could not be written.
    #[error("cannot write the recording {path}: {reason}")]
    Write {
        /// File.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
    /// The file is of another kind.
    #[error("{path} is not a recording: its first 8 bytes are not those of an MCAP file")]
    NotMcap {
        /// File.
        path: PathBuf,
    },
    /// An MCAP file without tracker bytes, or truncated before the first of them.
    #[error("{path} holds no tracker data: {reason}")]
    NoTracker {
        /// File.
        path: PathBuf,
        /// Missing part of the file.
        reason: String,
    },
    /// Metadata of the raw channel is missing or wrong.
    #[error("channel {RAW_TOPIC} of {path}: metadata `{key}` is {found}; it must be {expected}")]
    Metadata {
        /// File.
        path: PathBuf,
        /// Key.
        key: &'static str,
        /// Value found, as text.
        found: String,
        /// Accepted values.
        expected: String,
    },
    /// No decoder for these bytes.
    #[error("channel {RAW_TOPIC} of {path}: {source}")]
    Protocol {
        /// File.
        path: PathBuf,
        /// The unknown protocol.
        source: UnknownProtocol,
    },
    /// Chunks with unsupported compression.
    #[error(
        "{path} has chunks compressed by `{compression}`; recordings are read uncompressed: `mcap decompress` makes one"
    )]
    Compressed {
        /// File.
        path: PathBuf,
        /// Name of the compression.
        compression: String,
    },
    /// Tracker bytes without a complete pose.
    #[error("{path} holds no whole pose: {reason}")]
    NoPose {
        /// File.
        path: PathBuf,
        /// The first fault.
        reason: String,
    },
}
