//! insonify's own line format for hobby boards: `P,seq,t_us,x,y,z,qw,qx,qy,qz*HH\n`.
//!
//! | field | meaning |
//! |---|---|
//! | `P` | sensor 0; `P1` is sensor 1, and so on up to `P65535` |
//! | `seq` | counter, 0..2³², incremented per line |
//! | `t_us` | clock of the board, µs, 0..2⁶⁴ |
//! | `x,y,z` | position, mm |
//! | `qw,qx,qy,qz` | unit quaternion |
//! | `HH` | xor of all bytes between `P` and `*`, two hexadecimal digits |
//!
//! A line may end in CR LF. Numbers may be padded by spaces, and empty lines are skipped.

use bytes::BytesMut;
use insonify_core::pose::{Pose, PoseError};
use thiserror::Error;

use super::decoder::{Offset, StreamDecoder};
use super::framing::quote;
use super::{DecodeError, Fault, Record};

/// Longest line without its line feed, bytes.
pub const LINE_LIMIT: usize = 256;

/// Largest number of digits of a sensor's number.
const SENSOR_DIGITS: usize = 5;

const FIELDS: [&str; 9] = ["seq", "t_us", "x", "y", "z", "qw", "qx", "qy", "qz"];

/// Fault of a line.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Reason {
    /// No line feed within the limit.
    #[error("a line is longer than {LINE_LIMIT} bytes; it must be `P,seq,t_us,x,y,z,qw,qx,qy,qz*HH` and a line feed")]
    TooLong,
    /// Another kind of line, or noise.
    #[error("a line starts with `{start}`; it must start with `P,`, or with `P1,` for sensor 1")]
    NotAPose {
        /// First bytes of the line, escaped.
        start: String,
    },
    /// No checksum.
    #[error("a line has no checksum; it must end in `*` and two hexadecimal digits")]
    ChecksumMissing,
    /// A checksum that is not two hexadecimal digits.
    #[error("a line has the checksum `{text}`; it must be two hexadecimal digits")]
    ChecksumSyntax {
        /// Text after the `*`, escaped.
        text: String,
    },
    /// Bytes damaged in transmission.
    #[error(
        "a line has the checksum {found:02X}, but its bytes give {computed:02X}; it is the xor of all characters between `P` and `*`, both left out"
    )]
    ChecksumMismatch {
        /// Checksum on the line.
        found: u8,
        /// Xor of the bytes between `P` and `*`.
        computed: u8,
    },
    /// Too few or too many fields.
    #[error(
        "a line has {found} fields after `P`; there must be 9: seq,t_us,x,y,z,qw,qx,qy,qz (numbers have a decimal point, no comma)"
    )]
    FieldCount {
        /// Number of fields found.
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
#[derive(Debug, Clone, Default)]
pub struct Decoder {
    offset: Offset,
    /// Whether the rest of an overlong line is being skipped.
    skipping: bool,
}

impl StreamDecoder for Decoder {
    /// After `Ok(None)` the buffer holds at most [`LINE_LIMIT`] bytes.
    fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        loop {
            if self.skipping {
                let line_feed = buffer.iter().position(|&b| b == b'\n');
                self.offset.take(buffer, line_feed.map_or(buffer.len(), |at| at + 1));
                if line_feed.is_none() {
                    return Ok(None);
                }
                self.skipping = false;
            }
            // Search only up to the limit, so the result doesn't depend on how the stream was split.
            let Some(length) = buffer.iter().take(LINE_LIMIT + 1).position(|&b| b == b'\n') else {
                if buffer.len() <= LINE_LIMIT {
                    return Ok(None);
                }
                self.skipping = true;
                return Err(self.offset.reject(buffer, LINE_LIMIT + 1, Reason::TooLong));
            };
            let line = &buffer[..length];
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            let record = (!line.is_empty()).then(|| parse(line));
            let offset = self.offset.take(buffer, length + 1);
            if let Some(record) = record {
                return record.map(Some).map_err(|reason| DecodeError { offset, fault: reason.into() });
            }
        }
    }

    fn offset(&mut self) -> &mut Offset {
        &mut self.offset
    }

    fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        let skipping = std::mem::take(&mut self.skipping);
        match buffer.len() {
            length if length == 0 || skipping => {
                self.offset.take(buffer, length);
                Ok(())
            }
            length => Err(self.offset.reject(buffer, length, Fault::Incomplete { length })),
        }
    }
}

/// Fault of the last complete line in `text` that starts with `P,`. `None` if there is no such line, or if it is a
/// valid record.
#[cfg(feature = "live")]
pub(super) fn fault_of_last(text: &[u8]) -> Option<Reason> {
    let whole = &text[..text.iter().rposition(|&b| b == b'\n')?];
    // The first line may be incomplete.
    let lines = whole.split(|&b| b == b'\n').skip(1).map(|line| line.strip_suffix(b"\r").unwrap_or(line));
    parse(lines.filter(|line| line.starts_with(b"P,")).last()?).err()
}

