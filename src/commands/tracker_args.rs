//! A tracker as chosen on the command line.

use std::net::SocketAddr;

use anyhow::{Context, anyhow};
use clap::Args;
use insonify::station::Station;
use insonify::tracker::ndi::USUAL_BAUD;
use insonify::tracker::{BAUD_RANGE, PortName, Protocol, Settings, Transport};

use super::{Classify, Failure};

fn baud_help() -> String {
    format!("Speed of the serial port, {BAUD_RANGE:?} baud [default: the protocol's usual one]")
}

/// Options of a tracker and its transport.
#[derive(Debug, Args)]
pub(crate) struct TrackerArgs {
    /// Serial port or HID device: a path, or vendor:product, or vendor:product:serial
    #[arg(long, conflicts_with = "address", requires = "protocol")]
    pub(crate) port: Option<PortName>,

    /// host:port of a tracker that is a TCP server; for opentrack where to listen
    #[arg(long, requires = "protocol")]
    pub(crate) address: Option<String>,

    /// Protocol of the tracker: ascii-line, fastrak-ascii, fastrak-binary, liberty, patriot ...
    #[arg(long)]
    pub(crate) protocol: Option<Protocol>,

    #[arg(long, requires = "port", value_parser = clap::value_parser!(u32).range(BAUD_RANGE), help = baud_help())]
    pub(crate) baud: Option<u32>,

    /// Station, port handle or tool that counts [default: the first that reports]
    #[arg(long)]
    pub(crate) sensor: Option<u16>,
}

/// The tracker of a station.
pub(crate) fn of_station(station: &Station) -> Result<Settings, Failure> {
    if station.tracker.transport == Transport::None {
        let path = station.path.display();
        return Err(Failure::Input(anyhow!("{path} has no tracker: its [tracker] has no `transport`")));
    }
    Ok(station.tracker.clone())
}

impl TrackerArgs {
    /// The chosen tracker, with the device settings of `base`; `None` without a protocol.
    pub(crate) fn over(&self, base: Settings) -> Result<Option<Settings>, Failure> {
        let Some(protocol) = self.protocol else { return Ok(None) };
        // Sensor numbers of another protocol or of a recording do not apply.
        let same = base.protocol == protocol && !matches!(base.transport, Transport::Recording { .. });
        let mut settings = Settings { protocol, ..base };
        settings.device.sensor = self.sensor.or(settings.device.sensor.filter(|_| same));
        let hid = Transport::Hid { device: self.port.clone() };
        settings.transport = match (&self.port, &self.address) {
            _ if hid.carries(protocol) => hid,
            (Some(port), _) => {
                // An NDI device is opened at its default speed and then switched to the requested one.
                let baud = self.baud.filter(|_| protocol != Protocol::Ndi).unwrap_or(protocol.usual_baud());
                Transport::Serial { port: port.clone(), baud }
            }
            (None, Some(address)) => {
                let tcp = Transport::Tcp { address: address.clone() };
                if tcp.carries(protocol) {
                    tcp
                } else {
                    let address: SocketAddr = address
                        .parse()
                        .with_context(|| format!("`{address}` is no address to listen at; it must be IP:port"))
                        .input()?;
                    Transport::Udp { address }
                }
            }
            (None, None) => return Err(Failure::Input(anyhow!("give --port or --address, too"))),
        };
        let is_serial = matches!(settings.transport, Transport::Serial { .. });
        settings.device.ndi.baud = is_serial.then(|| self.baud.unwrap_or(USUAL_BAUD));
        if protocol == Protocol::Ndi {
            settings.device.ndi.validate().context("--baud").input()?;
        }
        Ok(Some(settings))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(protocol: Protocol) -> TrackerArgs {
        TrackerArgs { port: None, address: None, protocol: Some(protocol), baud: None, sensor: None }
    }

    fn serial(protocol: Protocol, baud: Option<u32>) -> TrackerArgs {
        TrackerArgs { port: Some(PortName::Path("/dev/ttyUSB0".into())), baud, ..args(protocol) }
    }

    #[test]
    fn an_ndi_device_is_switched_on_serial_lines_alone() {
        let mut base = Settings { protocol: Protocol::Ndi, ..Settings::default() };
        base.device.ndi.baud = Some(921_600);
        let tcp = TrackerArgs { address: Some("10.0.0.2:8765".to_owned()), ..args(Protocol::Ndi) };
        let found = tcp.over(base.clone()).unwrap().unwrap();
        assert_eq!((found.transport.name(), found.device.ndi.baud), ("tcp", None));
        for (asked, expected) in [(None, 115_200), (Some(921_600), 921_600)] {
            let found = serial(Protocol::Ndi, asked).over(Settings::default()).unwrap().unwrap();
            assert_eq!(found.device.ndi.baud, Some(expected));
            assert!(matches!(found.transport, Transport::Serial { baud: 9600, .. }), "{:?}", found.transport);
        }
        assert!(serial(Protocol::Ndi, Some(12_345)).over(base).is_err());
        let found = serial(Protocol::Liberty, Some(12_345)).over(Settings::default()).unwrap().unwrap();
        assert!(matches!(found.transport, Transport::Serial { baud: 12_345, .. }));
    }

    #[test]
    fn the_stations_sensor_is_of_its_own_protocol() {
        let mut base = Settings { protocol: Protocol::Liberty, ..Settings::default() };
        base.device.sensor = Some(2);
        let sensor = |args: TrackerArgs| args.over(base.clone()).unwrap().unwrap().device.sensor;
        assert_eq!(sensor(serial(Protocol::Liberty, None)), Some(2));
        assert_eq!(sensor(serial(Protocol::AsciiLine, None)), None);
        assert_eq!(sensor(TrackerArgs { sensor: Some(3), ..serial(Protocol::AsciiLine, None) }), Some(3));
    }
}
