//! Decoder of pose messages.

use std::collections::VecDeque;

use bytes::BytesMut;
use insonify_core::pose::{Pose, PoseError, Reading};

use super::Reason;
use super::message::{EXTENDED_HEAD, Field, HEAD, Head, TOOL, TRANSFORM, crc64, floats, pose_of_matrix, text};
use super::metadata::Metadata;
use crate::tracker::framing::next_head;
use crate::tracker::{DecodeError, Fault, Offset, Record, StreamDecoder};

/// Largest number of devices and tools per stream.
pub const NAMES_LIMIT: usize = 64;

/// Largest number of tools of a `TDATA` message.
const TOOLS_LIMIT: usize = 64;

/// Largest metadata of a message with a pose, bytes. A larger value indicates a damaged size.
const METADATA_LIMIT: u64 = 64 << 10;

/// Longest body that is skipped, bytes. A larger value indicates a damaged size; a colour image of 4096 × 4096 pixels
/// has 48 MiB.
const SKIP_LIMIT: u64 = 256 << 20;

/// Largest number of noise bytes that one error covers.
const COVERED: usize = 256;

/// Largest number of remembered types of skipped messages.
const SKIPPED_LIMIT: usize = 8;

/// Types of messages with poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Transform,
    Position,
    TrackingData,
}

impl Kind {
    fn of(kind: &Field<12>) -> Option<Self> {
        match kind {
            b"TRANSFORM\0\0\0" => Some(Self::Transform),
            b"POSITION\0\0\0\0" | b"QTRANS\0\0\0\0\0\0" => Some(Self::Position),
            b"TDATA\0\0\0\0\0\0\0" => Some(Self::TrackingData),
            _ => None,
        }
    }

    /// Checks the size of the message's content.
    fn check(self, size: u64) -> Result<(), Reason> {
        let tool = TOOL as u64;
        let (kind, is_right, expected) = match self {
            Self::Transform => ("TRANSFORM", size == TRANSFORM as u64, "48"),
            Self::Position => ("POSITION", matches!(size, 12 | 24 | 28), "12, 24 or 28"),
            Self::TrackingData => (
                "TDATA",
                size.is_multiple_of(tool) && size <= TOOLS_LIMIT as u64 * tool,
                "70 for each of at most 64 tools",
            ),
        };
        if is_right { Ok(()) } else { Err(Reason::Size { kind, found: size, expected }) }
    }
}

/// Decoder of one stream.
#[derive(Debug, Clone, Default)]
pub struct Decoder {
    offset: Offset,
    /// Number of remaining bytes of a skipped message.
    skip: u64,
    /// Stream offset of the last error, if no message was found since.
    lost: Option<u64>,
    /// Names of devices and tools, by number.
    names: Vec<(Field<20>, String)>,
    /// Types of skipped messages.
    skipped: Vec<Field<12>>,
    /// Records of the message at the front, each with its number of bytes.
    pending: VecDeque<(usize, Result<Record, Reason>)>,
}

/// A message at the front of the buffer.
struct Message {
    head: Head,
    kind: Kind,
    /// Range of the message's content in the buffer.
    content: std::ops::Range<usize>,
    /// Range of the metadata's header, which follows the content; keys and values follow it.
    metadata_header: std::ops::Range<usize>,
    length: usize,
}

enum Front {
    Part,
    Skip(u64, Field<12>),
    Message(Message),
    /// A damaged message: number of bytes up to the next possible message, and the fault.
    Damaged(usize, Reason),
    /// Bytes that are not a message: the first byte, and the number of bytes up to the next possible message.
    Noise(u8, usize),
}

