//! Driver of Polhemus devices: stops, resets, configures and starts the stream.

use std::collections::VecDeque;
use std::time::Duration;

use bytes::{Bytes, BytesMut};

use super::driver::Driver;
use super::{DecodeError, Decoder, DeviceOptions, Protocol, Record, fastrak, liberty};

/// Pause after each command: the devices lose faster commands.
const COMMAND_PAUSE: Duration = Duration::from_millis(50);

/// Pause after the command that stops an earlier stream.
const STOP_PAUSE: Duration = Duration::from_millis(250);

/// Additional time for the first record after the start of the stream, beyond the usual silence limit.
const FIRST_RECORD: Duration = Duration::from_millis(500);

/// Driver of one Polhemus device.
///
/// Attempt 0 stops an earlier stream and configures the device. Attempt 1 sends a carriage return first, which ends an
/// incomplete command. From attempt 2 on the device is reset, and the driver waits for its start-up.
pub(crate) struct PolhemusDriver {
    protocol: Protocol,
    /// Command that stops the stream.
    stop: &'static [u8],
    /// Control-Y: restarts the device as at power-on.
    reset: &'static [u8],
    /// Commands that configure the device and start the stream.
    setup: Vec<Bytes>,
    reset_delay: Duration,
    silence: Duration,
    decoder: Decoder,
    /// Commands not sent yet, with their times in ascending order.
    script: VecDeque<(Duration, Bytes)>,
    /// Time from the last start until the stream should run.
    preparation: Duration,
    streaming: bool,
}

impl PolhemusDriver {
    /// Driver of a device with one of the four Polhemus protocols; sends nothing before it is started.
    pub(super) fn new(protocol: Protocol, options: &DeviceOptions) -> Self {
        let fastrak = |format| fastrak::setup(format, &options.stations(1), options.hemisphere);
        let (stop, reset, setup): (&[u8], &[u8], _) = match protocol {
            Protocol::FastrakAscii => (b"c", b"\x19", fastrak(fastrak::Format::Ascii)),
            Protocol::FastrakBinary => (b"c", b"\x19", fastrak(fastrak::Format::Binary)),
            _ => (b"P", b"\x19\r", liberty::setup(options.hemisphere)),
        };
        Self {
            protocol,
            stop,
            reset,
            setup,
            reset_delay: options.reset_delay,
            silence: options.silence,
            decoder: protocol.decoder(),
            script: VecDeque::new(),
            preparation: Duration::ZERO,
            streaming: false,
        }
    }
}

impl Driver for PolhemusDriver {
    fn start(&mut self, now: Duration, attempt: u32) {
        self.script.clear();
        self.streaming = false;
        // The next bytes may belong to an earlier, incomplete record.
        self.decoder = self.protocol.decoder();
        let mut at = now;
        let mut schedule = |bytes: Bytes, pause: Duration| {
            self.script.push_back((at, bytes));
            at += pause;
        };
        if attempt > 0 {
            schedule(Bytes::from_static(b"\r"), COMMAND_PAUSE);
        }
        schedule(Bytes::from_static(self.stop), STOP_PAUSE);
        if attempt > 1 {
            schedule(Bytes::from_static(self.reset), self.reset_delay);
        }
        for command in &self.setup {
            schedule(command.clone(), COMMAND_PAUSE);
        }
        self.preparation = at.saturating_sub(now) + FIRST_RECORD;
    }

    fn transmit(&mut self, now: Duration) -> Option<Bytes> {
        if self.script.front().is_some_and(|(at, _)| *at <= now) {
            return self.script.pop_front().map(|(_, bytes)| bytes);
        }
        None
    }

    fn stop(&mut self) -> Option<Bytes> {
        Some(Bytes::from_static(self.stop))
    }

    fn wake_at(&self) -> Option<Duration> {
        self.script.front().map(|(at, _)| *at)
    }

    fn silence_limit(&self) -> Duration {
        if self.streaming { self.silence } else { self.silence + self.preparation }
    }

    fn decode(&mut self, _: Duration, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        let record = self.decoder.decode(buffer)?;
        // Records received before the last command may belong to a previous stream.
        self.streaming |= record.is_some() && self.script.is_empty();
        Ok(record)
    }

    fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        self.decoder.finish(buffer)
    }
}
