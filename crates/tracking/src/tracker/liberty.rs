//! Polhemus LIBERTY and PATRIOT: binary frames.
//!
//! | offset | field |
//! |---|---|
//! | 0..2 | `LY` (LIBERTY) or `PA` (PATRIOT) |
//! | 2 | u8 station, from 1 |
//! | 3 | u8 command that requested the frame; `C` for streamed frames |
//! | 4 | u8 error; 0 or a space if there is none |
//! | 5 | reserved |
//! | 6..8 | u16 length of the payload |
//! | 8.. | the items of the output list, little-endian |
//!
//! insonify requests [`OUTPUT_LIST`]: the device's clock (ms), its frame counter, the distortion level, x y z (cm) and
//! the quaternion w x y z, 40 bytes. A frame has no checksum. It is checked by its head and the norm of its quaternion.

use bytes::{Bytes, BytesMut};
use glam::{DQuat, DVec3};
use insonify_core::pose::{Pose, PoseError, Reading};
use thiserror::Error;

use super::decoder::{Offset, StreamDecoder};
use super::framing::{f32_at, next_head, noise, u32_at};
use super::{DecodeError, Record};

/// Output list that the driver requests.
pub const OUTPUT_LIST: &[Item] =
    &[Item::Timestamp, Item::FrameCount, Item::Distortion, Item::ExtendedPosition, Item::Quaternion];

const HEAD: usize = 8;
const MM_PER_CM: f64 = 10.0;

/// Device type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Device {
    /// Up to 16 stations, 240 Hz.
    Liberty,
    /// Up to 2 stations, 60 Hz.
    Patriot,
}

impl Device {
    fn tag(self) -> [u8; 2] {
        match self {
            Self::Liberty => *b"LY",
            Self::Patriot => *b"PA",
        }
    }

    /// Largest number of stations.
    pub fn stations(self) -> u16 {
        match self {
            Self::Liberty => 16,
            Self::Patriot => 2,
        }
    }
}

/// One item of an output list, documented by its number and content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Item {
    /// 1: CR LF.
    LineEnd = 1,
    /// 2: x y z, 3 × f32.
    Position = 2,
    /// 3: as [`Item::Position`], with extended precision in ASCII; also 3 × f32.
    ExtendedPosition = 3,
    /// 4: azimuth, elevation, roll, 3 × f32, degrees.
    Angles = 4,
    /// 7: quaternion w x y z, 4 × f32.
    Quaternion = 7,
    /// 8: u32, ms.
    Timestamp = 8,
    /// 9: u32.
    FrameCount = 9,
    /// 11: i32; 0 if no metal is near.
    Distortion = 11,
}

impl Item {
    fn length(self) -> usize {
        match self {
            Self::LineEnd => 2,
            Self::Timestamp | Self::FrameCount | Self::Distortion => 4,
            Self::Position | Self::ExtendedPosition | Self::Angles => 12,
            Self::Quaternion => 16,
        }
    }
}

/// Fault of a frame.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Reason {
    /// No frame head.
    #[error("{length} bytes are no frame; one starts with `{expected}` and the number of a station")]
    Noise {
        /// Number of bytes skipped.
        length: usize,
        /// Tag of the device.
        expected: String,
    },
    /// Error reported by the device.
    #[error("station {station} reports error {code} to command `{command}`: {meaning}")]
    Device {
        /// Station.
        station: u16,
        /// Command that requested the frame.
        command: char,
        /// Error code, shown as a character where possible.
        code: String,
        /// Meaning of the code.
        meaning: &'static str,
    },
    /// A payload of the wrong length.
    #[error("a payload of {found} bytes; the output list gives {expected}")]
    Length {
        /// Length of the payload in the head, bytes.
        found: usize,
        /// Length of the payload according to the output list, bytes.
        expected: usize,
    },
    /// Numbers that are not a pose.
    #[error(transparent)]
    Pose(#[from] PoseError),
}

/// Decoder of one stream of frames in centimetres.
#[derive(Debug, Clone)]
pub struct Decoder {
    device: Device,
    items: &'static [Item],
    payload: usize,
    offset: Offset,
}

impl Decoder {
    /// A decoder at the start of a stream of [`OUTPUT_LIST`].
    pub fn new(device: Device) -> Self {
        Self::with_items(device, OUTPUT_LIST)
    }

    /// A decoder of frames with another output list. Without an orientation item, orientations are the identity.
    pub(crate) fn with_items(device: Device, items: &'static [Item]) -> Self {
        Self { device, items, payload: items.iter().map(|item| item.length()).sum(), offset: Offset::default() }
    }

