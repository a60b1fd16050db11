//! From a tracker's bytes to poses.
//!
//! Decoders are sans-IO: they take bytes from a buffer that somebody else fills (a serial port, a socket, a
//! recording) and give records. A recording holds the raw bytes and the name of their [`Protocol`], so that a replay
//! runs through the decoder that a live session would use. A [driver](driver::Driver) speaks with the device, without
//! input or output, too. A session ([`spawn`]) joins a transport, a driver and a [`Listener`] on a thread of its own, and
//! goes on whatever the hardware does.
//!
//! # Adding a protocol
//! 1. Write `src/tracker/NAME.rs` with a decoder whose `decode(&mut BytesMut) -> Result<Option<Record>, DecodeError>`
//!    keeps the promises of [`Decoder::decode`], and an error type that names the byte offset, what was wrong and what
//!    would be right.
//! 2. Add a variant to [`Protocol`] (with its name in [`Protocol::ALL`] and [`Protocol::name`]), to [`Decoder`] and to
//!    [`DecodeError`]; the compiler then shows each `match` to extend.
//! 3. Let [`Protocol::driver`] make its driver: [`driver::Passive`] where the device speaks by itself.
//! 4. Give it the property tests of `tests/recording.rs`: round trip or known frames, any split of the stream gives
//!    the same records, arbitrary bytes never panic and always make progress.

use std::str::FromStr;

use bytes::BytesMut;
use thiserror::Error;

use crate::pose::{Pose, Reading};
use driver::{DeviceOptions, Driver, Passive};
use ndi::NdiDriver;
use polhemus::{Model, PolhemusDriver};

mod arrival;
pub mod ascii_line;
mod axis_map;
pub mod bno08x;
mod clock;
pub mod devices;
pub mod driver;
pub mod fastrak;
mod framing;
pub mod interchange;
pub mod liberty;
pub mod mock;
mod monitor;
pub mod ndi;
pub mod openigtlink;
pub mod opentrack;
pub mod polhemus;
mod pose_tap;
pub mod recording;
mod session;
mod settings;
pub mod spacemouse;
mod transport;

