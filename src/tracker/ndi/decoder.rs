//! Decoder of recorded replies, without the commands that caused them.

use bytes::BytesMut;

use super::frame::{Framer, Item};
use super::{DecodeError, Reason};
use crate::tracker::Record;

/// Number of ports whose last frame is remembered.
const PORTS: usize = 256;

/// Decoder of everything one device sent: tracking replies become records, other replies are skipped.
#[derive(Debug, Clone, Default)]
pub struct Decoder {
    framer: Framer,
    repeats: Repeats,
}

/// Detection of repeated frames.
#[derive(Debug, Clone, Default)]
pub(super) struct Repeats {
    last: Vec<Option<u32>>,
    /// Number of repeated frames.
    pub(super) count: u64,
}

impl Repeats {
    /// Whether the frame number differs from the last one of the same port.
    pub(super) fn is_new(&mut self, record: &Record) -> bool {
        self.last.resize(PORTS, None);
        let Some(last) = self.last.get_mut(usize::from(record.sensor)) else { return true };
        let is_new = *last != record.sequence;
        *last = record.sequence;
        self.count += u64::from(!is_new);
        is_new
    }

    pub(super) fn forget(&mut self) {
        self.last.fill(None);
    }
}

/// Code of an `ERRORxx` reply.
pub(super) fn error_code(text: &str) -> Option<u8> {
    let digits = text.strip_prefix("ERROR").filter(|digits| digits.len() == 2)?;
    u8::from_str_radix(digits, 16).ok()
}

impl Decoder {
    /// A decoder at the start of a stream.
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of tool entries that repeated the previous frame and gave no record.
    pub fn repeats(&self) -> u64 {
        self.repeats.count
    }

    /// Takes the next record from the front of `buffer`; `Ok(None)` asks for more bytes.
    ///
    /// Every `Ok(Some(_))` and every error removes at least one byte.
    ///
    /// # Errors
    /// Bytes that are not a reply, an error that the device reports, or its restart. They are removed.
    pub fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        loop {
            match self.framer.next(buffer)? {
                None => return Ok(None),
                Some(Item::Record(record)) if self.repeats.is_new(&record) => return Ok(Some(record)),
                Some(Item::Record(_) | Item::Tracked { .. }) => {}
                Some(Item::Text(text)) => {
                    let offset = self.framer.item_offset();
                    if let Some(code) = error_code(&text) {
                        let command = "a command that the recording doesn't hold".to_owned();
                        return Err(DecodeError { offset, reason: Reason::Refused { code, command } });
                    }
                    if text == "RESET" {
                        self.repeats.forget();
                        return Err(DecodeError { offset, reason: Reason::Restarted });
                    }
                }
            }
        }
    }

    /// Ends the stream.
    ///
    /// # Errors
    /// Part of a reply is left over. It is removed.
    pub fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        self.framer.finish(buffer)
    }
}
