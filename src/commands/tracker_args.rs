//! A tracker as chosen on the command line.

use std::net::SocketAddr;

use anyhow::{Context, anyhow};
use clap::Args;
use insonify::tracker::{PortName, Protocol, Settings, Transport};

use super::{Classify, Failure};

/// Which tracker, and how to reach it.
#[derive(Debug, Args)]
pub(crate) struct TrackerArgs {
    /// Serial port or HID device: a path, or vendor:product, or vendor:product:serial
    #[arg(long, conflicts_with = "address", requires = "protocol")]
    pub(crate) port: Option<PortName>,

    /// host:port of a tracker that is a TCP server; for opentrack where to listen
    #[arg(long, requires = "protocol")]
    pub(crate) address: Option<String>,

    /// What it speaks: ascii-line, fastrak-ascii, fastrak-binary, liberty, patriot ...
    #[arg(long)]
    pub(crate) protocol: Option<Protocol>,

    /// Speed of the serial port, 300..=4000000 baud [default: the protocol's usual one]
    #[arg(long, requires = "port", value_parser = clap::value_parser!(u32).range(300..=4_000_000))]
    pub(crate) baud: Option<u32>,

    /// Station, port handle or tool that counts [default: the first that reports]
    #[arg(long)]
    pub(crate) sensor: Option<u16>,
}

impl TrackerArgs {
    /// The tracker that is asked for, with what `base` says of its device; none where no protocol is given.
    pub(crate) fn over(&self, base: Settings) -> Result<Option<Settings>, Failure> {
        let Some(protocol) = self.protocol else { return Ok(None) };
        let mut settings = Settings { protocol, ..base };
        settings.device.sensor = self.sensor.or(settings.device.sensor);
        let hid = Transport::Hid { device: self.port.clone() };
        settings.transport = match (&self.port, &self.address) {
            _ if hid.carries(protocol) => hid,
            (Some(port), _) => {
                Transport::Serial { port: port.clone(), baud: self.baud.unwrap_or(protocol.usual_baud()) }
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
        Ok(Some(settings))
    }
}
