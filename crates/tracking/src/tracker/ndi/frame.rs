//! Framing of replies in the byte stream.

use std::collections::VecDeque;

use bytes::BytesMut;

use super::reply::{self, Port};
use super::{Reason, TEXT_LIMIT, crc16};
use crate::tracker::framing::{NOISE_LIMIT, quote};
use crate::tracker::{DecodeError, Offset, Record};

/// First bytes of a binary reply.
const BINARY_START: [u8; 2] = [0xC4, 0xA5];

/// Start, length and checksum of a binary reply, bytes.
const BINARY_HEAD: usize = 6;

/// Item found in the stream.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Item {
    /// Tool of a tracking reply.
    Record(Record),
    /// End of a tracking reply.
    Tracked {
        /// System status.
        system_status: u16,
        /// Number of ports that are disabled or unplugged.
        absent: u16,
    },
    /// Another reply, without its checksum.
    Text(String),
}

/// Splits the stream into replies, and tracking replies into records.
#[derive(Debug, Clone, Default)]
pub(super) struct Framer {
    offset: Offset,
    /// Stream offset of the last item.
    item_offset: u64,
    /// Items already parsed from the front of the buffer, each with its number of bytes.
    pending: VecDeque<(usize, Result<Item, Reason>)>,
    /// Stream offset of the last error, if no reply was found since. The error covers 64 bytes from this offset on.
    lost: Option<u64>,
    /// Number of bytes that remained in the buffer after the last call.
    left: usize,
    /// Number of bytes at the front of the buffer to be discarded.
    given_up: usize,
}

/// Content of the front of the buffer.
enum Front {
    /// Nothing, or an incomplete reply.
    Part,
    /// Binary reply of this many bytes with a correct data checksum.
    Binary(usize),
    /// Text with a correct checksum; its length with checksum and carriage return, bytes.
    Text(usize),
    /// Not a reply: bytes to remove, fault, and whether a reply may start after them.
    Wrong(usize, Reason, bool),
}

impl Framer {
    /// Position in the stream.
    pub(super) fn offset(&mut self) -> &mut Offset {
        &mut self.offset
    }

    /// Stream offset of the last item, bytes.
    pub(super) fn item_offset(&self) -> u64 {
        self.item_offset
    }

    /// Discards an incomplete reply that the device will not complete.
    pub(super) fn give_up(&mut self) {
        if self.pending.is_empty() {
            self.given_up = self.left;
        }
    }

    /// Takes the next item; `None` if more bytes are needed. Each item and each error removes bytes.
    pub(super) fn next(&mut self, buffer: &mut BytesMut) -> Result<Option<Item>, DecodeError> {
        let given_up = std::mem::take(&mut self.given_up).min(buffer.len());
        if given_up > 0 {
            let reason = Reason::Incomplete { length: given_up };
            return Err(self.reject(buffer, given_up, reason));
        }
        let item = loop {
            if let Some((length, item)) = self.pending.pop_front() {
                let offset = self.offset.take(buffer, length);
                self.item_offset = offset;
                break item.map(Some).map_err(|reason| DecodeError { offset, fault: reason.into() });
            }
            match front(buffer) {
                Front::Part => break Ok(None),
                Front::Binary(length) => self.tracking(length, &buffer[BINARY_HEAD..length - 2], BINARY_HEAD, true),
                Front::Text(length) => {
                    let text = &buffer[..length - 5];
                    if reply::is_text_reply(text) {
                        self.tracking(length, text, 0, false);
                    } else {
                        let text = String::from_utf8_lossy(text).into_owned();
                        self.pending.push_back((length, Ok(Item::Text(text))));
                    }
                }
                Front::Wrong(length, reason, aligned) => {
                    let error = self.reject(buffer, length, reason);
                    let told = self.lost.filter(|from| error.offset - from < NOISE_LIMIT as u64);
                    self.lost = (!aligned).then_some(told.unwrap_or(error.offset));
                    if told.is_none() {
                        break Err(error);
                    }
                    continue;
                }
            }
            self.lost = None;
        };
        self.left = buffer.len();
        item
    }

