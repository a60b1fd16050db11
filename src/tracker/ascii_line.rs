//! insonify's own line format for hobby boards: `P,seq,t_us,x,y,z,qw,qx,qy,qz*HH\n`.
//!
//! | field | meaning |
//! |---|---|
//! | `seq` | counter, 0..2³², rises by one each line |
//! | `t_us` | clock of the board, µs, 0..2⁶⁴ |
//! | `x,y,z` | position, mm |
//! | `qw,qx,qy,qz` | unit quaternion |
//! | `HH` | xor of all bytes between `P` and `*`, two hexadecimal digits |
//!
//! A line may end in CR LF. Numbers may be padded by spaces, and empty lines are skipped.

use bytes::{Buf, BytesMut};
use thiserror::Error;

use super::Record;
use crate::pose::{Pose, PoseError};

/// Longest line without its line feed, bytes.
pub const LINE_LIMIT: usize = 256;

/// Most characters of a wrong field that an error message quotes.
const QUOTE_LIMIT: usize = 32;

const FIELDS: [&str; 9] = ["seq", "t_us", "x", "y", "z", "qw", "qx", "qy", "qz"];

/// Whether a line needs its `*HH`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Checksum {
    /// A line without a checksum is an error.
    Required,
    /// A line without a checksum is accepted; a wrong checksum is still an error.
    Optional,
}

/// A line that is not a record.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("line at byte {offset} of the tracker's stream: {reason}")]
pub struct DecodeError {
    /// Stream offset of the first byte of the line.
    pub offset: u64,
    /// Fault of the line.
    pub reason: Reason,
}

/// Fault of a line.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Reason {
    /// No line feed within the limit.
    #[error("longer than {LINE_LIMIT} bytes; a line is `P,seq,t_us,x,y,z,qw,qx,qy,qz*HH` and a line feed")]
    TooLong,
    /// The stream ended within the line.
    #[error("the stream ends after {length} bytes of it, before its line feed")]
    Incomplete {
        /// Bytes present.
        length: usize,
    },
    /// Another kind of line, or noise.
    #[error("starts with `{start}`; a line starts with `P,`")]
    NotAPose {
        /// First bytes of the line, escaped.
        start: String,
    },
    /// No checksum.
    #[error("has no checksum; it must end in `*` and two hexadecimal digits")]
    ChecksumMissing,
    /// A checksum that is not two hexadecimal digits.
    #[error("has the checksum `{text}`; it must be two hexadecimal digits")]
    ChecksumSyntax {
        /// Text behind the `*`, escaped.
        text: String,
    },
    /// Bytes damaged in transmission.
    #[error("has the checksum {found:02X}, but its bytes give {computed:02X}")]
    ChecksumMismatch {
        /// Checksum on the line.
        found: u8,
        /// Xor of the bytes between `P` and `*`.
        computed: u8,
    },
    /// Too few or too many fields.
    #[error("has {found} fields after `P`; there must be 9: seq,t_us,x,y,z,qw,qx,qy,qz")]
    FieldCount {
        /// Fields found.
        found: usize,
    },
    /// A field that is not a number of the right kind.
    #[error("field `{name}` is `{text}`; it must be {expected}")]
    Field {
        /// Name of the field.
        name: &'static str,
        /// Text found, escaped.
        text: String,
        /// Accepted values.
        expected: &'static str,
    },
    /// Nine numbers that are not a pose.
    #[error(transparent)]
    Pose(#[from] PoseError),
}

/// Decoder of one stream of lines.
#[derive(Debug, Clone)]
pub struct Decoder {
    checksum: Checksum,
    /// Bytes removed from the stream so far.
    offset: u64,
    /// Whether the rest of an overlong line is being skipped.
    skipping: bool,
}

impl Decoder {
    /// A decoder at the start of a stream.
    pub fn new(checksum: Checksum) -> Self {
        Self { checksum, offset: 0, skipping: false }
    }

