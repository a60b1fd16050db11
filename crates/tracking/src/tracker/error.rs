//! Errors in starting a tracker session.

use std::io;

use thiserror::Error;

use super::ndi::RomError;
use super::playback::PlaybackError;

/// Reason why a session cannot be started.
#[derive(Debug, Error)]
pub enum TrackerError {
    /// The transport can't carry the protocol.
    #[error("trackers that speak `{protocol}` aren't reached by transport `{transport}`")]
    Mismatch {
        /// Name of the protocol.
        protocol: &'static str,
        /// Name of the transport.
        transport: &'static str,
    },
    /// A tool chosen by name, for a protocol that numbers its sensors.
    #[error(
        "`{protocol}` has no named tools, so the probe can't be `{tool}`: give its number, `[tracker] sensor` or `--sensor`"
    )]
    NoNames {
        /// Tool.
        tool: String,
        /// Name of the protocol.
        protocol: &'static str,
    },
    /// A sensor chosen by number, for a protocol that names its tools.
    #[error(
        "`{protocol}` numbers its tools by arrival, so the probe can't be sensor {number}: give its name, `[tracker] tool` or `--tool`"
    )]
    NoNumbers {
        /// Number.
        number: u16,
        /// Name of the protocol.
        protocol: &'static str,
    },
    /// The transport is not included in this build.
    #[error("this insonify was built without the feature `{feature}`, which the transport needs")]
    NotBuilt {
        /// Cargo feature.
        feature: &'static str,
    },
    /// A recording that can't be played.
    #[error(transparent)]
    Playback(PlaybackError),
    /// The transport is a recording, but no bytes were given.
    #[error("the transport is a recording, whose bytes were not given; `recording::spawn` opens it")]
    NoPlayback,
    /// Recorded bytes were given, but the transport is no recording.
    #[error("recorded bytes were given, and the transport is {transport}; `tracker::spawn` opens devices")]
    NoRecording {
        /// Name of the transport.
        transport: &'static str,
    },
    /// The description file of a wireless tool is unusable.
    #[error(transparent)]
    Rom(#[from] RomError),
    /// The system cannot provide a thread or an event queue.
    #[error("cannot start the tracker's thread: {0}")]
    Thread(#[source] io::Error),
}