    fn record(&self, frame: &[u8]) -> Result<Record, Reason> {
        let mut record = Record::new(u16::from(frame[2]), Reading::OutOfView);
        let (mut position_cm, mut orientation) = (DVec3::ZERO, DQuat::IDENTITY);
        let mut at = HEAD;
        for item in self.items {
            let number = |i: usize| f32_at(frame, at + 4 * i);
            match item {
                Item::Position | Item::ExtendedPosition => position_cm = DVec3::new(number(0), number(1), number(2)),
                Item::Quaternion => orientation = DQuat::from_xyzw(number(1), number(2), number(3), number(0)),
                Item::Angles => orientation = super::fastrak::orientation(number(0), number(1), number(2)),
                Item::Timestamp => record.device_time_us = Some(u64::from(u32_at(frame, at)) * 1000),
                Item::FrameCount => record.sequence = Some(u32_at(frame, at)),
                Item::Distortion | Item::LineEnd => {}
            }
            at += item.length();
        }
        record.reading = Reading::Pose(Pose::new(position_cm * MM_PER_CM, orientation)?);
        Ok(record)
    }
}

impl StreamDecoder for Decoder {
    /// After `Ok(None)` the buffer holds less than a frame or 64 bytes.
    fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        loop {
            if buffer.is_empty() {
                return Ok(None);
            }
            let device = self.device;
            let plausible = |bytes: &[u8]| plausible(device, bytes);
            if !plausible(buffer) {
                return match noise(buffer, HEAD, plausible) {
                    Some(length) => {
                        let expected = device.tag().escape_ascii().to_string();
                        Err(self.offset.reject(buffer, length, Reason::Noise { length, expected }))
                    }
                    None => Ok(None),
                };
            }
            let Some(head) = buffer.get(..HEAD) else { return Ok(None) };
            let payload = usize::from(u16::from_le_bytes([head[6], head[7]]));
            let streamed = matches!(head[3], b'C' | b'P');
            let is_ok = matches!(head[4], 0 | b' ');
            if !streamed || payload != self.payload {
                // The length in an answer isn't trusted: if it is damaged, it would skip intact frames.
                let (length, reason) = match (is_ok, streamed) {
                    (false, _) => (HEAD, report(head)),
                    (true, true) => {
                        let reason = Reason::Length { found: payload, expected: self.payload };
                        (next_head(head, plausible), reason)
                    }
                    (true, false) => {
                        self.offset.take(buffer, HEAD);
                        continue;
                    }
                };
                return Err(self.offset.reject(buffer, length, reason));
            }
            let Some(frame) = buffer.get(..HEAD + payload) else { return Ok(None) };
            if !is_ok {
                let reason = report(frame);
                return Err(self.offset.reject(buffer, HEAD + payload, reason));
            }
            return match self.record(frame) {
                Ok(record) => {
                    self.offset.take(buffer, HEAD + payload);
                    Ok(Some(record))
                }
                Err(reason) => {
                    let length = next_head(frame, plausible);
                    Err(self.offset.reject(buffer, length, reason))
                }
            };
        }
    }

    fn offset(&mut self) -> &mut Offset {
        &mut self.offset
    }
}

/// Whether `bytes` can be the start of a frame of `device`.
fn plausible(device: Device, bytes: &[u8]) -> bool {
    let tag = device.tag();
    let stations = 1..=device.stations();
    bytes.iter().zip(tag).all(|(a, b)| *a == b)
        // An answer to a command may name all stations (0xff) or none.
        && bytes.get(2).is_none_or(|&s| stations.contains(&u16::from(s)) || s == 0 || s == 0xff)
        && bytes.get(3).is_none_or(|c| c.is_ascii_alphabetic() || c.is_ascii_control())
}

fn report(frame: &[u8]) -> Reason {
    let code = match frame[4] {
        letter if letter.is_ascii_graphic() => format!("`{}`", char::from(letter)),
        number => number.to_string(),
    };
    let meaning = match frame[4] {
        1 => "it doesn't know the command",
        2 => "it has no such station",
        3 => "a parameter is outside its range",
        b'A'..=b'Z' | b'a'..=b'z' => "a fault of the source or a sensor; the BIT table of its manual says which",
        _ => "its manual says what that is",
    };
    Reason::Device { station: u16::from(frame[2]), command: char::from(frame[3]), code, meaning }
}

/// Commands that make the device stream [`OUTPUT_LIST`] in centimetres, binary. Send them one by one.
pub fn setup(hemisphere: [f64; 3]) -> Vec<Bytes> {
    let [x, y, z] = hemisphere;
    let list: Vec<String> = OUTPUT_LIST.iter().map(|item| (*item as u8).to_string()).collect();
    let commands = [
        "F1\r".to_owned(),
        "U1\r".to_owned(),
        format!("O*,{}\r", list.join(",")),
        format!("H*,{x},{y},{z}\r"),
        "C\r".to_owned(),
    ];
    commands.into_iter().map(Bytes::from).collect()
}

#[cfg(test)]
mod tests;