    /// Takes the next record from the front of `buffer`; `Ok(None)` asks for more bytes.
    ///
    /// Every `Ok(Some(_))` and every error removes at least one byte. After `Ok(None)` the buffer holds at most
    /// [`LINE_LIMIT`] bytes.
    ///
    /// # Errors
    /// A line that is not a record. It is removed, and the next call continues with the next line.
    pub fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        loop {
            if self.skipping {
                let line_feed = buffer.iter().position(|&b| b == b'\n');
                self.remove(buffer, line_feed.map_or(buffer.len(), |at| at + 1));
                if line_feed.is_none() {
                    return Ok(None);
                }
                self.skipping = false;
            }
            let offset = self.offset;
            // Searched up to the limit only, so that the result doesn't depend on how the stream was split.
            let Some(length) = buffer.iter().take(LINE_LIMIT + 1).position(|&b| b == b'\n') else {
                if buffer.len() <= LINE_LIMIT {
                    return Ok(None);
                }
                self.skipping = true;
                self.remove(buffer, LINE_LIMIT + 1);
                return Err(DecodeError { offset, reason: Reason::TooLong });
            };
            let line = buffer.split_to(length);
            buffer.advance(1);
            self.offset += length as u64 + 1;
            let line = line.strip_suffix(b"\r").unwrap_or(&line);
            if !line.is_empty() {
                return parse(line, self.checksum).map(Some).map_err(|reason| DecodeError { offset, reason });
            }
        }
    }

    /// Ends the stream.
    ///
    /// # Errors
    /// A line without a line feed is left over. It is removed.
    pub fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        let (offset, length) = (self.offset, buffer.len());
        self.remove(buffer, length);
        if length == 0 || std::mem::take(&mut self.skipping) {
            return Ok(());
        }
        Err(DecodeError { offset, reason: Reason::Incomplete { length } })
    }

    fn remove(&mut self, buffer: &mut BytesMut, length: usize) {
        buffer.advance(length);
        self.offset += length as u64;
    }
}

fn parse(line: &[u8], checksum: Checksum) -> Result<Record, Reason> {
    let Some(body) = line.strip_prefix(b"P").filter(|body| body.starts_with(b",")) else {
        return Err(Reason::NotAPose { start: quote(line) });
    };
    let body = match body.iter().position(|&b| b == b'*') {
        Some(star) => {
            check(&body[..star], &body[star + 1..])?;
            &body[..star]
        }
        None if checksum == Checksum::Optional => body,
        None => return Err(Reason::ChecksumMissing),
    };
    let mut fields = [&b""[..]; FIELDS.len()];
    let mut found = 0;
    for field in body[1..].split(|&b| b == b',') {
        if let Some(slot) = fields.get_mut(found) {
            *slot = field.trim_ascii();
        }
        found += 1;
    }
    if found != FIELDS.len() {
        return Err(Reason::FieldCount { found });
    }
    let sequence = number(fields[0], FIELDS[0], "a whole number in 0..=4294967295")?;
    let device_time_us = number(fields[1], FIELDS[1], "a whole number of microseconds")?;
    let mut components = [0.0; 7];
    for (i, component) in components.iter_mut().enumerate() {
        *component = number(fields[i + 2], FIELDS[i + 2], "a decimal number")?;
    }
    Ok(Record::pose(sequence, device_time_us, Pose::from_components(components)?))
}

fn check(body: &[u8], digits: &[u8]) -> Result<(), Reason> {
    let digits = digits.trim_ascii_end();
    let found = match digits {
        [a, b] if a.is_ascii_hexdigit() && b.is_ascii_hexdigit() => {
            std::str::from_utf8(digits).ok().and_then(|text| u8::from_str_radix(text, 16).ok())
        }
        _ => None,
    };
    let found = found.ok_or_else(|| Reason::ChecksumSyntax { text: quote(digits) })?;
    let computed = xor(body);
    if found == computed { Ok(()) } else { Err(Reason::ChecksumMismatch { found, computed }) }
}

fn number<T: std::str::FromStr>(field: &[u8], name: &'static str, expected: &'static str) -> Result<T, Reason> {
    let parsed = std::str::from_utf8(field).ok().and_then(|text| text.parse().ok());
    parsed.ok_or_else(|| Reason::Field { name, text: quote(field), expected })
}

fn xor(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum ^ byte)
}

fn quote(bytes: &[u8]) -> String {
    let more = if bytes.len() > QUOTE_LIMIT { "..." } else { "" };
    format!("{}{more}", bytes[..bytes.len().min(QUOTE_LIMIT)].escape_ascii())
}

