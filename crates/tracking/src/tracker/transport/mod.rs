//! Transports of a tracker's bytes.

use std::io;
use std::net::SocketAddr;

use bytes::BytesMut;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};

use super::TrackerError;
use super::driver::Line;
use super::playback::Playback;
use super::settings::Transport;

#[cfg(feature = "hid")]
mod hid;
mod mock;
#[cfg(test)]
pub(super) mod pipe;
mod playback;
mod sender;
#[cfg(feature = "serial")]
mod serial;
mod tcp;
mod udp;

/// Largest number of bytes per read.
const PIECE: usize = 4096;

/// Outcome of a read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Received {
    /// Bytes were appended.
    Bytes {
        /// Arrival of the first byte, ns since 1970 (UTC); `None` for the current time.
        time_ns: Option<u64>,
    },
    /// The first datagram of a new sender, which replaces the previous sender, was appended.
    FromNewSender {
        /// Sender until now.
        before: SocketAddr,
        /// New sender.
        now: SocketAddr,
    },
    /// A datagram of another sender was appended; it must be left out.
    FromOtherSender {
        /// Sender of the datagram.
        other: SocketAddr,
        /// Sender whose datagrams are used.
        used: SocketAddr,
    },
    /// The stream restarts.
    Restarted,
    /// There are no more bytes.
    Ended,
}

/// A source of bytes that can be opened and closed repeatedly.
pub(super) enum Port {
    /// A port that never delivers anything.
    None,
    #[cfg(feature = "serial")]
    Serial(serial::SerialPort),
    Tcp(tcp::TcpPort),
    Udp(udp::UdpPort),
    #[cfg(feature = "hid")]
    Hid(hid::HidPort),
    Mock(Box<mock::MockPort>),
    Playback(playback::PlaybackPort),
    #[cfg(test)]
    Pipe(pipe::PipePort),
}

impl Port {
    /// A port that isn't open yet.
    pub(super) fn new(transport: &Transport, playback: Option<Box<dyn Playback>>) -> Result<Self, TrackerError> {
        Ok(match transport {
            Transport::None => Self::None,
            #[cfg(feature = "serial")]
            Transport::Serial { port, baud } => Self::Serial(serial::SerialPort::new(port.clone(), *baud)),
            #[cfg(not(feature = "serial"))]
            Transport::Serial { .. } => return Err(TrackerError::NotBuilt { feature: "serial" }),
            Transport::Tcp { address } => Self::Tcp(tcp::TcpPort::new(address.clone())),
            Transport::Udp { address } => Self::Udp(udp::UdpPort::new(*address)),
            #[cfg(feature = "hid")]
            Transport::Hid { device } => Self::Hid(hid::HidPort::new(device.clone())),
            #[cfg(not(feature = "hid"))]
            Transport::Hid { .. } => return Err(TrackerError::NotBuilt { feature: "hid" }),
            Transport::Mock(settings) => Self::Mock(Box::new(mock::MockPort::new(settings.clone()))),
            Transport::Recording { speed, repeat, .. } => {
                let source = playback.ok_or(TrackerError::NoPlayback)?;
                Self::Playback(playback::PlaybackPort::new(source, *speed, *repeat))
            }
        })
    }

    /// Opens the port and returns its name.
    pub(super) async fn open(&mut self) -> io::Result<String> {
        match self {
            Self::None => Ok("none".to_owned()),
            #[cfg(feature = "serial")]
            Self::Serial(port) => port.open(),
            Self::Tcp(port) => port.open().await,
            Self::Udp(port) => port.open().await,
            #[cfg(feature = "hid")]
            Self::Hid(port) => port.open().await,
            Self::Mock(port) => port.open(),
            Self::Playback(port) => Ok(port.source().name()),
            #[cfg(test)]
            Self::Pipe(port) => port.open(),
        }
    }

    /// Waits for bytes and appends them to `piece`. Cancelling the wait loses nothing.
    pub(super) async fn receive(&mut self, piece: &mut BytesMut) -> io::Result<Received> {
        piece.reserve(PIECE);
        match self {
            Self::None => std::future::pending().await,
            #[cfg(feature = "serial")]
            Self::Serial(port) => port.receive(piece).await,
            Self::Tcp(port) => port.receive(piece).await,
            Self::Udp(port) => port.receive(piece).await,
            #[cfg(feature = "hid")]
            Self::Hid(port) => port.receive(piece).await,
            Self::Mock(port) => port.receive(piece).await,
            Self::Playback(port) => port.receive(piece).await,
            #[cfg(test)]
            Self::Pipe(port) => port.receive(piece).await,
        }
    }

    /// Sends all of `bytes`; receive-only transports ignore them.
    pub(super) async fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            #[cfg(feature = "serial")]
            Self::Serial(port) => port.send(bytes).await,
            Self::Tcp(port) => port.send(bytes).await,
            #[cfg(test)]
            Self::Pipe(port) => port.send(bytes).await,
            _ => Ok(()),
        }
    }

    /// Carries out an operation on a serial line; other transports ignore it.
    pub(super) async fn line(&mut self, line: Line) -> io::Result<()> {
        match self {
            #[cfg(feature = "serial")]
            Self::Serial(port) => port.line(line).await,
            _ => {
                let _ = line;
                Ok(())
            }
        }
    }

    pub(super) fn close(&mut self) {
        match self {
            Self::None | Self::Mock(_) | Self::Playback(_) => {}
            #[cfg(feature = "serial")]
            Self::Serial(port) => port.close(),
            Self::Tcp(port) => port.close(),
            Self::Udp(port) => port.close(),
            #[cfg(feature = "hid")]
            Self::Hid(port) => port.close(),
            #[cfg(test)]
            Self::Pipe(port) => port.close(),
        }
    }

    /// Whether reopening the port may wake a silent device.
    pub(super) fn reopening_may_wake(&self) -> bool {
        match self {
            #[cfg(feature = "serial")]
            Self::Serial(_) => true,
            #[cfg(feature = "hid")]
            Self::Hid(_) => true,
            Self::Tcp(_) => true,
            #[cfg(test)]
            Self::Pipe(_) => true,
            Self::None | Self::Udp(_) | Self::Mock(_) | Self::Playback(_) => false,
        }
    }

    /// Whether each read delivers one complete message.
    pub(super) fn has_messages(&self) -> bool {
        match self {
            #[cfg(feature = "hid")]
            Self::Hid(_) => true,
            Self::Udp(_) => true,
            _ => false,
        }
    }

    /// Whether the port may recover after an error.
    pub(super) fn may_recover(&self) -> bool {
        !matches!(self, Self::Playback(_))
    }
}

/// Waits for bytes of a stream; `gone` names the reason for its end.
async fn receive_from(
    stream: &mut Option<impl AsyncRead + Unpin>,
    piece: &mut BytesMut,
    gone: &str,
) -> io::Result<Received> {
    match stream.as_mut().ok_or_else(not_open)?.read_buf(piece).await? {
        0 => Err(io::Error::new(io::ErrorKind::UnexpectedEof, gone)),
        _ => Ok(Received::Bytes { time_ns: None }),
    }
}

/// Sends all of `bytes`. Not flushed: on a serial line that would block the thread until the last bit is sent.
async fn send_to(stream: &mut Option<impl AsyncWrite + Unpin>, bytes: &[u8]) -> io::Result<()> {
    stream.as_mut().ok_or_else(not_open)?.write_all(bytes).await
}

/// Error of a port that isn't open; the session opens ports before use.
fn not_open() -> io::Error {
    io::Error::new(io::ErrorKind::NotConnected, "the port is not open")
}
