//! Port of a device that a test simulates in the same runtime, under the test's clock.

use std::io;

use bytes::BytesMut;
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};

use super::{Received, not_open};

/// Connects the simulated device.
pub(in crate::tracker) type Plug = Box<dyn FnMut() -> io::Result<DuplexStream> + Send>;

/// A port that is opened by a function.
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
        match self.stream.as_mut().ok_or_else(not_open)?.read_buf(piece).await? {
            0 => Err(io::ErrorKind::UnexpectedEof.into()),
            _ => Ok(Received::Bytes { time_ns: None }),
        }
    }

    pub(super) async fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.as_mut().ok_or_else(not_open)?.write_all(bytes).await
    }

    pub(super) fn close(&mut self) {
        self.stream = None;
    }
}