    /// Ends the stream.
    pub(super) fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        self.pending.clear();
        self.given_up = 0;
        match buffer.len() {
            0 => Ok(()),
            length => Err(self.reject(buffer, length, Reason::Incomplete { length })),
        }
    }

    /// Queues the items of a tracking reply of `length` bytes, whose `data` starts at byte `start`.
    fn tracking(&mut self, length: usize, data: &[u8], start: usize, is_binary: bool) {
        let mut used = 0;
        let mut absent = 0;
        let pending = &mut self.pending;
        let found = |end: usize, port: Result<Port, Reason>| {
            let item = match port {
                Ok(Port::Tracked(record)) => Ok(Item::Record(record)),
                Ok(Port::Absent) => {
                    absent += 1;
                    return;
                }
                Err(reason) => Err(reason),
            };
            pending.push_back((start + end - used, item));
            used = start + end;
        };
        let status = if is_binary { reply::binary(data, found) } else { reply::text(data, found) };
        if status.is_err() {
            // The checksum is right, but the layout is unexpected: the whole reply is discarded.
            self.pending.clear();
            used = 0;
        }
        self.pending.push_back((length - used, status.map(|system_status| Item::Tracked { system_status, absent })));
    }

    fn reject(&mut self, buffer: &mut BytesMut, length: usize, reason: Reason) -> DecodeError {
        let error = self.offset.reject(buffer, length, reason);
        self.left = buffer.len();
        error
    }
}

fn is_text(byte: u8) -> bool {
    byte == b'\n' || (b' '..=b'~').contains(&byte)
}

/// Inspects the front of `buffer`. Bytes after the first reply do not affect the result.
fn front(buffer: &[u8]) -> Front {
    match buffer.first() {
        None => Front::Part,
        Some(&byte) if byte == BINARY_START[0] => binary_front(buffer),
        Some(&byte) if is_text(byte) => text_front(buffer),
        Some(&byte) => Front::Wrong(1, Reason::Noise { byte }, false),
    }
}

fn u16_at(buffer: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(buffer.get(at..at + 2)?.try_into().ok()?))
}

fn binary_front(buffer: &[u8]) -> Front {
    if buffer.get(1).is_some_and(|&byte| byte != BINARY_START[1]) {
        return Front::Wrong(1, Reason::Noise { byte: buffer[0] }, false);
    }
    let (Some(length), Some(found)) = (u16_at(buffer, 2), u16_at(buffer, 4)) else { return Front::Part };
    let computed = crc16(&buffer[..4]);
    if found != computed {
        return Front::Wrong(1, Reason::Checksum { found, computed }, false);
    }
    let end = BINARY_HEAD + usize::from(length);
    let Some(found) = u16_at(buffer, end) else { return Front::Part };
    let computed = crc16(&buffer[BINARY_HEAD..end]);
    // A reply that lost bytes contains the start of the next reply.
    if found == computed {
        Front::Binary(end + 2)
    } else {
        Front::Wrong(1, Reason::Checksum { found, computed }, false)
    }
}

fn text_front(buffer: &[u8]) -> Front {
    let Some(end) = buffer.iter().take(TEXT_LIMIT + 1).position(|&byte| !is_text(byte)) else {
        let is_full = buffer.len() > TEXT_LIMIT;
        return if is_full { Front::Wrong(TEXT_LIMIT + 1, Reason::TooLong, false) } else { Front::Part };
    };
    if buffer[end] != b'\r' {
        return Front::Wrong(end, Reason::Noise { byte: buffer[end] }, false);
    }
    let digits = end.checked_sub(4).and_then(|start| std::str::from_utf8(&buffer[start..end]).ok());
    let Some(found) = digits
        .filter(|digits| digits.bytes().all(|b| b.is_ascii_hexdigit()))
        .and_then(|digits| u16::from_str_radix(digits, 16).ok())
    else {
        return Front::Wrong(end + 1, Reason::ChecksumMissing { text: quote(&buffer[..end]) }, true);
    };
    let computed = crc16(&buffer[..end - 4]);
    if found == computed {
        Front::Text(end + 1)
    } else {
        Front::Wrong(end + 1, Reason::Checksum { found, computed }, true)
    }
}
