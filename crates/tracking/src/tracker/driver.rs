//! Communication with a tracker: start-up commands, polling, silence limits and resets.
//!
//! A driver does no input or output and reads no clock: the owner of the port passes the time since the session began.
//! So every exchange can be tested without a device and without waiting.

use std::time::Duration;

use bytes::{Bytes, BytesMut};

use super::{DecodeError, Record};

/// Communication with one device.
///
/// The owner of the port calls [`start`](Self::start) when the port is open. After every piece of input and at
/// [`wake_at`](Self::wake_at), it calls [`transmit`](Self::transmit) until there is nothing to send. All received
/// bytes are appended to one buffer, and [`decode`](Self::decode) is called until it returns `Ok(None)`.
pub trait Driver: Send {
    /// Restarts the communication with a device of unknown state. `attempt` is 0 at first and is incremented each time
    /// the device stays silent; later attempts reset the device more thoroughly.
    fn start(&mut self, now: Duration, attempt: u32);

    /// Next bytes to send, if any.
    fn transmit(&mut self, now: Duration) -> Option<Bytes>;

    /// Time at which to call [`transmit`](Self::transmit) even without input; `None` if not needed.
    fn wake_at(&self) -> Option<Duration>;

    /// Longest accepted silence before the device is restarted; it is longer while the device resets.
    fn silence_limit(&self) -> Duration;

    /// Takes the next record from the front of `buffer`, like [`StreamDecoder::decode`](super::StreamDecoder::decode).
    /// Other replies advance the exchange.
    ///
    /// # Errors
    /// Bytes that are neither a record nor an expected reply, or an error that the device reports. They are removed,
    /// and the next call continues after them.
    fn decode(&mut self, now: Duration, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError>;

    /// Name of the sensor with this number, like [`StreamDecoder::name_of`](super::StreamDecoder::name_of).
    fn name_of(&self, _sensor: u16) -> Option<&str> {
        None
    }

    /// Types of skipped messages, like [`StreamDecoder::skipped`](super::StreamDecoder::skipped).
    fn skipped(&self) -> Option<String> {
        None
    }

    /// Ends a message (on transports that have messages) or the stream.
    ///
    /// # Errors
    /// Part of a record is left over. It is removed.
    fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError>;

    /// Operation on the serial line to carry out before the next [`transmit`](Self::transmit). It is called until it
    /// returns `None`; other transports ignore it.
    fn line(&mut self, _now: Duration) -> Option<Line> {
        None
    }

    /// Last bytes to send before the port is closed; `None` if there are none.
    fn stop(&mut self) -> Option<Bytes> {
        None
    }
}

/// Operation on a serial line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// Holds the line in break for 250 ms.
    Break,
    /// Changes the speed, baud.
    Speed(u32),
}
