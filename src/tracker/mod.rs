//! Trackers: from received bytes to pose records.
//!
//! Decoders are sans-IO: they take bytes from a buffer filled by a serial port, a socket or a recording, and return
//! records. A recording holds the raw bytes and the name of their [`Protocol`], so a replay runs the decoder of a live
//! session. A [driver](driver::Driver) holds the conversation with the device, also sans-IO. A session ([`spawn`])
//! joins a transport, a driver and a [`Listener`] on a thread of its own, and survives all hardware faults.
//!
//! # Adding a protocol
//! 1. Write `src/tracker/NAME.rs` with a decoder whose `decode(&mut BytesMut) -> Result<Option<Record>, DecodeError>`
//!    keeps the promises of [`Decoder::decode`]. Its error type names the byte offset, the fault and the correct form.
//! 2. Add a variant to [`Protocol`] and to its table of names, to [`Decoder`] and to [`DecodeError`]; the compiler then
//!    shows each `match` to extend.
//! 3. Let [`Protocol::driver`] make its driver: [`Passive`] if the device streams by itself.
//! 4. Give it the property tests of `tests/recording.rs`: round trip or known frames; any split of the stream gives the
//!    same records; arbitrary bytes never panic and always make progress.

use std::str::FromStr;

use bytes::BytesMut;
use thiserror::Error;

use crate::pose::{Pose, Reading};
use driver::Driver;
use ndi::NdiDriver;
use polhemus::{Model, PolhemusDriver};

mod arrival;
pub mod ascii_line;
mod axis_map;
pub mod bno08x;
mod clock;
mod device_options;
pub mod devices;
pub mod driver;
mod error;
pub mod fastrak;
mod framing;
pub mod interchange;
pub mod liberty;
mod listener;
pub mod mock;
mod monitor;
pub mod ndi;
pub mod openigtlink;
pub mod opentrack;
mod passive;
pub mod polhemus;
mod pose_tap;
pub mod recording;
mod session;
mod settings;
pub mod spacemouse;
mod transport;

pub use axis_map::{AxisMap, AxisMapError};
pub use clock::host_time_ns;
pub use device_options::DeviceOptions;
pub use error::TrackerError;
pub use listener::{Listener, TrackerEvent};
pub use monitor::{Monitor, Report, SessionState};
pub use passive::Passive;
pub use pose_tap::{PoseStream, PoseTap, Poses, pose_tap};
pub use session::{SessionHandle, SessionSummary, spawn, stream_protocol, stream_sensor};
pub use settings::{BAUD_RANGE, PortName, PortNameError, Settings, Speed, Transport};

/// One measurement of a tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Record {
    /// Station, port handle or tool of the device; 0 if the protocol has only one.
    pub sensor: u16,
    /// Counter of the device, if it has one; wraps at 2³².
    pub sequence: Option<u32>,
    /// Clock of the device, µs from its own origin, if it has one.
    pub device_time_us: Option<u64>,
    /// Pressed buttons or switches, one bit each from the lowest.
    pub buttons: u32,
    /// Measured value, in the tracker's frame. Recordings made over a scene use the scene's frame.
    pub reading: Reading,
}

impl Record {
    /// A pose from a device with one sensor, a counter and a clock.
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

/// Wire format.
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

/// An unknown protocol name.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("unknown tracker protocol `{name}`; known: {known}")]
pub struct UnknownProtocol {
    /// Name looked up.
    pub name: String,
    /// Names of all protocols, separated by commas.
    pub known: String,
}

crate::names::named!(Protocol {
    AsciiLine = "ascii-line",
    FastrakAscii = "fastrak-ascii",
    FastrakBinary = "fastrak-binary",
    Liberty = "liberty",
    Patriot = "patriot",
    Ndi = "ndi",
    SpaceMouse = "spacemouse",
    Bno08x = "bno08x",
    Bno08xRollFirst = "bno08x-roll-first",
    OpenTrack = "opentrack",
    OpenIgtLink = "openigtlink",
});

impl Protocol {
    /// Decoder at the start of a stream.
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

    /// Decoder at the start of the stream of a device with `options`.
    pub fn decoder_of(self, options: &DeviceOptions) -> Decoder {
        match self {
            Self::SpaceMouse => Decoder::SpaceMouse(spacemouse::Decoder::new(options.puck_range)),
            _ => self.decoder(),
        }
    }

    /// Sensor that the driver requests by default; `None` if the protocol needs no number.
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

    /// Factory speed of the serial port, baud.
    pub fn usual_baud(self) -> u32 {
        match self {
            // The driver itself switches to a higher speed.
            Self::Ndi => 9600,
            _ => 115_200,
        }
    }

    /// Driver of a device with this protocol.
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
        Self::named(name).ok_or_else(|| UnknownProtocol { name: name.to_owned(), known: Self::NAMES.join(", ") })
    }
}

/// Bytes that are not a record, in any protocol.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum DecodeError {
    /// Fault of an ASCII line.
    #[error(transparent)]
    AsciiLine(#[from] ascii_line::DecodeError),
    /// Fault of a FASTRAK's stream.
    #[error(transparent)]
    Fastrak(#[from] fastrak::DecodeError),
    /// Fault of a LIBERTY's or PATRIOT's stream.
    #[error(transparent)]
    Liberty(#[from] liberty::DecodeError),
    /// Fault of an NDI device's stream.
    #[error(transparent)]
    Ndi(#[from] ndi::DecodeError),
    /// Fault of a SpaceMouse report.
    #[error(transparent)]
    SpaceMouse(#[from] spacemouse::DecodeError),
    /// Fault of a BNO08x's stream.
    #[error(transparent)]
    Bno08x(#[from] bno08x::DecodeError),
    /// Fault of an opentrack datagram.
    #[error(transparent)]
    OpenTrack(#[from] opentrack::DecodeError),
    /// Fault of an OpenIGTLink stream.
    #[error(transparent)]
    OpenIgtLink(#[from] openigtlink::DecodeError),
}

impl DecodeError {
    /// Whether a well-formed frame reports an error of the device: the device is connected and responding.
    pub fn is_report(&self) -> bool {
        match self {
            Self::Fastrak(error) => matches!(error.reason, fastrak::Reason::Device { .. }),
            Self::Liberty(error) => matches!(error.reason, liberty::Reason::Device { .. }),
            Self::Ndi(error) => error.is_report(),
            _ => false,
        }
    }
}

/// Decoder of one stream.
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
    /// Takes the next record from the front of `buffer`, to which new bytes are appended.
    ///
    /// `Ok(None)` asks for more bytes. Each record and each error removes bytes, so a loop until `Ok(None)` ends.
    ///
    /// # Errors
    /// Bytes that are not a record. They are removed, and the next call continues behind them.
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

    /// Ends the stream.
    ///
    /// # Errors
    /// Part of a record is left over. It is removed.
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
