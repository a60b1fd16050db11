//! UDP transport: the tracker sends datagrams.

use std::io;
use std::net::SocketAddr;

use bytes::BytesMut;
use tokio::net::UdpSocket;
use tokio::time::Instant;

use super::sender::{Sender, SenderLock};
use super::{Received, not_open};

/// Listening socket.
pub(in crate::tracker) struct UdpPort {
    address: SocketAddr,
    socket: Option<UdpSocket>,
    /// Time at which the socket was opened, which is time 0 of `senders`; `None` before.
    opened: Option<Instant>,
    senders: SenderLock,
}

impl UdpPort {
    pub(super) fn new(address: SocketAddr) -> Self {
        Self { address, socket: None, opened: None, senders: SenderLock::default() }
    }

    pub(super) async fn open(&mut self) -> io::Result<String> {
        let fail =
            |error: io::Error| io::Error::new(error.kind(), format!("cannot listen on UDP {}: {error}", self.address));
        let socket = UdpSocket::bind(self.address).await.map_err(fail)?;
        let address = socket.local_addr()?;
        self.socket = Some(socket);
        (self.opened, self.senders) = (Some(Instant::now()), SenderLock::default());
        Ok(format!("UDP {address}"))
    }

    /// Receives one datagram.
    pub(super) async fn receive(&mut self, piece: &mut BytesMut) -> io::Result<Received> {
        let socket = self.socket.as_ref().ok_or_else(not_open)?;
        let (_, from) = socket.recv_buf_from(piece).await?;
        let now = self.opened.map(|opened| opened.elapsed()).unwrap_or_default();
        Ok(match self.senders.judge(from, now) {
            Sender::Used => Received::Bytes { time_ns: None },
            Sender::Changed { from: before } => Received::FromNewSender { before, now: from },
            Sender::Other { used } => Received::FromOtherSender { other: from, used },
        })
    }

    pub(super) fn close(&mut self) {
        self.socket = None;
    }
}