/// Line of a pose, line feed included: positions to 0.1 µm, quaternions to 1e-8, as a board would print them.
pub fn encode(sequence: u32, device_time_us: u64, pose: &Pose) -> String {
    let [x, y, z, qw, qx, qy, qz] = pose.components();
    let body = format!(",{sequence},{device_time_us},{x:.4},{y:.4},{z:.4},{qw:.8},{qx:.8},{qy:.8},{qz:.8}");
    format!("P{body}*{:02X}\n", xor(body.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: &str = "P,7,1000,1.5,-2,80.25,1,0,0,0*0F\n";

    fn first(text: &str, checksum: Checksum) -> Result<Option<Record>, DecodeError> {
        Decoder::new(checksum).decode(&mut BytesMut::from(text))
    }

    fn reason(text: &str) -> Reason {
        first(text, Checksum::Required).unwrap_err().reason
    }

    #[test]
    fn decodes_a_line_checked_by_hand() {
        let record = first(LINE, Checksum::Required).unwrap().unwrap();
        let pose = Pose::from_components([1.5, -2.0, 80.25, 1.0, 0.0, 0.0, 0.0]).unwrap();
        assert_eq!(record, Record::pose(7, 1000, pose));
        let padded = "\r\n\nP, 7,1000, 1.50,-2,80.25,1,0,0,0\r\n";
        assert_eq!(first(padded, Checksum::Optional).unwrap(), Some(record));
    }

    #[test]
    fn a_checksum_may_be_optional_but_never_wrong() {
        let bare = "P,7,1000,1.5,-2,80.25,1,0,0,0\n";
        assert_eq!(reason(bare), Reason::ChecksumMissing);
        assert!(first(bare, Checksum::Optional).unwrap().is_some());
        for checksum in [Checksum::Required, Checksum::Optional] {
            let error = first(&LINE.replace("1.5", "1.6"), checksum).unwrap_err();
            assert_eq!(error.reason, Reason::ChecksumMismatch { found: 0x0F, computed: 0x0C });
        }
        assert_eq!(reason(&LINE.replace("*0F", "*0")), Reason::ChecksumSyntax { text: "0".into() });
        assert_eq!(reason(&LINE.replace("*0F", "*+6")), Reason::ChecksumSyntax { text: "+6".into() });
    }

    #[test]
    fn wrong_lines_are_named_and_the_next_line_is_decoded() {
        let sealed = |body: &str| format!("P{body}*{:02X}\n", xor(body.as_bytes()));
        let cases = [
            ("hello\n".to_owned(), "starts with `hello`; a line starts with `P,`"),
            ("\u{1}\u{7f}P,\n".to_owned(), "starts with `\\x01\\x7fP,`"),
            (sealed(",1,2,3"), "has 3 fields after `P`; there must be 9"),
            (sealed(",1,2,3,4,5,1,0,0,0,0"), "has 10 fields"),
            (sealed(",-1,2,3,4,5,1,0,0,0"), "field `seq` is `-1`; it must be a whole number in 0..=4294967295"),
            (sealed(",1,2,3,4x,5,1,0,0,0"), "field `y` is `4x`; it must be a decimal number"),
            (sealed(",1,2,NaN,4,5,1,0,0,0"), "pose component `x` is NaN"),
            (sealed(",1,2,3,4,5,0.9,0,0,0"), "has norm 0.900000; it must be 1"),
            (format!("P,{}\n", "9".repeat(400)), "longer than 256 bytes"),
        ];
        for (bad, message) in cases {
            let mut buffer = BytesMut::from(format!("{LINE}{bad}{LINE}").as_str());
            let mut decoder = Decoder::new(Checksum::Required);
            assert!(decoder.decode(&mut buffer).unwrap().is_some());
            let text = decoder.decode(&mut buffer).unwrap_err().to_string();
            assert!(text.starts_with("line at byte 33 of the tracker's stream: ") && text.contains(message), "{text}");
            assert!(decoder.decode(&mut buffer).unwrap().is_some(), "no record after {bad:?}");
            assert_eq!(decoder.decode(&mut buffer), Ok(None));
            assert!(buffer.is_empty());
        }
    }

    #[test]
    fn an_end_within_a_line_is_an_error() {
        let mut buffer = BytesMut::from(&LINE[..12]);
        let mut decoder = Decoder::new(Checksum::Required);
        assert_eq!(decoder.decode(&mut buffer), Ok(None));
        let error = decoder.finish(&mut buffer).unwrap_err();
        assert_eq!(error, DecodeError { offset: 0, reason: Reason::Incomplete { length: 12 } });
        assert_eq!(decoder.finish(&mut buffer), Ok(()));
    }
}
