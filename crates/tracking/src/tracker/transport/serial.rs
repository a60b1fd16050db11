//! Serial transport.

use std::io;
use std::time::Duration;

use bytes::BytesMut;
use tokio_serial::{ClearBuffer, SerialPort as _, SerialPortBuilderExt, SerialStream};

use super::{Received, not_open, receive_from, send_to};
use crate::tracker::devices;
use crate::tracker::driver::Line;
use crate::tracker::settings::PortName;

/// Duration of a break: longer than a character at the lowest speed.
const BREAK: Duration = Duration::from_millis(250);

/// A serial port, 8N1 without flow control.
pub(in crate::tracker) struct SerialPort {
    name: PortName,
    baud: u32,
    stream: Option<SerialStream>,
}

impl SerialPort {
    pub(super) fn new(name: PortName, baud: u32) -> Self {
        Self { name, baud, stream: None }
    }

    pub(super) fn open(&mut self) -> io::Result<String> {
        // A USB device may return under another path.
        let path = devices::serial_path(&self.name)?;
        let stream = tokio_serial::new(&path, self.baud).open_native_async().map_err(|error| {
            let error = io::Error::from(error);
            let hint = match error.kind() {
                io::ErrorKind::PermissionDenied => "; on Linux, users of serial ports are in the group `dialout`",
                _ => "",
            };
            io::Error::new(error.kind(), format!("cannot open {path}: {error}{hint}"))
        })?;
        // Bytes still buffered by the driver are outdated.
        stream.clear(ClearBuffer::Input)?;
        self.stream = Some(stream);
        Ok(format!("{path} at {} baud", self.baud))
    }

    pub(super) async fn receive(&mut self, piece: &mut BytesMut) -> io::Result<Received> {
        // An unplugged adapter reads as endless end-of-file.
        receive_from(&mut self.stream, piece, "the port is gone (unplugged?)").await
    }

    pub(super) async fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        send_to(&mut self.stream, bytes).await
    }

    pub(super) async fn line(&mut self, line: Line) -> io::Result<()> {
        let stream = self.stream.as_mut().ok_or_else(not_open)?;
        match line {
            Line::Speed(baud) => Ok(stream.set_baud_rate(baud)?),
            Line::Break => {
                stream.set_break()?;
                tokio::time::sleep(BREAK).await;
                Ok(stream.clear_break()?)
            }
        }
    }

    pub(super) fn close(&mut self) {
        self.stream = None;
    }
}
