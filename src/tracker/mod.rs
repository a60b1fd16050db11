//! From a tracker's bytes to poses.
//!
//! Decoders are sans-IO: they take bytes from a buffer that somebody else fills (a serial port, a socket, a
//! recording) and give records. A recording holds the raw bytes and the name of their [`Protocol`], so that a replay
//! runs through the decoder that a live session would use.
//!
//! # Adding a protocol
//! 1. Write `src/tracker/NAME.rs` with a decoder whose `decode(&mut BytesMut) -> Result<Option<Record>, DecodeError>`
//!    keeps the promises of [`Decoder::decode`], and an error type that names the byte offset, what was wrong and what
//!    would be right.
//! 2. Add a variant to [`Protocol`] (with its name in [`Protocol::ALL`] and [`Protocol::name`]), to [`Decoder`] and to
//!    [`DecodeError`]; the compiler then shows each `match` to extend.
//! 3. Give it the property tests of `tests/recording.rs`: round trip or known frames, any split of the stream gives
//!    the same records, arbitrary bytes never panic and always make progress.

use std::str::FromStr;

use bytes::BytesMut;
use thiserror::Error;

use crate::pose::{Pose, Reading};

mod arrival;
pub mod ascii_line;
pub mod driver;
pub mod interchange;
pub mod recording;

/// One measurement of a tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Record {
    /// Station, port handle or tool of the device; 0 where its protocol knows only one.
    pub sensor: u16,
    /// Counter of the device, where it has one; it wraps at 2³².
    pub sequence: Option<u32>,
    /// Clock of the device, µs from its own origin, where it has one.
    pub device_time_us: Option<u64>,
    /// Buttons or switches held, a bit each from the lowest.
    pub buttons: u32,
    /// What was measured, in the tracker's frame; for recordings made over a scene, in that scene's frame.
    pub reading: Reading,
}

impl Record {
    /// A pose of the only sensor of a device that has a counter and a clock.
    pub fn pose(sequence: u32, device_time_us: u64, pose: Pose) -> Self {
        Self {
            sensor: 0,
            sequence: Some(sequence),
            device_time_us: Some(device_time_us),
            buttons: 0,
            reading: Reading::Pose(pose),
        }
    }
}

/// A wire format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Protocol {
    /// Lines of [`ascii_line`], checksum required.
    AsciiLine,
}

/// A name that no protocol has.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("unknown tracker protocol `{name}`; known: {known}")]
pub struct UnknownProtocol {
    /// Name looked up.
    pub name: String,
    /// Names of all protocols, ready to print.
    pub known: String,
}

impl Protocol {
    /// Every protocol.
    pub const ALL: [Self; 1] = [Self::AsciiLine];

    /// The name that recordings and station files use.
    pub fn name(self) -> &'static str {
        match self {
            Self::AsciiLine => "ascii-line",
        }
    }

    /// A decoder at the start of a stream.
    pub fn decoder(self) -> Decoder {
        match self {
            Self::AsciiLine => Decoder::AsciiLine(ascii_line::Decoder::new(ascii_line::Checksum::Required)),
        }
    }
}

impl FromStr for Protocol {
    type Err = UnknownProtocol;

    fn from_str(name: &str) -> Result<Self, UnknownProtocol> {
        Self::ALL
            .into_iter()
            .find(|p| p.name() == name)
            .ok_or_else(|| UnknownProtocol { name: name.to_owned(), known: Self::ALL.map(Self::name).join(", ") })
    }
}

/// Bytes that are no record, in any protocol.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum DecodeError {
    /// Of an ASCII line.
    #[error(transparent)]
    AsciiLine(#[from] ascii_line::DecodeError),
}

/// The decoder of one stream.
#[derive(Debug, Clone)]
pub enum Decoder {
    /// ASCII lines.
    AsciiLine(ascii_line::Decoder),
}

impl Decoder {
    /// Takes the next record from the front of `buffer`, where new bytes are appended.
    ///
    /// `Ok(None)` asks for more bytes. Each record and each error removes bytes, so that a loop until `Ok(None)` ends.
    ///
    /// # Errors
    /// Bytes that are no record. They are removed, and the next call goes on behind them.
    pub fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        match self {
            Self::AsciiLine(decoder) => Ok(decoder.decode(buffer)?),
        }
    }

    /// Ends the stream: what is left in `buffer` is part of a record at most.
    ///
    /// # Errors
    /// There was a part of a record. It is removed.
    pub fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        match self {
            Self::AsciiLine(decoder) => Ok(decoder.finish(buffer)?),
        }
    }
}