fn parse(line: &[u8]) -> Result<Record, Reason> {
    let not_a_pose = || Reason::NotAPose { start: quote(line) };
    let body = line.strip_prefix(b"P").ok_or_else(not_a_pose)?;
    let comma = body.iter().take(SENSOR_DIGITS + 1).position(|&b| b == b',').ok_or_else(not_a_pose)?;
    let sensor = sensor_of(&body[..comma]).ok_or_else(not_a_pose)?;
    let star = body.iter().position(|&b| b == b'*').ok_or(Reason::ChecksumMissing)?;
    let (body, digits) = (&body[..star], &body[star + 1..]);
    check(body, digits)?;
    let mut fields = [&b""[..]; FIELDS.len()];
    let mut found = 0;
    for field in body[comma + 1..].split(|&b| b == b',') {
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
    Ok(Record { sensor, ..Record::pose(sequence, device_time_us, Pose::from_components(components)?) })
}

/// Number of the sensor from the digits after the `P`; `None` if they are no number of a sensor.
fn sensor_of(digits: &[u8]) -> Option<u16> {
    if digits.is_empty() {
        return Some(0);
    }
    std::str::from_utf8(digits).ok().filter(|text| text.bytes().all(|b| b.is_ascii_digit()))?.parse().ok()
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

/// Line of a pose, including the line feed; positions are rounded to 0.1 µm, quaternions to 1e-8.
pub fn encode(sequence: u32, device_time_us: u64, pose: &Pose) -> String {
    encode_of(0, sequence, device_time_us, pose)
}

/// As [`encode`], for the sensor with the number `sensor`.
pub fn encode_of(sensor: u16, sequence: u32, device_time_us: u64, pose: &Pose) -> String {
    let [x, y, z, qw, qx, qy, qz] = pose.components();
    let sensor = if sensor == 0 { String::new() } else { sensor.to_string() };
    let body = format!("{sensor},{sequence},{device_time_us},{x:.4},{y:.4},{z:.4},{qw:.8},{qx:.8},{qy:.8},{qz:.8}");
    format!("P{body}*{:02X}\n", xor(body.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracker::decoder::decode_all;

    const LINE: &str = "P,7,1000,1.5,-2,80.25,1,0,0,0*0F\n";

    fn decode(text: &str) -> Vec<Result<Record, Fault>> {
        decode_all(&mut Decoder::default(), text.as_bytes())
    }

    fn sealed(body: &str) -> String {
        format!("P{body}*{:02X}\n", xor(body.as_bytes()))
    }

    #[test]
    fn decodes_a_line_checked_by_hand() {
        let pose = Pose::from_components([1.5, -2.0, 80.25, 1.0, 0.0, 0.0, 0.0]).unwrap();
        let record = Record::pose(7, 1000, pose);
        assert_eq!(decode(LINE), [Ok(record)]);
        let padded = sealed(", 7,1000, 1.50,-2,80.25,1,0,0,0").replace('\n', "\r\n");
        assert_eq!(decode(&format!("\r\n\n{padded}")), [Ok(record)]);
    }

    #[test]
    fn the_number_after_the_letter_is_the_sensor() {
        let pose = Pose::from_components([1.5, -2.0, 80.25, 1.0, 0.0, 0.0, 0.0]).unwrap();
        for sensor in [0, 1, 12, u16::MAX] {
            let record = Record { sensor, ..Record::pose(7, 1000, pose) };
            assert_eq!(decode(&encode_of(sensor, 7, 1000, &pose)), [Ok(record)]);
        }
        for start in ["65536", "123456", "+1", " 1", "x"] {
            let line = sealed(&format!("{start},7,1000,1.5,-2,80.25,1,0,0,0"));
            let [Err(Fault::AsciiLine(Reason::NotAPose { .. }))] = decode(&line)[..] else { panic!("{line}") };
        }
    }

    #[test]
    fn a_checksum_is_required_and_checked() {
        let cases = [
            (LINE.replace("*0F", ""), Reason::ChecksumMissing),
            (LINE.replace("1.5", "1.6"), Reason::ChecksumMismatch { found: 0x0F, computed: 0x0C }),
            (LINE.replace("*0F", "*0"), Reason::ChecksumSyntax { text: "0".into() }),
            (LINE.replace("*0F", "*+6"), Reason::ChecksumSyntax { text: "+6".into() }),
        ];
        for (line, reason) in cases {
            assert_eq!(decode(&line), [Err(reason.into())]);
        }
    }

    #[test]
    fn wrong_lines_are_named_and_the_next_line_is_decoded() {
        let cases = [
            ("hello\n".to_owned(), "a line starts with `hello`; it must start with `P,`"),
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
            let mut decoder = Decoder::default();
            assert!(decoder.decode(&mut buffer).unwrap().is_some());
            let text = decoder.decode(&mut buffer).unwrap_err().to_string();
            assert!(text.starts_with("byte 33 of the tracker's stream: ") && text.contains(message), "{text}");
            assert!(decoder.decode(&mut buffer).unwrap().is_some(), "no record after {bad:?}");
            assert_eq!(decoder.decode(&mut buffer), Ok(None));
            assert!(buffer.is_empty());
        }
    }

    #[test]
    fn an_end_within_a_line_is_an_error() {
        let mut buffer = BytesMut::from(&LINE[..12]);
        let mut decoder = Decoder::default();
        assert_eq!(decoder.decode(&mut buffer), Ok(None));
        let error = decoder.finish(&mut buffer).unwrap_err();
        assert_eq!(error, DecodeError { offset: 0, fault: Fault::Incomplete { length: 12 } });
        assert_eq!(decoder.finish(&mut buffer), Ok(()));
    }
}
