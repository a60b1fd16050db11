//! Polhemus FASTRAK: ASCII and binary records (FASTRAK user manual, rev. G).
//!
//! Records of both formats begin with `'0'`, the station `'1'..='4'` and an error character (a space for no error).
//!
//! | format | output list | bytes | content |
//! |---|---|---|---|
//! | [`Format::Ascii`] | `2,4,1` | 47 | head, six fields of 7 characters: x y z (cm), azimuth, elevation, roll (degrees), CR LF |
//! | [`Format::Binary`] | `2,11,0` | 32 | head, f32 x y z (cm), f32 quaternion w x y z, a space; little-endian |
//!
//! A binary record has no checksum. It is checked by its head, its last byte and the norm of its quaternion.

use bytes::{Bytes, BytesMut};
use glam::{DQuat, DVec3, EulerRot};
use insonify_core::pose::{Pose, PoseError, Reading};
use thiserror::Error;

use super::decoder::{Offset, StreamDecoder};
use super::framing::{f32_at, next_head, noise};
use super::{DecodeError, Record};

/// Length of an ASCII record, bytes.
pub(crate) const ASCII_LENGTH: usize = 47;

/// Length of a binary record, bytes.
pub(crate) const BINARY_LENGTH: usize = 32;

const HEAD: usize = 3;
const FIELD: usize = 7;
const FIELDS: [&str; 6] = ["x", "y", "z", "azimuth", "elevation", "roll"];
const MM_PER_CM: f64 = 10.0;

/// Record format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Fixed-width text.
    Ascii,
    /// IEEE floats.
    Binary,
}

/// Fault of a record.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Reason {
    /// No record head.
    #[error("{length} bytes are no record; one starts with `0`, a station 1 to 4, and a space or a letter")]
    Noise {
        /// Number of bytes skipped.
        length: usize,
    },
    /// Error reported by the device.
    #[error("station {station} reports error `{code}`; the BIT table of the FASTRAK manual says what that is")]
    Device {
        /// Station, 1..=4.
        station: u16,
        /// The record's error character.
        code: char,
    },
    /// A binary record that doesn't end in a space.
    #[error("the record ends in {found:#04x} where a space must be; is the output list `2,11,0`?")]
    End {
        /// Byte found.
        found: u8,
    },
    /// A line of the wrong length.
    #[error("a line of {length} bytes; a record has {ASCII_LENGTH}; is the output list `2,4,1`?")]
    LineLength {
        /// Length including the line feed, or the number of bytes skipped.
        length: usize,
    },
    /// A field that is not a number.
    #[error("field `{name}` is `{text}`; it must be a decimal number in 7 characters")]
    Field {
        /// Name of the field.
        name: &'static str,
        /// Text found, escaped.
        text: String,
    },
    /// Numbers that are not a pose.
    #[error(transparent)]
    Pose(#[from] PoseError),
}

/// Decoder of one stream of records in centimetres.
#[derive(Debug, Clone)]
pub struct Decoder {
    format: Format,
    offset: Offset,
}

impl Decoder {
    /// A decoder at the start of a stream.
    pub fn new(format: Format) -> Self {
        Self { format, offset: Offset::default() }
    }

    fn binary(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        if buffer.is_empty() {
            return Ok(None);
        }
        if !plausible(buffer) {
            return match noise(buffer, HEAD, plausible) {
                Some(length) => Err(self.offset.reject(buffer, length, Reason::Noise { length })),
                None => Ok(None),
            };
        }
        let Some(frame) = buffer.get(..BINARY_LENGTH) else { return Ok(None) };
        match binary(frame) {
            Ok(record) => {
                self.offset.take(buffer, BINARY_LENGTH);
                Ok(Some(record))
            }
            Err(reason) => {
                // If the device reports an error, the record is complete nevertheless.
                let whole = matches!(reason, Reason::Device { .. });
                let length = if whole { BINARY_LENGTH } else { next_head(frame, plausible) };
                Err(self.offset.reject(buffer, length, reason))
            }
        }
    }

    fn line(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        let window = &buffer[..buffer.len().min(ASCII_LENGTH)];
        // Without a line feed, the bytes still count as one record, and the next record starts after them.
        let length = match window.iter().position(|&b| b == b'\n') {
            Some(at) => at + 1,
            None if window.len() == ASCII_LENGTH => ASCII_LENGTH,
            None => return Ok(None),
        };
        match text(&window[..length]) {
            Ok(record) => {
                self.offset.take(buffer, length);
                Ok(Some(record))
            }
            Err(reason) => Err(self.offset.reject(buffer, length, reason)),
        }
    }
}

impl StreamDecoder for Decoder {
    /// After `Ok(None)` the buffer holds less than 64 bytes.
    fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        match self.format {
            Format::Ascii => self.line(buffer),
            Format::Binary => self.binary(buffer),
        }
    }

    fn offset(&mut self) -> &mut Offset {
        &mut self.offset
    }
}

