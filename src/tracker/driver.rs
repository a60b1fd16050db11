//! Conversation with a tracker: start-up commands, polling, silence limits and resets.
//!
//! A driver does no input or output and reads no clock. The owner of the port calls it with the time since the session
//! began, so every exchange can be tested without a device and without waiting.

use std::time::Duration;

use bytes::{Bytes, BytesMut};

use super::{DecodeError, Decoder, Protocol, Record, ndi, spacemouse};

/// Conversation with one device.
///
/// The owner of the port calls [`start`](Self::start) once the port is open. It calls [`transmit`](Self::transmit)
/// until there is nothing to send, after every piece of input and at [`wake_at`](Self::wake_at). All received bytes are
/// appended to one buffer, and [`decode`](Self::decode) is called until it returns `Ok(None)`.
pub trait Driver: Send {
    /// Format of the records; selects the decoder of a replay.
    fn protocol(&self) -> Protocol;

    /// Starts over with a device of unknown state. `attempt` is 0 at first and rises by one each time the device stayed
    /// silent; later attempts reset the device more thoroughly.
    fn start(&mut self, now: Duration, attempt: u32);

    /// Next bytes to send, if any.
    fn transmit(&mut self, now: Duration) -> Option<Bytes>;

    /// Time at which to call [`transmit`](Self::transmit) even if nothing is received; `None` if not needed.
    fn wake_at(&self) -> Option<Duration>;

    /// Longest accepted silence before the device is restarted; longer while it resets.
    fn patience(&self) -> Duration;

    /// Takes the next record from the front of `buffer`, like [`super::Decoder::decode`]. Other replies advance the
    /// exchange.
    ///
    /// # Errors
    /// Bytes that are neither a record nor an expected reply, or an error that the device reports. They are removed,
    /// and the next call continues behind them.
    fn decode(&mut self, now: Duration, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError>;

    /// Ends a message (on transports that have messages) or the stream.
    ///
    /// # Errors
    /// Part of a record is left over. It is removed.
    fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError>;

    /// Serial line operation to carry out before the next [`transmit`](Self::transmit). Called until it returns `None`;
    /// other transports ignore it.
    fn line(&mut self, _now: Duration) -> Option<Line> {
        None
    }

    /// Last bytes to send before the port is closed.
    fn stop(&mut self) -> Option<Bytes> {
        None
    }
}

/// Operation on a serial line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// Holds the line in break for a quarter of a second.
    Break,
    /// Changes the speed, baud.
    Speed(u32),
}

/// Device options of a station file.
#[derive(Debug, Clone, PartialEq)]
pub struct DeviceOptions {
    /// Sensor to use. `None` takes the first one received, or the device's first if the protocol needs a number.
    pub sensor: Option<u16>,
    /// Axis [x, y, z] of the source that points to the half space of the sensor (Polhemus).
    pub hemisphere: [f64; 3],
    /// Start-up time of a device after a reset.
    pub reset_delay: Duration,
    /// Longest accepted silence of a streaming device.
    pub silence: Duration,
    /// Options of NDI devices.
    pub ndi: ndi::Options,
    /// Report value of a puck at full deflection, at least 1 (SpaceMouse).
    pub puck_range: f64,
}

impl Default for DeviceOptions {
    fn default() -> Self {
        Self {
            sensor: None,
            hemisphere: [0.0, 0.0, 1.0],
            reset_delay: Duration::from_secs(20),
            silence: Duration::from_secs(2),
            ndi: ndi::Options::default(),
            puck_range: spacemouse::RANGE,
        }
    }
}

/// Longest accepted silence of a device that has just been opened: opening its port restarts an Arduino, which takes
/// two seconds.
const START_PATIENCE: Duration = Duration::from_secs(5);

/// Driver of a device that streams by itself; only listens.
pub struct Passive {
    protocol: Protocol,
    /// Decoder at the start of a stream.
    fresh: Decoder,
    decoder: Decoder,
    silence: Duration,
    heard: bool,
}

impl Passive {
    /// Driver of a device that speaks `protocol`.
    pub fn new(protocol: Protocol, options: &DeviceOptions) -> Self {
        let fresh = protocol.decoder_of(options);
        Self { protocol, decoder: fresh.clone(), fresh, silence: options.silence, heard: false }
    }
}

impl Driver for Passive {
    fn protocol(&self) -> Protocol {
        self.protocol
    }

    fn start(&mut self, _: Duration, _: u32) {
        self.decoder = self.fresh.clone();
        self.heard = false;
    }

    fn transmit(&mut self, _: Duration) -> Option<Bytes> {
        None
    }

    fn wake_at(&self) -> Option<Duration> {
        None
    }

    fn patience(&self) -> Duration {
        if self.heard { self.silence } else { self.silence.max(START_PATIENCE) }
    }

    fn decode(&mut self, _: Duration, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        let record = self.decoder.decode(buffer)?;
        self.heard |= record.is_some();
        Ok(record)
    }

    fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        self.decoder.finish(buffer)
    }
}
