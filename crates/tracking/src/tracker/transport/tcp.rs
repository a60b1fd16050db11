//! TCP transport: the tracker is the server.

use std::io;
use std::time::Duration;

use bytes::BytesMut;
use tokio::net::TcpStream;
use tokio::time::timeout;

use super::{Received, receive_from, send_to};

const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// A connection to a server.
pub(in crate::tracker) struct TcpPort {
    address: String,
    stream: Option<TcpStream>,
}

impl TcpPort {
    pub(super) fn new(address: String) -> Self {
        Self { address, stream: None }
    }

    pub(super) async fn open(&mut self) -> io::Result<String> {
        let fail =
            |error: io::Error| io::Error::new(error.kind(), format!("cannot connect to {}: {error}", self.address));
        let connecting = timeout(CONNECT_TIMEOUT, TcpStream::connect(&self.address));
        let late = |_| io::Error::new(io::ErrorKind::TimedOut, "no answer in 5 s");
        let stream = connecting.await.map_err(late).and_then(|connected| connected).map_err(fail)?;
        stream.set_nodelay(true)?;
        self.stream = Some(stream);
        Ok(self.address.clone())
    }

    pub(super) async fn receive(&mut self, piece: &mut BytesMut) -> io::Result<Received> {
        receive_from(&mut self.stream, piece, "the server closed the connection").await
    }

    pub(super) async fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        send_to(&mut self.stream, bytes).await
    }

    pub(super) fn close(&mut self) {
        self.stream = None;
    }
}