/// Whether `bytes` can be the start of a record.
fn plausible(bytes: &[u8]) -> bool {
    let third = |b: &u8| *b == b' ' || b.is_ascii_alphabetic();
    bytes.first().is_none_or(|b| *b == b'0')
        && bytes.get(1).is_none_or(|b| (b'1'..=b'4').contains(b))
        && bytes.get(2).is_none_or(third)
}

fn binary(frame: &[u8]) -> Result<Record, Reason> {
    match frame[BINARY_LENGTH - 1] {
        b' ' => {}
        found => return Err(Reason::End { found }),
    }
    let station = station(frame)?;
    let mut components = [0.0; 7];
    for (i, component) in components.iter_mut().enumerate() {
        *component = f32_at(frame, HEAD + 4 * i);
    }
    for centimetres in &mut components[..3] {
        *centimetres *= MM_PER_CM;
    }
    Ok(Record::new(station, Reading::Pose(Pose::from_components(components)?)))
}

fn text(line: &[u8]) -> Result<Record, Reason> {
    let length = line.len();
    if length != ASCII_LENGTH || !line.ends_with(b"\r\n") {
        return Err(Reason::LineLength { length });
    }
    if !plausible(line) {
        return Err(Reason::Noise { length });
    }
    let station = station(line)?;
    let mut values = [0.0_f64; FIELDS.len()];
    for ((value, name), field) in values.iter_mut().zip(FIELDS).zip(line[HEAD..].chunks_exact(FIELD)) {
        let number = std::str::from_utf8(field).ok().and_then(|text| text.trim().parse().ok());
        *value = number.ok_or_else(|| Reason::Field { name, text: field.escape_ascii().to_string() })?;
    }
    let [x, y, z, azimuth, elevation, roll] = values;
    let pose = Pose::new(DVec3::new(x, y, z) * MM_PER_CM, orientation(azimuth, elevation, roll))?;
    Ok(Record::new(station, Reading::Pose(pose)))
}

/// Station of a record that reports no error.
fn station(head: &[u8]) -> Result<u16, Reason> {
    let station = u16::from(head[1] - b'0');
    match head[2] {
        b' ' => Ok(station),
        code => Err(Reason::Device { station, code: char::from(code) }),
    }
}

/// Rotation by azimuth about z, then elevation about the new y, then roll about the new x, degrees.
pub(super) fn orientation(azimuth: f64, elevation: f64, roll: f64) -> DQuat {
    DQuat::from_euler(EulerRot::ZYX, azimuth.to_radians(), elevation.to_radians(), roll.to_radians())
}

