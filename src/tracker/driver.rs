//! What a device needs beside the decoding of its stream: commands that start it, questions, patience, resets.
//!
//! A driver does no input or output and knows no clock: whoever owns the port calls it with the time since the session
//! began, and so every exchange can be tested without a device and without waiting.

use std::time::Duration;

use bytes::{Bytes, BytesMut};

use super::{DecodeError, Decoder, Protocol, Record, ndi, spacemouse};

/// Speaks with one device.
///
/// The owner of the port calls [`start`](Self::start) once it is open, then [`transmit`](Self::transmit) until it has
/// nothing to send, after every piece of input and at [`wake_at`](Self::wake_at). All received bytes are appended to
/// one buffer, and [`decode`](Self::decode) is called until it returns `Ok(None)`.
pub trait Driver: Send {
    /// Format of the records, which decides the decoder of a replay.
    fn protocol(&self) -> Protocol;

    /// Begins anew with a device of unknown state. `attempt` is 0 at first and rises by one with each time that the
    /// device stayed silent; from attempt to attempt a driver resets harder.
    fn start(&mut self, now: Duration, attempt: u32);

    /// The next bytes to send, or none for now.
    fn transmit(&mut self, now: Duration) -> Option<Bytes>;

    /// When to call [`transmit`](Self::transmit) although nothing was received; none where that isn't needed.
    fn wake_at(&self) -> Option<Duration>;

    /// How long the device may be silent before it is started anew; longer while it resets.
    fn patience(&self) -> Duration;

    /// Takes the next record from the front of `buffer`, as [`super::Decoder::decode`] does, and advances the exchange
    /// by whatever else lies in it.
    ///
    /// # Errors
    /// Bytes that are no record or no reply that was expected; an error that the device reports. They are removed, and
    /// the next call goes on behind them.
    fn decode(&mut self, now: Duration, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError>;

    /// Ends a message of a transport that has messages, or the stream: what is left in `buffer` is part of a record at
    /// most.
    ///
    /// # Errors
    /// There was a part of a record. It is removed.
    fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError>;

    /// What is to be done to a serial line before the next [`transmit`](Self::transmit); called until it is none, and of
    /// no effect on other transports.
    fn line(&mut self, _now: Duration) -> Option<Line> {
        None
    }

    /// The last bytes to send before the port is closed.
    fn stop(&mut self) -> Option<Bytes> {
        None
    }
}

/// Something done to a serial line itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// Holds it in break for a quarter of a second.
    Break,
    /// Another speed, baud.
    Speed(u32),
}

/// What drivers need to know of a station.
#[derive(Debug, Clone, PartialEq)]
pub struct DeviceOptions {
    /// Which of a device's sensors is used; none for the first that is heard, where the device needs a number its first.
    pub sensor: Option<u16>,
    /// Axis [x, y, z] of the source that points to the half space where the sensor is (Polhemus).
    pub hemisphere: [f64; 3],
    /// How long a device takes to start after a reset.
    pub reset_delay: Duration,
    /// How long a device that streams may be silent.
    pub silence: Duration,
    /// Of NDI devices.
    pub ndi: ndi::Options,
    /// What a puck reports at full push, in its own units, at least 1 (SpaceMouse).
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

/// Patience with a device that has just been opened: opening its port restarts an Arduino, which takes two seconds.
const START_PATIENCE: Duration = Duration::from_secs(5);

/// The driver of a device that speaks by itself: it only listens.
pub struct Passive {
    protocol: Protocol,
    /// At the start of a stream.
    fresh: Decoder,
    decoder: Decoder,
    silence: Duration,
    heard: bool,
}

impl Passive {
    /// A driver of a device that speaks `protocol`.
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
