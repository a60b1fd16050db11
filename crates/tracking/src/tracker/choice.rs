//! A tracker chosen by protocol and by its port or address.

use std::net::SocketAddr;

use thiserror::Error;

use super::ndi::{self, USUAL_BAUD};
use super::{PortName, ProbeSensor, Protocol, Settings, Transport};

/// Protocol of a tracker, and its port or address. The transport follows from them.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Protocol.
    pub protocol: Protocol,
    /// Serial port or HID device, if the tracker has one.
    pub port: Option<PortName>,
    /// `host:port` of a server, or the address to receive datagrams on; `None` for a tracker at a port.
    pub address: Option<String>,
    /// Speed of a serial port, baud; `None` for the protocol's usual speed.
    pub baud: Option<u32>,
    /// Number of the probe's sensor; `None` for the only sensor that reports.
    pub sensor: Option<u16>,
    /// Name of the probe's tool, if it is chosen by name.
    pub tool: Option<String>,
}

/// Reason why a choice is not a valid tracker.
#[derive(Debug, Error)]
pub enum ChoiceError {
    /// Neither port nor address.
    #[error("give --port or --address, too")]
    NoPortOrAddress,
    /// An address on which datagrams can't be received.
    #[error("`{address}` is no address to listen at; it must be IP:port")]
    Address {
        /// Address given.
        address: String,
    },
    /// A tool chosen by name, for a protocol that numbers its sensors.
    #[error("--tool: `{protocol}` has no named tools; give the number of the probe's sensor by --sensor")]
    NoNames {
        /// Name of the protocol.
        protocol: &'static str,
    },
    /// A sensor chosen by number, for a protocol that names its tools.
    #[error("--sensor: `{protocol}` numbers its tools by arrival; name the probe by --tool")]
    NoNumbers {
        /// Name of the protocol.
        protocol: &'static str,
    },
    /// A speed that the device does not support.
    #[error("--baud: {0}")]
    Device(#[from] ndi::OptionsError),
}

impl Choice {
    /// Settings of the chosen tracker, with the device settings of `base`.
    ///
    /// # Errors
    /// Neither a port nor an address where one is needed, an invalid address, an error of [`Settings::check_probe`],
    /// or a speed that the device does not support.
    pub fn over(&self, base: Settings) -> Result<Settings, ChoiceError> {
        let protocol = self.protocol;
        // `base` may choose the probe of another protocol or of a recording; that choice does not apply.
        let same = base.protocol == protocol && !matches!(base.transport, Transport::Recording { .. });
        let mut settings = Settings { protocol, ..base };
        if !same {
            (settings.device.sensor, settings.device.tool, settings.device.needle) = (None, None, None);
        }
        settings.device.choose(self.sensor, self.tool.clone());
        settings.transport = self.transport()?;
        settings.check_probe()?;
        let is_serial = matches!(settings.transport, Transport::Serial { .. });
        settings.device.ndi.baud = is_serial.then(|| self.baud.unwrap_or(USUAL_BAUD));
        if protocol == Protocol::Ndi {
            settings.device.ndi.validate()?;
        }
        Ok(settings)
    }