impl StreamDecoder for Decoder {
    /// Each damaged message and every 256 bytes of noise give an error.
    fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        loop {
            if self.skip > 0 {
                let start = self.offset.take(buffer, usize::try_from(self.skip).unwrap_or(usize::MAX));
                self.skip -= self.offset.position() - start;
                if self.skip > 0 {
                    return Ok(None);
                }
            }
            if let Some((length, record)) = self.pending.pop_front() {
                let offset = self.offset.take(buffer, length);
                return record.map(Some).map_err(|reason| DecodeError { offset, fault: reason.into() });
            }
            match front(buffer) {
                Front::Part => return Ok(None),
                Front::Skip(length, kind) => {
                    self.skip = length;
                    self.lost = None;
                    if self.skipped.len() < SKIPPED_LIMIT && !self.skipped.contains(&kind) {
                        self.skipped.push(kind);
                    }
                }
                Front::Message(message) => {
                    self.lost = None;
                    if let Err(reason) = self.note(&message, buffer) {
                        return Err(self.offset.reject(buffer, message.length, reason));
                    }
                    if self.pending.is_empty() {
                        // No tool is in view.
                        self.offset.take(buffer, message.length);
                    }
                }
                Front::Damaged(length, reason) => {
                    self.lost = Some(self.offset.position());
                    return Err(self.offset.reject(buffer, length, reason));
                }
                Front::Noise(byte, length) => {
                    let position = self.offset.position();
                    let covered = self.lost.map_or(0, |from| (from + COVERED as u64).saturating_sub(position));
                    if covered == 0 {
                        self.lost = Some(position);
                        return Err(self.offset.reject(buffer, length.min(COVERED), Reason::Head { byte }));
                    }
                    // Removes only bytes that the last error covers, so that the next error doesn't depend on how the
                    // stream was split.
                    self.offset.take(buffer, length.min(covered as usize));
                }
            }
        }
    }

    fn offset(&mut self) -> &mut Offset {
        &mut self.offset
    }

    fn name_of(&self, sensor: u16) -> Option<&str> {
        self.names.get(usize::from(sensor)).map(|(_, name)| name.as_str())
    }

    fn skipped(&self) -> Option<String> {
        let kinds: Vec<String> = self.skipped.iter().map(|kind| text(kind)).collect();
        (!kinds.is_empty()).then(|| kinds.join(", "))
    }

    fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        self.pending.clear();
        match (buffer.len(), std::mem::take(&mut self.skip)) {
            (0, 0) => Ok(()),
            (length, _) => Err(self.offset.reject(buffer, length, Fault::Incomplete { length })),
        }
    }
}

impl Decoder {
    /// Queues the records of a message.
    ///
    /// # Errors
    /// Its metadata are inconsistent.
    fn note(&mut self, message: &Message, bytes: &[u8]) -> Result<(), Reason> {
        let header = message.metadata_header.clone();
        let metadata = Metadata::new(&bytes[header.clone()], &bytes[header.end..message.length])?;
        let content = message.content.clone();
        let (head, time_us) = (&message.head, message.head.time_us());
        match message.kind {
            Kind::Transform => {
                let pose = pose_of_matrix(bytes, content.start);
                self.note_pose(message.length, head.device, time_us, pose, metadata);
            }
            Kind::Position => {
                let [x, y, z] = floats(bytes, content.start);
                let [qx, qy, qz, qw] = match content.len() {
                    12 => [0.0, 0.0, 0.0, 1.0],
                    // The missing quaternion component is positive by convention.
                    24 => {
                        let [qx, qy, qz] = floats(bytes, content.start + 12);
                        [qx, qy, qz, (1.0 - qx * qx - qy * qy - qz * qz).max(0.0).sqrt()]
                    }
                    _ => floats(bytes, content.start + 12),
                };
                let pose = Pose::from_components([x, y, z, qw, qx, qy, qz]);
                self.note_pose(message.length, head.device, time_us, pose, metadata);
            }
            Kind::TrackingData => {
                let tools = content.len() / TOOL;
                let mut used = 0;
                for tool in 0..tools {
                    let start = content.start + tool * TOOL;
                    let mut name = Field::<20>::default();
                    name.copy_from_slice(&bytes[start..start + 20]);
                    let end = if tool + 1 == tools { message.length } else { start + TOOL };
                    let pose = pose_of_matrix(bytes, start + 22);
                    let name = if name[0] == 0 { head.device } else { name };
                    self.note_pose(end - used, name, time_us, pose, metadata);
                    used = end;
                }
            }
        }
        Ok(())
    }

    fn note_pose(
        &mut self,
        length: usize,
        mut name: Field<20>,
        device_time_us: Option<u64>,
        pose: Result<Pose, PoseError>,
        metadata: Metadata<'_>,
    ) {
        // Bytes after the first zero aren't part of the name.
        if let Some(end) = name.iter().position(|&b| b == 0) {
            name[end..].fill(0);
        }
        let record = self.number(name).and_then(|sensor| match pose {
            // The content of an invalid transform does not matter.
            _ if !metadata.is_valid(self.name_of(sensor).unwrap_or_default()) => {
                Ok(Record { device_time_us, ..Record::new(sensor, Reading::OutOfView) })
            }
            Ok(pose) => Ok(Record { device_time_us, ..Record::new(sensor, Reading::Pose(pose)) }),
            Err(source) => Err(Reason::Pose { name: text(&name), source }),
        });
        self.pending.push_back((length, record));
    }

