//! Trackers: from received bytes to pose records.
//!
//! Decoders are sans-IO: they take bytes from a buffer filled by a serial port, a socket or a recording, and return
//! records. A [recording](crate::recording) holds the raw bytes and the name of their [`Protocol`], so a replay runs
//! the decoder of a live session. A [driver](driver::Driver) exchanges messages with the device, also sans-IO. A
//! session ([`spawn`]) runs transport, driver and [`Listener`] on its own thread, and survives all hardware faults.
//!
//! # Adding a protocol
//! 1. Write `crates/tracking/src/tracker/NAME.rs` with a [`StreamDecoder`]. Its `Reason` tells fault and correct form.
//! 2. Add a variant to [`Protocol`], its table of names and [`Fault`]; the compiler then lists each `match` to extend.
//! 3. Return its driver from [`Protocol::driver`]: [`Passive`] if the device streams without commands.
//! 4. Give it the property tests of `tests/tracking/protocols/streams.rs`: round trip or known frames; equal records
//!    for any split of the stream; arbitrary bytes never panic and always make progress.

use std::ops::RangeInclusive;
use std::str::FromStr;

use thiserror::Error;

use driver::Driver;
use insonify_core::pose::{Measurement, Pose, Reading};
use ndi::NdiDriver;
use polhemus::PolhemusDriver;

#[cfg(feature = "recordings")]
pub(crate) mod arrival;
pub mod ascii_line;
mod axis_map;
pub mod bno08x;
mod choice;
mod clock;
mod damage;
mod decoder;
mod device_options;
pub mod devices;
pub mod driver;
mod error;
mod event;
pub mod fastrak;
mod framing;
mod irregularity;
pub mod liberty;
mod listener;
pub mod mock;
mod monitor;
pub mod ndi;
pub mod openigtlink;
pub mod opentrack;
mod passive;
mod playback;
pub mod polhemus;
mod pose_tap;
mod report_line;
#[cfg(feature = "recordings")]
pub(crate) mod selection;
mod sensor;
#[cfg(feature = "live")]
mod session;
mod settings;
pub mod spacemouse;
#[cfg(feature = "live")]
mod transport;

pub use axis_map::{AxisMap, AxisMapError};
pub use choice::{Choice, ChoiceError};
pub use clock::host_time_ns;
pub use damage::Damage;
pub use decoder::{Offset, StreamDecoder};
pub use device_options::DeviceOptions;
pub use error::TrackerError;
pub use event::TrackerEvent;
pub use irregularity::Irregularity;
pub use listener::Listener;
pub use monitor::{Monitor, SensorReport, SessionState, TrackerReport};
pub use passive::Passive;
pub use playback::{Playback, PlaybackError};
pub use pose_tap::{PoseStream, PoseTap, Poses, pose_tap};
pub use report_line::ReportLine;
pub use sensor::{NeedleSensor, ProbeSensor, SensorName};
#[cfg(feature = "live")]
pub use session::{SessionHandle, SessionSummary, play, spawn};
pub use settings::{BAUD_RANGE, PortName, PortNameError, Settings, Speed, TrackerStream, Transport, TransportKind};

/// One measurement of a tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Record {
    /// Number of the sensor: a Polhemus station, an NDI port handle or a tool; 0 if the protocol has only one sensor.
    /// Named tools are numbered in the order of their first records.
    pub sensor: u16,
    /// Counter of the device, if it has one; wraps at 2³².
    pub sequence: Option<u32>,
    /// Clock of the device, µs from its own origin, if it has one.
    pub device_time_us: Option<u64>,
    /// Pressed buttons or switches, one bit each from the lowest.
    pub buttons: u32,
    /// Measured value, in the tracker's frame. Recordings generated for a scene use the frame of the scene.
    pub reading: Reading,
}

impl Record {
    /// A reading of `sensor`, from a device without counter, clock and buttons.
    pub fn new(sensor: u16, reading: Reading) -> Self {
        Self { sensor, sequence: None, device_time_us: None, buttons: 0, reading }
    }

