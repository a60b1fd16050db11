//! A tracker as chosen on the command line.

use anyhow::anyhow;
use clap::Args;
use insonify::station::Station;
use insonify::tracker::{BAUD_RANGE, Choice, PortName, Protocol, Settings, Transport};

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
        let (port, address) = (self.port.clone(), self.address.clone());
        let choice = Choice { protocol, port, address, baud: self.baud, sensor: self.sensor };
        choice.over(base).map(Some).input()
    }
}
