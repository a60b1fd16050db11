//! Arguments that choose a tracker.

use anyhow::anyhow;
use clap::Args;
use insonify::station::Station;
use insonify::tracker::{BAUD_RANGE, Choice, PortName, Protocol, Settings, Transport};

use super::{Classify, Failure};

fn baud_help() -> String {
    format!("Speed of the serial port, {BAUD_RANGE:?} baud [default: the protocol's usual one]")
}

fn protocol_help() -> String {
    format!("Protocol of the tracker: {}", Protocol::NAMES.join(", "))
}

/// Options of a tracker and its transport.
#[derive(Debug, Args)]
pub(crate) struct TrackerArgs {
    /// Serial port or HID device: a path, or vendor:product, or vendor:product:serial
    #[arg(long, conflicts_with = "address", requires = "protocol")]
    pub(crate) port: Option<PortName>,

    /// host:port of a tracker's TCP server; for opentrack, the address to listen on
    #[arg(long, requires = "protocol")]
    pub(crate) address: Option<String>,

    #[arg(long, help = protocol_help())]
    pub(crate) protocol: Option<Protocol>,

    #[arg(long, requires = "port", value_parser = clap::value_parser!(u32).range(BAUD_RANGE), help = baud_help())]
    pub(crate) baud: Option<u32>,

    /// Sensor of the probe: station or port handle [default: 1 on Polhemus devices, else the only one that reports]
    #[arg(long, value_name = "N")]
    pub(crate) sensor: Option<u16>,

    /// Tool of the probe, by its OpenIGTLink name, such as ProbeToTracker [default: the only one that reports]
    #[arg(long, value_name = "NAME", conflicts_with = "sensor")]
    pub(crate) tool: Option<String>,
}

/// Help text about the format of `ascii-line`.
pub(crate) const ASCII_LINE_HELP: &str = "\
Lines of one's own firmware (ascii-line), nine numbers and a checksum each:
  P,seq,t_us,x,y,z,qw,qx,qy,qz*HH     as in P,7,1000,1.5,-2,80.25,1,0,0,0*0F
  seq counts lines; t_us is the board's clock in microseconds; x,y,z in mm; a unit quaternion, w first;
  HH: xor of all characters between P and *, two hexadecimal digits. docs/trackers.md has code that writes them";

/// The station's tracker settings; an error if the station has no tracker.
pub(crate) fn of_station(station: &Station) -> Result<Settings, Failure> {
    if station.tracker.transport == Transport::None {
        let path = station.path.display();
        return Err(Failure::Input(anyhow!("{path} has no tracker: its [tracker] has no `transport`")));
    }
    Ok(station.tracker.clone())
}

impl TrackerArgs {
    /// Applies the sensor of `--sensor` or the tool of `--tool` to `settings`, if given.
    ///
    /// # Errors
    /// A name is given for a protocol whose sensors have numbers, or a number for one whose tools have names.
    pub(crate) fn choose_probe(&self, settings: &mut Settings) -> Result<(), Failure> {
        settings.device.choose(self.sensor, self.tool.clone());
        settings.check_probe().input()
    }

    /// Settings of the tracker chosen on the command line, with the device settings of `base`. `None` if no protocol is
    /// chosen.
    pub(crate) fn over(&self, base: Settings) -> Result<Option<Settings>, Failure> {
        let Some(protocol) = self.protocol else { return Ok(None) };
        let (port, address) = (self.port.clone(), self.address.clone());
        let tool = self.tool.clone();
        let choice = Choice { protocol, port, address, baud: self.baud, sensor: self.sensor, tool };
        choice.over(base).map(Some).input()
    }
}
