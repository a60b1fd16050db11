//! Interface of the decoders of all protocols.

use bytes::{Buf, BytesMut};

use super::{DecodeError, Fault, Record};

/// Decoder of one stream of bytes.
pub trait StreamDecoder: Send {
    /// Takes the next record from the front of `buffer`, to which new bytes are appended.
    ///
    /// `Ok(None)` means that more bytes are needed. Each record and each error removes bytes, so a loop until
    /// `Ok(None)` terminates.
    ///
    /// # Errors
    /// Bytes that are not a record, or an error that the device reports. They are removed up to the next possible
    /// record, and the next call continues there.
    fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError>;

    /// Position in the stream.
    fn offset(&mut self) -> &mut Offset;

    /// Name of the sensor with this number; `None` if the protocol has only numbers.
    fn name_of(&self, _sensor: u16) -> Option<&str> {
        None
    }

    /// Types of skipped messages, which have no pose; `None` if there were none.
    fn skipped(&self) -> Option<String> {
        None
    }

    /// Ends the stream.
    ///
    /// # Errors
    /// Part of a record is left over. It is removed.
    fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        match buffer.len() {
            0 => Ok(()),
            length => Err(self.offset().reject(buffer, length, Fault::Incomplete { length })),
        }
    }
}

/// Number of bytes consumed from a stream.
#[derive(Debug, Clone, Copy, Default)]
pub struct Offset(u64);

impl Offset {
    /// Stream offset of the next byte.
    pub fn position(self) -> u64 {
        self.0
    }

    /// Removes up to `length` bytes from the front of `buffer` and returns their stream offset.
    pub fn take(&mut self, buffer: &mut BytesMut, length: usize) -> u64 {
        let (start, length) = (self.0, length.min(buffer.len()));
        buffer.advance(length);
        self.0 += length as u64;
        start
    }

    /// Removes `length` bytes from the front of `buffer`. Returns an error with their `fault`.
    pub fn reject(&mut self, buffer: &mut BytesMut, length: usize, fault: impl Into<Fault>) -> DecodeError {
        DecodeError { offset: self.take(buffer, length), fault: fault.into() }
    }
}

/// Records and faults of `bytes`, received in one piece.
#[cfg(test)]
pub(super) fn decode_all(decoder: &mut impl StreamDecoder, bytes: &[u8]) -> Vec<Result<Record, Fault>> {
    let mut buffer = BytesMut::from(bytes);
    std::iter::from_fn(|| decoder.decode(&mut buffer).map_err(|error| error.fault).transpose()).collect()
}
