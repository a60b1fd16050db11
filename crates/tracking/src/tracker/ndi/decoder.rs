//! Decoder of recorded replies, without the commands that caused them.

use bytes::BytesMut;

use super::Reason;
use super::frame::{Framer, Item};
use crate::tracker::{DecodeError, Offset, Record, StreamDecoder};

/// Number of ports whose last frame is remembered.
const PORTS: usize = 256;

/// Decoder of all output of one device: tracking replies become records, other replies are skipped.
#[derive(Debug, Clone, Default)]
pub struct Decoder {
    framer: Framer,
    repeats: Repeats,
}

/// Detection of repeated frames.
#[derive(Debug, Clone, Default)]
pub(super) struct Repeats {
    last: Vec<Option<u32>>,
}

impl Repeats {
    /// Whether the frame number differs from that of the port's previous record.
    pub(super) fn is_new(&mut self, record: &Record) -> bool {
        self.last.resize(PORTS, None);
        let Some(last) = self.last.get_mut(usize::from(record.sensor)) else { return true };
        let is_new = *last != record.sequence;
        *last = record.sequence;
        is_new
    }

    pub(super) fn forget(&mut self) {
        self.last.fill(None);
    }
}

/// Code of an `ERRORxx` reply; `None` for another reply.
pub(super) fn error_code(text: &str) -> Option<u8> {
    let digits = text.strip_prefix("ERROR").filter(|digits| digits.len() == 2)?;
    u8::from_str_radix(digits, 16).ok()
}

impl StreamDecoder for Decoder {
    fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        loop {
            match self.framer.next(buffer)? {
                None => return Ok(None),
                Some(Item::Record(record)) if self.repeats.is_new(&record) => return Ok(Some(record)),
                Some(Item::Record(_) | Item::Tracked { .. }) => {}
                Some(Item::Text(text)) => {
                    let offset = self.framer.item_offset();
                    if let Some(code) = error_code(&text) {
                        let command = "a command that the recording doesn't hold".to_owned();
                        return Err(DecodeError { offset, fault: Reason::Refused { code, command }.into() });
                    }
                    if text == "RESET" {
                        self.repeats.forget();
                        return Err(DecodeError { offset, fault: Reason::Restarted.into() });
                    }
                }
            }
        }
    }

    fn offset(&mut self) -> &mut Offset {
        self.framer.offset()
    }

    fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        self.framer.finish(buffer)
    }
}
