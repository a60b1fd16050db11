//! Tracker settings of a station.

use std::fmt;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::str::FromStr;

use thiserror::Error;

use super::{AxisMap, DeviceOptions, NeedleSensor, ProbeSensor, Protocol, mock};

/// Tracker settings of a station; by default there is no tracker.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Settings {
    /// Transport of the tracker's bytes.
    pub transport: Transport,
    /// Protocol of the tracker's bytes. A recording has its own protocol, and the mock uses [`Protocol::AsciiLine`].
    pub protocol: Protocol,
    /// Options of the tracker's driver.
    pub device: DeviceOptions,
    /// Mapping from the axes of a puck (3D mouse) to the probe's.
    pub axis_map: AxisMap,
}

/// Protocol of a tracker's bytes, and the sensors of its tools.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct TrackerStream {
    /// Protocol of the bytes.
    pub protocol: Protocol,
    /// Choice of the probe; `None` takes the first sensor received, as in recordings of earlier builds.
    pub sensor: Option<ProbeSensor>,
    /// Choice of the needle; `None` without a tracked needle.
    pub needle: Option<NeedleSensor>,
}

impl Settings {
    /// Protocol of the bytes and sensors of the tools. Sensors that these settings don't choose, and the protocol, come
    /// from `recorded` if given.
    pub fn stream(&self, recorded: Option<TrackerStream>) -> TrackerStream {
        let TrackerStream { protocol, sensor, needle } = recorded.unwrap_or_else(|| {
            let usual = self.protocol.first_sensor().map_or(ProbeSensor::Only, ProbeSensor::Number);
            TrackerStream { protocol: self.protocol, sensor: Some(usual), needle: None }
        });
        let own = self.device.needle.clone();
        TrackerStream { protocol, sensor: self.device.probe().or(sensor), needle: own.or(needle) }
    }

    /// The same tracker with the needle's sensor in place of the probe's, for the needle's calibration. `None` if no
    /// sensor of a needle is chosen.
    #[must_use]
    pub fn of_needle(&self) -> Option<Self> {
        let mut settings = self.clone();
        match settings.device.needle.take()? {
            NeedleSensor::Number(number) => settings.device.choose(Some(number), None),
            NeedleSensor::Tool(tool) => settings.device.choose(None, Some(tool)),
        }
        Some(settings)
    }
}

impl fmt::Display for Settings {
    /// Protocol of the tracker and its port or address.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let protocol = self.protocol.name();
        match &self.transport {
            Transport::None => write!(f, "no tracker"),
            Transport::Serial { port, baud } => write!(f, "{protocol} on {port} at {baud} baud"),
            Transport::Tcp { address } => write!(f, "{protocol} from tcp {address}"),
            Transport::Udp { address } => write!(f, "{protocol} at udp {address}"),
            Transport::Hid { device: Some(device) } => write!(f, "{protocol} on {device}"),
            Transport::Hid { device: None } => write!(f, "the first {protocol}"),
            Transport::Mock(_) => write!(f, "a mock tracker"),
            Transport::Recording { path, .. } => write!(f, "{}", path.display()),
        }
    }
}

/// Transport of a tracker's bytes.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Transport {
    /// There is no tracker.
    #[default]
    None,
    /// A serial port, 8N1.
    Serial {
        /// Port.
        port: PortName,
        /// Speed, baud.
        baud: u32,
    },
    /// TCP connection to a server that sends the tracker's bytes.
    Tcp {
        /// `host:port`.
        address: String,
    },
    /// Datagrams sent to this machine.
    Udp {
        /// Address to listen on.
        address: SocketAddr,
    },
    /// A HID device.
    Hid {
        /// Device; `None` takes the first SpaceMouse.
        device: Option<PortName>,
    },
    /// Simulated board without hardware.
    Mock(mock::Settings),
    /// Raw bytes of a recording.
    Recording {
        /// File (.mcap).
        path: PathBuf,
        /// Playback speed.
        speed: Speed,
        /// Whether playback restarts at the end.
        repeat: bool,
    },
}

/// Playback speed of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Speed {
    /// Multiple of the recorded speed; bytes are stamped with the current host time.
    Factor(f64),
    /// As fast as the bytes are consumed; they keep their recorded times.
    AtOnce,
}

/// Range of the speed of a serial port, baud.
pub const BAUD_RANGE: std::ops::RangeInclusive<i64> = 300..=4_000_000;

/// Kind of a transport.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TransportKind {
    /// There is no tracker.
    None,
    /// A serial port.
    Serial,
    /// A TCP connection.
    Tcp,
    /// UDP datagrams sent to this machine.
    Udp,
    /// A HID device.
    Hid,
    /// A simulated tracker board, without hardware.
    Mock,
    /// Raw bytes of a recording.
    Recording,
}

insonify_core::names::named!(TransportKind {
    None = "none",
    Serial = "serial",
    Tcp = "tcp",
    Udp = "udp",
    Hid = "hid",
    Mock = "mock",
    Recording = "recording",
});

impl Protocol {
    /// Device transports that can carry this protocol. A recording can contain any protocol.
    pub fn transports(self) -> &'static [TransportKind] {
        use TransportKind::{Hid, Mock, Serial, Tcp, Udp};
        match self {
            Self::AsciiLine => &[Serial, Tcp, Udp, Mock],
            Self::FastrakAscii
            | Self::FastrakBinary
            | Self::Liberty
            | Self::Patriot
            | Self::Ndi
            | Self::Bno08x
            | Self::Bno08xRollFirst
            | Self::OpenIgtLink => &[Serial, Tcp],
            Self::SpaceMouse => &[Hid],
            Self::OpenTrack => &[Udp],
        }
    }

    /// Whether devices with this protocol are silent at rest, like pucks.
    #[cfg(feature = "live")]
    pub(super) fn may_rest(self) -> bool {
        self.transports() == [TransportKind::Hid]
    }
}