    fn transport(&self) -> Result<Transport, ChoiceError> {
        let protocol = self.protocol;
        let hid = Transport::Hid { device: self.port.clone() };
        match (&self.port, &self.address) {
            _ if hid.carries(protocol) => Ok(hid),
            (Some(port), _) => {
                // An NDI device is opened at its default speed and then switched to the requested speed.
                let baud = self.baud.filter(|_| protocol != Protocol::Ndi).unwrap_or(protocol.usual_baud());
                Ok(Transport::Serial { port: port.clone(), baud })
            }
            (None, Some(address)) => {
                let tcp = Transport::Tcp { address: address.clone() };
                if tcp.carries(protocol) {
                    return Ok(tcp);
                }
                let listened: Result<SocketAddr, _> = address.parse();
                let address = listened.map_err(|_| ChoiceError::Address { address: address.clone() })?;
                Ok(Transport::Udp { address })
            }
            (None, None) => Err(ChoiceError::NoPortOrAddress),
        }
    }
}

impl Settings {
    /// Checks that the probe is chosen by name if the protocol's tools have names, else by number. The choice
    /// is free for a recording: its sensors always arrive in the same order, so a number identifies a tool as well.
    ///
    /// # Errors
    /// A tool's name for numbered sensors, or a number for named tools.
    pub fn check_probe(&self) -> Result<(), ChoiceError> {
        let protocol = self.protocol.name();
        match (self.device.probe(), self.protocol.has_names()) {
            _ if matches!(self.transport, Transport::Recording { .. }) => Ok(()),
            (Some(ProbeSensor::Tool(_)), false) => Err(ChoiceError::NoNames { protocol }),
            (Some(ProbeSensor::Number(_)), true) => Err(ChoiceError::NoNumbers { protocol }),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Speed;
    use super::*;

    fn args(protocol: Protocol) -> Choice {
        Choice { port: None, address: None, protocol, baud: None, sensor: None, tool: None }
    }

    fn serial(protocol: Protocol, baud: Option<u32>) -> Choice {
        Choice { port: Some(PortName::Path("/dev/ttyUSB0".into())), baud, ..args(protocol) }
    }

    #[test]
    fn an_ndi_device_is_switched_on_serial_lines_alone() {
        let mut base = Settings { protocol: Protocol::Ndi, ..Settings::default() };
        base.device.ndi.baud = Some(921_600);
        let tcp = Choice { address: Some("10.0.0.2:8765".to_owned()), ..args(Protocol::Ndi) };
        let found = tcp.over(base.clone()).unwrap();
        assert_eq!((found.transport.name(), found.device.ndi.baud), ("tcp", None));
        for (asked, expected) in [(None, 115_200), (Some(921_600), 921_600)] {
            let found = serial(Protocol::Ndi, asked).over(Settings::default()).unwrap();
            assert_eq!(found.device.ndi.baud, Some(expected));
            assert!(matches!(found.transport, Transport::Serial { baud: 9600, .. }), "{:?}", found.transport);
        }
        assert!(serial(Protocol::Ndi, Some(12_345)).over(base).is_err());
        let found = serial(Protocol::Liberty, Some(12_345)).over(Settings::default()).unwrap();
        assert!(matches!(found.transport, Transport::Serial { baud: 12_345, .. }));
    }

    #[test]
    fn the_stations_sensor_is_of_its_own_protocol() {
        let mut base = Settings { protocol: Protocol::Liberty, ..Settings::default() };
        base.device.sensor = Some(2);
        let sensor = |args: Choice| args.over(base.clone()).unwrap().device.sensor;
        assert_eq!(sensor(serial(Protocol::Liberty, None)), Some(2));
        assert_eq!(sensor(serial(Protocol::AsciiLine, None)), None);
        assert_eq!(sensor(Choice { sensor: Some(3), ..serial(Protocol::AsciiLine, None) }), Some(3));
        let named = Choice { tool: Some("Probe".into()), ..serial(Protocol::Liberty, None) };
        assert!(named.over(base.clone()).unwrap_err().to_string().contains("give the number"));
    }

    #[test]
    fn tools_that_have_names_are_not_chosen_by_number() {
        let igtl = Choice { address: Some("h:18944".into()), ..args(Protocol::OpenIgtLink) };
        let numbered = Choice { sensor: Some(0), ..igtl.clone() };
        let refused = numbered.over(Settings::default()).unwrap_err().to_string();
        assert_eq!(refused, "--sensor: `openigtlink` numbers its tools by arrival; name the probe by --tool");
        let named = Choice { tool: Some("ProbeToTracker".into()), ..igtl.clone() };
        let mut found = named.over(Settings::default()).unwrap();
        assert_eq!(found.device.probe(), Some(ProbeSensor::Tool("ProbeToTracker".into())));
        assert_eq!(igtl.over(found.clone()).unwrap().device, found.device, "the station's own choice stays");
        found.device.choose(Some(1), None);
        assert!(matches!(found.check_probe(), Err(ChoiceError::NoNumbers { .. })));
        found.transport = Transport::Recording { path: "a.mcap".into(), speed: Speed::AtOnce, repeat: false };
        assert!(found.check_probe().is_ok());
    }
}