/// Commands that make `stations` stream in `format`, in centimetres. Send them one by one, with a pause after each.
pub fn setup(format: Format, stations: &[u16], hemisphere: [f64; 3]) -> Vec<Bytes> {
    let [x, y, z] = hemisphere;
    let (list, letter) = match format {
        Format::Ascii => ("2,4,1", "F"),
        Format::Binary => ("2,11,0", "f"),
    };
    let on = stations.iter().map(|station| format!("l{station},1\r"));
    let of_stations =
        stations.iter().flat_map(|station| [format!("H{station},{x},{y},{z}\r"), format!("O{station},{list}\r")]);
    let commands = on.chain(["u".to_owned()]).chain(of_stations).chain([letter.to_owned(), "C".to_owned()]);
    commands.map(Bytes::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracker::Fault;
    use crate::tracker::decoder::decode_all;

    /// Binary record made with Python's `struct` from the layout in the manual: station 1, (10.5, −20.25, 30.125) cm,
    /// quaternion (0.5, 0.5, −0.5, 0.5).
    const BINARY: [u8; 32] = *b"01 \x00\x00\x28\x41\x00\x00\xa2\xc1\x00\x00\xf1\x41\x00\x00\x00\x3f\x00\x00\x00\x3f\
                                \x00\x00\x00\xbf\x00\x00\x00\x3f ";

    /// ASCII record written by hand like the manual's example: station 2, azimuth 90°.
    const LINE: &str = "02   10.50 -20.25  30.12  90.00   0.00   0.00\r\n";

    fn pose(record: Record) -> Pose {
        match record.reading {
            Reading::Pose(pose) => pose,
            other => panic!("no pose: {other:?}"),
        }
    }

    fn all(format: Format, bytes: &[u8]) -> Vec<Result<Record, Fault>> {
        decode_all(&mut Decoder::new(format), bytes)
    }

    #[test]
    fn bytes_that_wait_for_the_rest_of_a_record_are_few() {
        for format in [Format::Ascii, Format::Binary] {
            for bytes in [vec![b'1'; 500], [0, 0, 0x30].repeat(170), LINE.as_bytes()[..30].to_vec()] {
                let (mut decoder, mut buffer) = (Decoder::new(format), BytesMut::from(&bytes[..]));
                while !matches!(decoder.decode(&mut buffer), Ok(None)) {}
                assert!(buffer.len() < 64, "{} bytes of {}", buffer.len(), bytes.len());
            }
        }
    }

    #[test]
    fn a_binary_record_made_from_the_manual() {
        let found = all(Format::Binary, &BINARY);
        let record = found[0].clone().unwrap();
        assert_eq!((found.len(), record.sensor, record.sequence), (1, 1, None));
        assert_eq!(pose(record).components(), [105.0, -202.5, 301.25, 0.5, 0.5, -0.5, 0.5]);
    }

    #[test]
    fn an_ascii_record_in_the_manuals_format() {
        assert_eq!(LINE.len(), ASCII_LENGTH);
        let record = all(Format::Ascii, LINE.as_bytes())[0].clone().unwrap();
        assert_eq!(record.sensor, 2);
        let found = pose(record);
        assert!(found.position_mm.distance(DVec3::new(105.0, -202.5, 301.2)) < 1e-9);
        // Azimuth 90° turns the sensor's x axis to the source's y.
        assert!((found.orientation * DVec3::X).distance(DVec3::Y) < 1e-12);
    }

    #[test]
    fn angles_turn_about_z_then_y_then_x() {
        let expected = DQuat::from_rotation_z(0.3) * DQuat::from_rotation_y(-0.4) * DQuat::from_rotation_x(1.1);
        let found = orientation(0.3_f64.to_degrees(), -0.4_f64.to_degrees(), 1.1_f64.to_degrees());
        assert!(found.angle_between(expected) < 1e-7);
    }

    #[test]
    fn a_damaged_record_loses_only_itself() {
        for at in 0..BINARY_LENGTH {
            let mut stream = [BINARY; 4].concat();
            stream[BINARY_LENGTH + at] ^= 0x80;
            let good = all(Format::Binary, &stream).into_iter().filter(|r| r.as_ref().is_ok_and(|r| r.sensor == 1));
            assert!(good.count() >= 3, "byte {at}");
        }
        for at in 0..ASCII_LENGTH {
            let mut stream = LINE.repeat(4).into_bytes();
            stream[ASCII_LENGTH + at] = if at % 2 == 0 { b'\n' } else { 0xff };
            let good = all(Format::Ascii, &stream).into_iter().filter(Result::is_ok).count();
            assert!(good >= 3, "byte {at}: {good}");
        }
    }

    #[test]
    fn lost_bytes_lose_two_records_at_most() {
        for lost in 1..BINARY_LENGTH {
            let mut stream = [BINARY; 5].concat();
            stream.drain(BINARY_LENGTH + 3..BINARY_LENGTH + 3 + lost.min(BINARY_LENGTH - 3));
            let good = all(Format::Binary, &stream).into_iter().filter(Result::is_ok).count();
            assert!(good >= 4, "{lost} bytes lost: {good} records");
        }
    }

    #[test]
    fn errors_name_the_fault() {
        let mut broken = BINARY;
        broken[2] = b'a';
        assert_eq!(all(Format::Binary, &broken), [Err(Reason::Device { station: 1, code: 'a' }.into())]);
        let cases = [
            ("hello\r\n".to_owned(), "a line of 7 bytes; a record has 47"),
            (LINE.replace("90.00", "9O.00"), "field `azimuth` is `  9O.00`"),
            (LINE.replace("90.00", "  nan"), "field `azimuth`"),
            (LINE.replace("02 ", "05 "), "47 bytes are no record"),
            (LINE.replace("02 ", "02S"), "station 2 reports error `S`"),
        ];
        for (line, message) in cases {
            let text = all(Format::Ascii, line.as_bytes())[0].clone().unwrap_err().to_string();
            assert!(text.contains(message) || text.contains("pose component"), "{text}");
        }
        let mut decoder = Decoder::new(Format::Ascii);
        let mut rest = BytesMut::from(&LINE[..20]);
        assert_eq!(decoder.decode(&mut rest), Ok(None));
        let error = decoder.finish(&mut rest).unwrap_err();
        assert_eq!(error.to_string(), "byte 0 of the tracker's stream: the stream ends after 20 bytes of a record");
    }

    #[test]
    fn commands_end_with_streaming() {
        let text = |format| setup(format, &[2], [0.0, 0.0, 1.0]).concat();
        assert_eq!(text(Format::Binary), b"l2,1\ruH2,0,0,1\rO2,2,11,0\rfC");
        assert_eq!(text(Format::Ascii), b"l2,1\ruH2,0,0,1\rO2,2,4,1\rFC");
        let both = setup(Format::Ascii, &[1, 2], [0.0, 0.0, 1.0]).concat();
        assert_eq!(both, b"l1,1\rl2,1\ruH1,0,0,1\rO1,2,4,1\rH2,0,0,1\rO2,2,4,1\rFC");
    }
}