    /// A pose from a device with one sensor, a counter and a clock.
    pub fn pose(sequence: u32, device_time_us: u64, pose: Pose) -> Self {
        Self { sequence: Some(sequence), device_time_us: Some(device_time_us), ..Self::new(0, Reading::Pose(pose)) }
    }

    /// The measurement of this record, whose first byte arrived at `host_time_ns`.
    pub fn measurement(&self, host_time_ns: u64) -> Measurement {
        let Self { sequence, device_time_us, reading, .. } = *self;
        Measurement { host_time_ns, device_time_us, sequence, reading }
    }
}

/// Number of records missing between the counters `last` and `next`, and whether the counter failed to rise.
pub(crate) fn counter_step(last: Option<u32>, next: Option<u32>) -> (u64, bool) {
    let (Some(last), Some(next)) = (last, next) else { return (0, false) };
    // The counter wraps: a step of more than half of its range counts as a backward step.
    match next.wrapping_sub(last) {
        step @ 1..=0x7fff_ffff => (u64::from(step - 1), false),
        _ => (0, true),
    }
}

/// Wire format.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Protocol {
    /// Lines of [`ascii_line`].
    #[default]
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
#[error("unknown tracker protocol `{name}`; known: {}", Protocol::NAMES.join(", "))]
pub struct UnknownProtocol {
    /// Name looked up.
    pub name: String,
}