impl Transport {
    /// Kind of this transport.
    pub fn kind(&self) -> TransportKind {
        match self {
            Self::None => TransportKind::None,
            Self::Serial { .. } => TransportKind::Serial,
            Self::Tcp { .. } => TransportKind::Tcp,
            Self::Udp { .. } => TransportKind::Udp,
            Self::Hid { .. } => TransportKind::Hid,
            Self::Mock(_) => TransportKind::Mock,
            Self::Recording { .. } => TransportKind::Recording,
        }
    }

    /// Name in station files.
    pub fn name(&self) -> &'static str {
        self.kind().name()
    }

    /// Whether this transport can carry `protocol`.
    pub fn carries(&self, protocol: Protocol) -> bool {
        match self.kind() {
            TransportKind::None | TransportKind::Recording => true,
            kind @ (TransportKind::Serial
            | TransportKind::Tcp
            | TransportKind::Udp
            | TransportKind::Hid
            | TransportKind::Mock) => protocol.transports().contains(&kind),
        }
    }
}

/// Identification of a port or device: by path, or by USB id independent of the port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PortName {
    /// A path: `/dev/serial/by-id/...`, `/dev/ttyUSB0`, `COM3`, `/dev/hidraw0`.
    Path(String),
    /// A USB device: `vendor:product` or `vendor:product:serial`, the first two hexadecimal.
    Usb {
        /// Vendor.
        vendor: u16,
        /// Product.
        product: u16,
        /// Serial number; `None` takes the first device with these ids.
        serial: Option<String>,
    },
}

/// A text that does not identify a port.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error(
    "`{text}` is no port: expected a path, or `vendor:product` or `vendor:product:serial` as in 0403:6001:A50285BI"
)]
pub struct PortNameError {
    /// Text given.
    pub text: String,
}

impl PortName {
    /// Whether a USB device with these ids matches.
    pub fn is(&self, vendor: u16, product: u16, serial: Option<&str>) -> bool {
        match self {
            Self::Path(_) => false,
            Self::Usb { vendor: v, product: p, serial: s } => {
                (*v, *p) == (vendor, product) && (s.is_none() || s.as_deref() == serial)
            }
        }
    }
}

impl FromStr for PortName {
    type Err = PortNameError;

    fn from_str(text: &str) -> Result<Self, PortNameError> {
        let error = || PortNameError { text: text.to_owned() };
        if text.is_empty() {
            return Err(error());
        }
        // Paths by id may contain colons.
        if text.contains(['/', '\\']) || !text.contains(':') {
            return Ok(Self::Path(text.to_owned()));
        }
        let mut parts = text.splitn(3, ':');
        let mut id = || {
            let part = parts.next().filter(|part| part.len() <= 4 && part.bytes().all(|b| b.is_ascii_hexdigit()));
            part.and_then(|part| u16::from_str_radix(part, 16).ok()).ok_or_else(error)
        };
        let (vendor, product) = (id()?, id()?);
        match parts.next() {
            Some("") => Err(error()),
            serial => Ok(Self::Usb { vendor, product, serial: serial.map(str::to_owned) }),
        }
    }
}

impl fmt::Display for PortName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Path(path) => write!(f, "{path}"),
            Self::Usb { vendor, product, serial } => {
                write!(f, "{vendor:04x}:{product:04x}")?;
                serial.as_ref().map_or(Ok(()), |serial| write!(f, ":{serial}"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_a_path_or_an_id() {
        for path in ["/dev/ttyUSB0", "COM3", "/dev/serial/by-id/usb-FTDI_x:1.0-port0", r"\\.\COM12"] {
            assert_eq!(path.parse(), Ok(PortName::Path(path.into())));
        }
        let port: PortName = "0403:6001".parse().unwrap();
        assert!(port.is(0x403, 0x6001, Some("A")) && port.is(0x403, 0x6001, None));
        let port: PortName = "0403:6001:A5:02".parse().unwrap();
        assert_eq!(port, PortName::Usb { vendor: 0x403, product: 0x6001, serial: Some("A5:02".into()) });
        assert!(port.is(0x403, 0x6001, Some("A5:02")) && !port.is(0x403, 0x6001, None));
        assert_eq!(port.to_string().parse(), Ok(port));
        for wrong in ["", "0403:", "0403:60019", "04g3:6001", "0403:6001:", "+403:6001"] {
            assert!(wrong.parse::<PortName>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn protocols_fit_their_transports() {
        let serial = Transport::Serial { port: PortName::Path("COM3".into()), baud: 9600 };
        assert!(serial.carries(Protocol::Liberty));
        assert!(!Transport::Hid { device: None }.carries(Protocol::Liberty));
        let udp = Transport::Udp { address: SocketAddr::from(([127, 0, 0, 1], 4242)) };
        assert!(udp.carries(Protocol::AsciiLine) && !udp.carries(Protocol::FastrakBinary));
        assert!(udp.carries(Protocol::OpenTrack) && !serial.carries(Protocol::OpenTrack));
        // Each protocol has a transport for devices, and a recording can contain any protocol.
        let recording = Transport::Recording { path: "a".into(), speed: Speed::AtOnce, repeat: false };
        for protocol in Protocol::ALL {
            assert!(!protocol.transports().is_empty() && recording.carries(protocol), "{protocol:?}");
        }
    }
}
