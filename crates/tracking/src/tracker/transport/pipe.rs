//! Port to a device simulated by a test in the same runtime, with the test's clock.

use std::io;

use bytes::BytesMut;
use tokio::io::DuplexStream;

use super::{Received, receive_from, send_to};

/// Function that connects the simulated device.
pub(in crate::tracker) type Plug = Box<dyn FnMut() -> io::Result<DuplexStream> + Send>;

/// A port opened by a function.
pub(in crate::tracker) struct PipePort {
    plug: Plug,
    stream: Option<DuplexStream>,
}

impl PipePort {
    pub(in crate::tracker) fn new(plug: Plug) -> Self {
        Self { plug, stream: None }
    }

    pub(super) fn open(&mut self) -> io::Result<String> {
        self.stream = Some((self.plug)()?);
        Ok("a pipe".to_owned())
    }

    pub(super) async fn receive(&mut self, piece: &mut BytesMut) -> io::Result<Received> {
        receive_from(&mut self.stream, piece, "the pipe ended").await
    }

    pub(super) async fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        send_to(&mut self.stream, bytes).await
    }

    pub(super) fn close(&mut self) {
        self.stream = None;
    }
}