    fn number(&mut self, name: Field<20>) -> Result<u16, Reason> {
        let known = self.names.iter().position(|(known, _)| *known == name);
        let number = known.unwrap_or(self.names.len());
        if number >= NAMES_LIMIT {
            return Err(Reason::TooManyNames { name: text(&name) });
        }
        if known.is_none() {
            self.names.push((name, text(&name)));
        }
        Ok(number as u16)
    }
}

/// Inspects the front of `buffer`. Bytes after a valid message do not affect the result.
fn front(buffer: &[u8]) -> Front {
    if !may_be_head(buffer) {
        return buffer.first().map_or(Front::Part, |&byte| Front::Noise(byte, next_head(buffer, may_be_head)));
    }
    let Some(head) = Head::read(buffer) else { return Front::Part };
    let Some(kind) = Kind::of(&head.kind) else {
        return Front::Skip(HEAD as u64 + head.body_size, head.kind);
    };
    // The size in the head is damaged: the next message may begin anywhere after the head.
    let wrong = |reason| Front::Damaged(next_head(buffer, may_be_head).min(COVERED), reason);
    let mut content_size = head.body_size;
    let mut content_start = HEAD;
    let mut header_size = 0;
    if head.version >= 2 {
        let Some(extended) = buffer.get(HEAD..HEAD + EXTENDED_HEAD) else { return Front::Part };
        let [e0, e1, h0, h1, m0, m1, m2, m3, ..] = *extended else { return Front::Part };
        let size = u64::from(u16::from_be_bytes([e0, e1]));
        header_size = usize::from(u16::from_be_bytes([h0, h1]));
        let parts = size + header_size as u64 + u64::from(u32::from_be_bytes([m0, m1, m2, m3]));
        if size != EXTENDED_HEAD as u64 || parts > head.body_size || parts > METADATA_LIMIT {
            return wrong(Reason::ExtendedHeader { parts, body: head.body_size });
        }
        content_size -= parts;
        content_start += EXTENDED_HEAD;
    }
    // Checked before waiting for the body: a damaged size must not skip the following messages.
    if let Err(reason) = kind.check(content_size) {
        return wrong(reason);
    }
    // The sum cannot overflow, because all sizes were checked against their limits.
    let length = HEAD + head.body_size as usize;
    let Some(body) = buffer.get(HEAD..length) else { return Front::Part };
    let computed = crc64(body);
    // A CRC of 0 means that the sender computes none.
    if computed != head.crc && head.crc != 0 {
        // A message that lost bytes contains the start of the next message.
        let next = next_head(&buffer[..length], |bytes| bytes.len() > 2 && may_be_head(bytes));
        return Front::Damaged(next, Reason::Checksum { found: head.crc, computed });
    }
    let content = content_start..content_start + content_size as usize;
    let metadata_header = content.end..content.end + header_size;
    Front::Message(Message { head, kind, content, metadata_header, length })
}

/// Whether `bytes` can be the start of a header: a version, a type of printable characters padded with zeros, a size.
fn may_be_head(bytes: &[u8]) -> bool {
    let byte_is = |at: usize, right: &dyn Fn(u8) -> bool| bytes.get(at).is_none_or(|&b| right(b));
    if !(byte_is(0, &|b| b == 0) && byte_is(1, &|b| (1..=3).contains(&b)) && byte_is(2, &|b| b.is_ascii_uppercase())) {
        return false;
    }
    let kind = &bytes[bytes.len().min(2)..bytes.len().min(14)];
    let length = kind.iter().position(|&b| b == 0).unwrap_or(kind.len());
    let is_kind = kind[..length].iter().all(|&b| b.is_ascii_uppercase() || b.is_ascii_digit() || b == b'_');
    let is_filled = kind[length..].iter().all(|&b| b == 0);
    let has_size = Head::read(bytes).is_none_or(|head| head.body_size <= SKIP_LIMIT);
    is_kind && is_filled && has_size
}
