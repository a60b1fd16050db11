//! Driver of devices that stream without commands.

use std::time::Duration;

use bytes::{Bytes, BytesMut};

use super::driver::Driver;
use super::{DecodeError, Decoder, DeviceOptions, Protocol, Record};

/// Longest accepted silence of a device just after opening: opening the port restarts an Arduino, which takes 2 s.
const START_SILENCE_LIMIT: Duration = Duration::from_secs(5);

/// Driver of a device that streams without commands. It sends nothing.
pub struct Passive {
    protocol: Protocol,
    options: DeviceOptions,
    decoder: Decoder,
    streaming: bool,
}

impl Passive {
    /// Driver of a device with the protocol `protocol`.
    pub fn new(protocol: Protocol, options: &DeviceOptions) -> Self {
        Self { protocol, options: options.clone(), decoder: protocol.decoder_of(options), streaming: false }
    }
}

impl Driver for Passive {
    fn start(&mut self, _: Duration, _: u32) {
        self.decoder = self.protocol.decoder_of(&self.options);
        self.streaming = false;
    }

    fn transmit(&mut self, _: Duration) -> Option<Bytes> {
        None
    }

    fn wake_at(&self) -> Option<Duration> {
        None
    }

    fn silence_limit(&self) -> Duration {
        if self.streaming { self.options.silence } else { self.options.silence.max(START_SILENCE_LIMIT) }
    }

    fn decode(&mut self, _: Duration, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        let record = self.decoder.decode(buffer)?;
        self.streaming |= record.is_some();
        Ok(record)
    }

    fn name_of(&self, sensor: u16) -> Option<&str> {
        self.decoder.name_of(sensor)
    }

    fn skipped(&self) -> Option<String> {
        self.decoder.skipped()
    }

    fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        self.decoder.finish(buffer)
    }
}
