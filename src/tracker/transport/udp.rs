//! UDP transport: the tracker sends datagrams.

use std::io;
use std::net::SocketAddr;

use bytes::BytesMut;
use tokio::net::UdpSocket;

use super::{Received, not_open};

/// Listening socket.
pub(in crate::tracker) struct UdpPort {
    address: SocketAddr,
    socket: Option<UdpSocket>,
}

impl UdpPort {
    pub(super) fn new(address: SocketAddr) -> Self {
        Self { address, socket: None }
    }

    pub(super) async fn open(&mut self) -> io::Result<String> {
        let fail =
            |error: io::Error| io::Error::new(error.kind(), format!("cannot listen on UDP {}: {error}", self.address));
        let socket = UdpSocket::bind(self.address).await.map_err(fail)?;
        let address = socket.local_addr()?;
        self.socket = Some(socket);
        Ok(format!("UDP {address}"))
    }

    /// Receives one datagram.
    pub(super) async fn receive(&mut self, piece: &mut BytesMut) -> io::Result<Received> {
        let socket = self.socket.as_ref().ok_or_else(not_open)?;
        socket.recv_buf(piece).await?;
        Ok(Received::Bytes { time_ns: None })
    }

    pub(super) fn close(&mut self) {
        self.socket = None;
    }
}