insonify_core::names::named!(Protocol {
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
    /// Decoder at the start of the stream of a device with default options.
    pub fn decoder(self) -> Decoder {
        self.decoder_of(&DeviceOptions::default())
    }

    /// Decoder at the start of the stream of a device with `options`.
    pub(crate) fn decoder_of(self, options: &DeviceOptions) -> Decoder {
        match self {
            Self::AsciiLine => Box::new(ascii_line::Decoder::default()),
            Self::FastrakAscii => Box::new(fastrak::Decoder::new(fastrak::Format::Ascii)),
            Self::FastrakBinary => Box::new(fastrak::Decoder::new(fastrak::Format::Binary)),
            Self::Liberty => Box::new(liberty::Decoder::new(liberty::Device::Liberty)),
            Self::Patriot => Box::new(liberty::Decoder::new(liberty::Device::Patriot)),
            Self::Ndi => Box::new(ndi::Decoder::default()),
            Self::SpaceMouse => Box::new(spacemouse::Decoder::new(options.puck_range)),
            Self::Bno08x => Box::new(bno08x::Decoder::new(bno08x::AngleOrder::PitchFirst)),
            Self::Bno08xRollFirst => Box::new(bno08x::Decoder::new(bno08x::AngleOrder::RollFirst)),
            Self::OpenTrack => Box::new(opentrack::Decoder::default()),
            Self::OpenIgtLink => Box::new(openigtlink::Decoder::default()),
        }
    }

    /// Number of the sensor that the driver requests by default; `None` if the protocol needs no number.
    pub(crate) fn first_sensor(self) -> Option<u16> {
        match self {
            Self::FastrakAscii | Self::FastrakBinary | Self::Liberty | Self::Patriot => Some(1),
            Self::AsciiLine
            | Self::Ndi
            | Self::SpaceMouse
            | Self::Bno08x
            | Self::Bno08xRollFirst
            | Self::OpenTrack
            | Self::OpenIgtLink => None,
        }
    }

    /// Numbers that the sensors of this protocol can have. Protocols with a single sensor have only one; tools with
    /// names are numbered by arrival.
    pub fn sensor_numbers(self) -> RangeInclusive<u16> {
        match self {
            Self::FastrakAscii | Self::FastrakBinary => 1..=4,
            Self::Liberty => 1..=16,
            Self::Patriot => 1..=2,
            Self::Ndi => 0..=255,
            Self::AsciiLine | Self::OpenIgtLink => 0..=u16::MAX,
            Self::SpaceMouse | Self::Bno08x | Self::Bno08xRollFirst | Self::OpenTrack => 0..=0,
        }
    }

    /// Whether the protocol's sensors have names.
    pub fn has_names(self) -> bool {
        match self {
            Self::OpenIgtLink => true,
            Self::AsciiLine
            | Self::FastrakAscii
            | Self::FastrakBinary
            | Self::Liberty
            | Self::Patriot
            | Self::Ndi
            | Self::SpaceMouse
            | Self::Bno08x
            | Self::Bno08xRollFirst
            | Self::OpenTrack => false,
        }
    }

    /// Factory speed of the serial port, baud.
    pub fn usual_baud(self) -> u32 {
        match self {
            // The driver switches to a higher speed later.
            Self::Ndi => 9600,
            _ => 115_200,
        }
    }

    /// Driver of a device with this protocol.
    pub fn driver(self, options: &DeviceOptions) -> Box<dyn Driver> {
        match self {
            Self::Ndi => Box::new(NdiDriver::new(options.ndi.clone())),
            Self::FastrakAscii | Self::FastrakBinary | Self::Liberty | Self::Patriot => {
                Box::new(PolhemusDriver::new(self, options))
            }
            Self::AsciiLine
            | Self::SpaceMouse
            | Self::Bno08x
            | Self::Bno08xRollFirst
            | Self::OpenTrack
            | Self::OpenIgtLink => Box::new(Passive::new(self, options)),
        }
    }
}

impl FromStr for Protocol {
    type Err = UnknownProtocol;

    fn from_str(name: &str) -> Result<Self, UnknownProtocol> {
        Self::named(name).ok_or_else(|| UnknownProtocol { name: name.to_owned() })
    }
}

/// Decoder of a stream in any protocol.
pub type Decoder = Box<dyn StreamDecoder>;

/// Bytes that are not a record, or an error reported by a device.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("byte {offset} of the tracker's stream: {fault}")]
pub struct DecodeError {
    /// Stream offset of the first byte.
    pub offset: u64,
    /// Fault of these bytes.
    pub fault: Fault,
}

impl DecodeError {
    /// Whether a well-formed frame reports an error of the device: the device is connected and responding.
    pub fn is_report(&self) -> bool {
        match &self.fault {
            Fault::Fastrak(reason) => matches!(reason, fastrak::Reason::Device { .. }),
            Fault::Liberty(reason) => matches!(reason, liberty::Reason::Device { .. }),
            Fault::Ndi(reason) => reason.is_report(),
            _ => false,
        }
    }

    /// Whether the device caused the error, by an error report or a missing answer, in contrast to damaged bytes.
    pub fn is_of_device(&self) -> bool {
        self.is_report() || matches!(self.fault, Fault::Ndi(ndi::Reason::NoReply { .. }))
    }
}

/// Fault of bytes that are not a record, in any protocol.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Fault {
    /// The stream ended within a record.
    #[error("the stream ends after {length} bytes of a record")]
    Incomplete {
        /// Number of bytes present.
        length: usize,
    },
    /// Fault of an ASCII line.
    #[error(transparent)]
    AsciiLine(#[from] ascii_line::Reason),
    /// Fault of a FASTRAK's record.
    #[error(transparent)]
    Fastrak(#[from] fastrak::Reason),
    /// Fault of a LIBERTY's or PATRIOT's frame.
    #[error(transparent)]
    Liberty(#[from] liberty::Reason),
    /// Fault of an NDI device or its reply.
    #[error(transparent)]
    Ndi(#[from] ndi::Reason),
    /// Fault of a SpaceMouse report.
    #[error(transparent)]
    SpaceMouse(#[from] spacemouse::Reason),
    /// Fault of a BNO08x's frame.
    #[error(transparent)]
    Bno08x(#[from] bno08x::Reason),
    /// Fault of an opentrack datagram.
    #[error(transparent)]
    OpenTrack(#[from] opentrack::Reason),
    /// Fault of an OpenIGTLink message.
    #[error(transparent)]
    OpenIgtLink(#[from] openigtlink::Reason),
}