pub use axis_map::{AxisMap, AxisMapError};
pub use clock::host_time_ns;
pub use monitor::{Monitor, Report, SessionState};
pub use pose_tap::{PoseStream, PoseTap, Poses, pose_tap};
pub use session::{
    Listener, SessionHandle, SessionSummary, TrackerError, TrackerEvent, spawn, stream_protocol, stream_sensor,
};
pub use settings::{PortName, PortNameError, Settings, Speed, Transport};

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
    /// Text records of [`fastrak`].
    FastrakAscii,
    /// Binary records of [`fastrak`].
    FastrakBinary,
    /// Frames of [`liberty`], from a LIBERTY.
    Liberty,
    /// Frames of [`liberty`], from a PATRIOT.
    Patriot,
    /// Replies of [`ndi`], `TX` or `BX`.
    Ndi,
    /// Reports of [`spacemouse`].
    SpaceMouse,
    /// Frames of [`bno08x`].
    Bno08x,
    /// Frames of [`bno08x`] by firmware that sends roll before pitch.
    Bno08xRollFirst,
    /// Datagrams of [`opentrack`].
    OpenTrack,
    /// Messages of [`openigtlink`].
    OpenIgtLink,
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
    pub const ALL: [Self; 11] = [
        Self::AsciiLine,
        Self::FastrakAscii,
        Self::FastrakBinary,
        Self::Liberty,
        Self::Patriot,
        Self::Ndi,
        Self::SpaceMouse,
        Self::Bno08x,
        Self::Bno08xRollFirst,
        Self::OpenTrack,
        Self::OpenIgtLink,
    ];

    /// The name that recordings and station files use.
    pub fn name(self) -> &'static str {
        match self {
            Self::AsciiLine => "ascii-line",
            Self::FastrakAscii => "fastrak-ascii",
            Self::FastrakBinary => "fastrak-binary",
            Self::Liberty => "liberty",
            Self::Patriot => "patriot",
            Self::Ndi => "ndi",
            Self::SpaceMouse => "spacemouse",
            Self::Bno08x => "bno08x",
            Self::Bno08xRollFirst => "bno08x-roll-first",
            Self::OpenTrack => "opentrack",
            Self::OpenIgtLink => "openigtlink",
        }
    }

    /// A decoder at the start of a stream.
    pub fn decoder(self) -> Decoder {
        match self {
            Self::AsciiLine => Decoder::AsciiLine(ascii_line::Decoder::new(ascii_line::Checksum::Required)),
            Self::FastrakAscii => Decoder::Fastrak(fastrak::Decoder::new(fastrak::Format::Ascii)),
            Self::FastrakBinary => Decoder::Fastrak(fastrak::Decoder::new(fastrak::Format::Binary)),
            Self::Liberty => Decoder::Liberty(liberty::Decoder::new(liberty::Device::Liberty)),
            Self::Patriot => Decoder::Liberty(liberty::Decoder::new(liberty::Device::Patriot)),
            Self::Ndi => Decoder::Ndi(ndi::Decoder::new()),
            Self::SpaceMouse => Decoder::SpaceMouse(spacemouse::Decoder::new(spacemouse::RANGE)),
            Self::Bno08x => Decoder::Bno08x(bno08x::Decoder::new(bno08x::AngleOrder::PitchFirst)),
            Self::Bno08xRollFirst => Decoder::Bno08x(bno08x::Decoder::new(bno08x::AngleOrder::RollFirst)),
            Self::OpenTrack => Decoder::OpenTrack(opentrack::Decoder::new()),
            Self::OpenIgtLink => Decoder::OpenIgtLink(openigtlink::Decoder::new()),
        }
    }

    /// A decoder at the start of the stream of a device with `options`.
    pub fn decoder_of(self, options: &driver::DeviceOptions) -> Decoder {
        match self {
            Self::SpaceMouse => Decoder::SpaceMouse(spacemouse::Decoder::new(options.puck_range)),
            _ => self.decoder(),
        }
    }

    /// The sensor that a device's driver asks for where the station names none; none where it needs no number.
    pub fn first_sensor(self) -> Option<u16> {
        match self {
            Self::AsciiLine
            | Self::Ndi
            | Self::SpaceMouse
            | Self::Bno08x
            | Self::Bno08xRollFirst
            | Self::OpenTrack
            | Self::OpenIgtLink => None,
            Self::FastrakAscii | Self::FastrakBinary | Self::Liberty | Self::Patriot => Some(1),
        }
    }

    /// Speed of the serial port that devices come with, baud.
    pub fn usual_baud(self) -> u32 {
        match self {
            // The driver switches to a higher speed itself.
            Self::Ndi => 9600,
            _ => 115_200,
        }
    }

    /// A driver of a device that speaks this.
    pub fn driver(self, options: &DeviceOptions) -> Box<dyn Driver> {
        let polhemus = |model| Box::new(PolhemusDriver::new(model, options));
        match self {
            Self::Ndi => Box::new(NdiDriver::new(options.ndi.clone())),
            Self::AsciiLine
            | Self::SpaceMouse
            | Self::Bno08x
            | Self::Bno08xRollFirst
            | Self::OpenTrack
            | Self::OpenIgtLink => Box::new(Passive::new(self, options)),
            Self::FastrakAscii => polhemus(Model::Fastrak(fastrak::Format::Ascii)),
            Self::FastrakBinary => polhemus(Model::Fastrak(fastrak::Format::Binary)),
            Self::Liberty => polhemus(Model::Liberty(liberty::Device::Liberty)),
            Self::Patriot => polhemus(Model::Liberty(liberty::Device::Patriot)),
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
    /// Of a FASTRAK.
    #[error(transparent)]
    Fastrak(#[from] fastrak::DecodeError),
    /// Of a LIBERTY or PATRIOT.
    #[error(transparent)]
    Liberty(#[from] liberty::DecodeError),
    /// Of an NDI device.
    #[error(transparent)]
    Ndi(#[from] ndi::DecodeError),
    /// Of a SpaceMouse.
    #[error(transparent)]
    SpaceMouse(#[from] spacemouse::DecodeError),
    /// Of a BNO08x.
    #[error(transparent)]
    Bno08x(#[from] bno08x::DecodeError),
    /// Of opentrack.
    #[error(transparent)]
    OpenTrack(#[from] opentrack::DecodeError),
    /// Of an OpenIGTLink stream.
    #[error(transparent)]
    OpenIgtLink(#[from] openigtlink::DecodeError),
}

impl DecodeError {
    /// Whether the device itself reports something, in a frame that is whole: it is there and speaks.
    pub fn is_report(&self) -> bool {
        match self {
            Self::Fastrak(error) => matches!(error.reason, fastrak::Reason::Device { .. }),
            Self::Liberty(error) => matches!(error.reason, liberty::Reason::Device { .. }),
            Self::Ndi(error) => error.is_report(),
            _ => false,
        }
    }
}

/// The decoder of one stream.
#[derive(Debug, Clone)]
pub enum Decoder {
    /// ASCII lines.
    AsciiLine(ascii_line::Decoder),
    /// Records of a FASTRAK.
    Fastrak(fastrak::Decoder),
    /// Frames of a LIBERTY or PATRIOT.
    Liberty(liberty::Decoder),
    /// Replies of an NDI device.
    Ndi(ndi::Decoder),
    /// Reports of a SpaceMouse.
    SpaceMouse(spacemouse::Decoder),
    /// Frames of a BNO08x.
    Bno08x(bno08x::Decoder),
    /// Datagrams of opentrack.
    OpenTrack(opentrack::Decoder),
    /// Messages of OpenIGTLink.
    OpenIgtLink(openigtlink::Decoder),
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
            Self::Fastrak(decoder) => Ok(decoder.decode(buffer)?),
            Self::Liberty(decoder) => Ok(decoder.decode(buffer)?),
            Self::Ndi(decoder) => Ok(decoder.decode(buffer)?),
            Self::SpaceMouse(decoder) => Ok(decoder.decode(buffer)?),
            Self::Bno08x(decoder) => Ok(decoder.decode(buffer)?),
            Self::OpenTrack(decoder) => Ok(decoder.decode(buffer)?),
            Self::OpenIgtLink(decoder) => Ok(decoder.decode(buffer)?),
        }
    }

    /// Ends the stream: what is left in `buffer` is part of a record at most.
    ///
    /// # Errors
    /// There was a part of a record. It is removed.
    pub fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        match self {
            Self::AsciiLine(decoder) => Ok(decoder.finish(buffer)?),
            Self::Fastrak(decoder) => Ok(decoder.finish(buffer)?),
            Self::Liberty(decoder) => Ok(decoder.finish(buffer)?),
            Self::Ndi(decoder) => Ok(decoder.finish(buffer)?),
            Self::SpaceMouse(decoder) => Ok(decoder.finish(buffer)?),
            Self::Bno08x(decoder) => Ok(decoder.finish(buffer)?),
            Self::OpenTrack(decoder) => Ok(decoder.finish(buffer)?),
            Self::OpenIgtLink(decoder) => Ok(decoder.finish(buffer)?),
        }
    }
}
