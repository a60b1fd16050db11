//! Receiver of a tracker session's bytes, records and events.

use std::time::Duration;

use super::{DecodeError, Record};

/// Receiver of one tracker's bytes, records and events, called on the tracker's thread. It must not block.
pub trait Listener: Send {
    /// Receives each piece of the stream before decoding, with the arrival of its first byte, ns since 1970 (UTC).
    fn bytes(&mut self, host_time_ns: u64, bytes: &[u8]);

    /// Receives a record, with the arrival of its first byte, ns since 1970 (UTC).
    fn record(&mut self, host_time_ns: u64, record: &Record);

    /// Receives an event, with its time, ns since 1970 (UTC).
    fn event(&mut self, host_time_ns: u64, event: &TrackerEvent);
}

/// Event of a session.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum TrackerEvent {
    /// The port is open.
    Connected {
        /// Name of the port.
        port: String,
    },
    /// The port could not be opened, or was lost.
    Disconnected {
        /// Cause.
        reason: String,
        /// Time until the next attempt.
        retry: Duration,
    },
    /// No record arrived within the silence limit. The device is restarted: first on the open port, then on a reopened
    /// one, with a reset if its driver supports it. Mocks, recordings and datagram sources are not restarted.
    Silent {
        /// Duration of the silence.
        for_: Duration,
        /// Restarts since the last record, including this one.
        attempt: u32,
    },
    /// Bytes that are not a record, or an error reported by the device.
    DecodeError(DecodeError),
    /// Records of another sensor arrive and are ignored. Reported once per sensor and connection.
    OtherSensor {
        /// The ignored sensor.
        sensor: u16,
        /// The selected sensor.
        used: u16,
    },
    /// The recording ended, and with it the session.
    Ended,
}
