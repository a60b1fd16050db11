//! Recordings of raw tracker bytes, so that a replay runs through the decoder of a live session.
//!
//! A recording is an [MCAP](https://mcap.dev) file without compression. Its times are ns since 1970 (UTC).
//!
//! | channel | message encoding | content |
//! |---|---|---|
//! | [`RAW_TOPIC`] | `application/octet-stream` | bytes as they came from the tracker, cut anywhere; `log_time` is when the first of them came |
//! | [`EVENT_TOPIC`] | `json` | `{"name": "..."}`: something worth finding again, a key frame for example |
//!
//! The metadata of the raw channel: `protocol` (a name of [`Protocol`]), `device`, `scene` (in whose frame the poses
//! are), `start_time_ns` and `format_version`.

use std::path::PathBuf;

use thiserror::Error;

use super::{Protocol, UnknownProtocol};

mod poses;
mod reader;
mod writer;

pub use poses::{RecordingSummary, poses, poses_of};
pub use reader::{Damage, RecordingReader};
pub use writer::RecordingWriter;

/// Channel of the tracker's bytes.
pub const RAW_TOPIC: &str = "/tracker/raw";

/// Channel of events.
pub const EVENT_TOPIC: &str = "/exam/events";

/// Version of this format; a reader refuses a later one.
pub const FORMAT_VERSION: u32 = 1;

/// What a recording says about itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordingInfo {
    /// Wire format of the bytes.
    pub protocol: Protocol,
    /// The tracker, for people.
    pub device: String,
    /// The scene in whose frame the poses are, for people.
    pub scene: String,
    /// When the recording started, ns since 1970 (UTC).
    pub start_time_ns: u64,
}

/// Something worth finding again.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Event {
    /// When, ns since 1970 (UTC).
    pub host_time_ns: u64,
    /// What.
    pub name: String,
}

/// One message of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Entry {
    /// Bytes of the tracker.
    Raw {
        /// When the first of them came, ns since 1970 (UTC).
        host_time_ns: u64,
        /// The bytes.
        bytes: Vec<u8>,
    },
    /// An event.
    Event(Event),
}

/// Why a recording cannot be used, or not be written.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file could not be read.
    #[error("cannot read the recording {path}: {source}")]
    Read {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The file could not be written.
    #[error("cannot write the recording {path}: {reason}")]
    Write {
        /// File.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
    /// Another kind of file.
    #[error("{path} is not a recording: its first 8 bytes are not those of an MCAP file")]
    NotMcap {
        /// File.
        path: PathBuf,
    },
    /// An MCAP file without tracker bytes, or cut before them.
    #[error("{path} holds no tracker data: {reason}")]
    NoTracker {
        /// File.
        path: PathBuf,
        /// What was missing.
        reason: String,
    },
    /// Metadata of the raw channel is missing or wrong.
    #[error("channel {RAW_TOPIC} of {path}: metadata `{key}` is {found}; it must be {expected}")]
    Metadata {
        /// File.
        path: PathBuf,
        /// Key.
        key: &'static str,
        /// What was found, ready to print.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// No decoder for these bytes.
    #[error("channel {RAW_TOPIC} of {path}: {source}")]
    Protocol {
        /// File.
        path: PathBuf,
        /// Which protocol.
        source: UnknownProtocol,
    },
    /// Chunks that this program cannot unpack.
    #[error(
        "{path} has chunks compressed by `{compression}`; recordings are read uncompressed: `mcap decompress` makes one"
    )]
    Compressed {
        /// File.
        path: PathBuf,
        /// Name of the compression.
        compression: String,
    },
    /// Tracker bytes, but no whole pose in them.
    #[error("{path} holds no whole pose: {reason}")]
    NoPose {
        /// File.
        path: PathBuf,
        /// First thing that was wrong.
        reason: String,
    },
}
