//! BNO08x inertial units in UART-RVC mode: 115200 baud, 100 frames per second, orientation only; the yaw drifts.
//!
//! | bytes | field, little-endian |
//! |---|---|
//! | 0..2 | `AA AA` |
//! | 2 | u8 index, incremented per frame |
//! | 3..9 | i16 yaw, pitch, roll, 0.01° |
//! | 9..15 | i16 acceleration x, y, z, mg |
//! | 15..18 | reserved |
//! | 18 | u8 sum of bytes 2 to 17 |
//!
//! The orientation is Rz(yaw) · Ry(pitch) · Rx(roll). Some firmware swaps pitch and roll: see [`AngleOrder`]. The 8-bit
//! index is extended to 32 bits. The sum is a weak check: one in 256 frames with lost bytes passes it.

use bytes::BytesMut;
use glam::{DQuat, EulerRot};
use insonify_core::pose::Reading;
use thiserror::Error;

use super::decoder::{Offset, StreamDecoder};
use super::framing::{next_head, noise};
use super::{DecodeError, Record};

/// Length of a frame, bytes.
pub(crate) const LENGTH: usize = 19;

/// Largest angle of a frame, degrees.
pub(crate) const ANGLE_LIMIT_DEG: f64 = 180.0;

const START: u8 = 0xAA;

/// Number of bytes that start a frame.
const HEAD: usize = 2;

const DEG_PER_STEP: f64 = 0.01;

/// Order of pitch and roll on the wire, after the yaw.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AngleOrder {
    /// Pitch, then roll, as in the datasheet.
    #[default]
    PitchFirst,
    /// Roll, then pitch.
    RollFirst,
}

/// Fault of a frame.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Reason {
    /// Bytes that don't start a frame.
    #[error("no frame starts with 0x{byte:02X}; one starts with AA AA")]
    Noise {
        /// First of the skipped bytes.
        byte: u8,
    },
    /// Bytes damaged in transmission.
    #[error("a frame has the sum {found:02X}, but its bytes give {computed:02X}")]
    Sum {
        /// Sum in the frame.
        found: u8,
        /// Sum of the received bytes.
        computed: u8,
    },
    /// An angle outside its range.
    #[error("{name} is {value_deg}°; it must lie within ±{ANGLE_LIMIT_DEG}° (is the unit in RVC mode?)")]
    Angle {
        /// `yaw`, `pitch` or `roll`.
        name: &'static str,
        /// Value of the angle, degrees.
        value_deg: f64,
    },
}

/// Decoder of one stream.
#[derive(Debug, Clone)]
pub struct Decoder {
    order: AngleOrder,
    offset: Offset,
    /// Index of the last frame, extended to 32 bits; `None` before the first.
    sequence: Option<u32>,
}

impl Decoder {
    /// A decoder at the start of a stream.
    pub fn new(order: AngleOrder) -> Self {
        Self { order, offset: Offset::default(), sequence: None }
    }

    fn frame(&mut self, bytes: &[u8]) -> Result<Record, Reason> {
        let found = bytes[LENGTH - 1];
        let computed = bytes[2..LENGTH - 1].iter().fold(0_u8, |sum, &byte| sum.wrapping_add(byte));
        if found != computed {
            return Err(Reason::Sum { found, computed });
        }
        let mut angles_deg = [0.0; 3];
        for (i, angle) in angles_deg.iter_mut().enumerate() {
            let raw = i16::from_le_bytes([bytes[3 + 2 * i], bytes[4 + 2 * i]]);
            *angle = f64::from(raw) * DEG_PER_STEP;
        }
        if self.order == AngleOrder::RollFirst {
            angles_deg.swap(1, 2);
        }
        for (name, value_deg) in ["yaw", "pitch", "roll"].into_iter().zip(angles_deg) {
            if value_deg.abs() > ANGLE_LIMIT_DEG {
                return Err(Reason::Angle { name, value_deg });
            }
        }
        let [yaw, pitch, roll] = angles_deg.map(f64::to_radians);
        let sequence = extended_counter(self.sequence, bytes[2]);
        self.sequence = Some(sequence);
        let orientation = DQuat::from_euler(EulerRot::ZYX, yaw, pitch, roll);
        Ok(Record { sequence: Some(sequence), ..Record::new(0, Reading::Orientation(orientation)) })
    }
}

impl StreamDecoder for Decoder {
    /// Each damaged frame and every 64 bytes of noise give an error. After `Ok(None)` the buffer holds less than 64
    /// bytes.
    fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        let Some(&byte) = buffer.first() else { return Ok(None) };
        if !may_start(buffer) {
            return match noise(buffer, HEAD, may_start) {
                Some(length) => Err(self.offset.reject(buffer, length, Reason::Noise { byte })),
                None => Ok(None),
            };
        }
        let Some(frame) = buffer.get(..LENGTH) else { return Ok(None) };
        match self.frame(frame) {
            Ok(record) => {
                self.offset.take(buffer, LENGTH);
                Ok(Some(record))
            }
            Err(reason) => {
                // A frame that lost a byte contains the start of the next frame.
                let length = next_head(frame, may_start);
                Err(self.offset.reject(buffer, length, reason))
            }
        }
    }

    fn offset(&mut self) -> &mut Offset {
        &mut self.offset
    }
}

/// 32-bit counter whose lowest 8 bits are `index`; at most 255 more than `last`.
fn extended_counter(last: Option<u32>, index: u8) -> u32 {
    last.map_or(u32::from(index), |last| last.wrapping_add(u32::from(index.wrapping_sub(last as u8))))
}

/// Whether `bytes` may be the start of a frame.
fn may_start(bytes: &[u8]) -> bool {
    bytes.first() == Some(&START) && bytes.get(1).is_none_or(|&next| next == START)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// Example frame in the section on UART-RVC of the BNO08x datasheet: yaw 0.01°, pitch −1.10°, roll 20.85°.
    const DATASHEET: [u8; LENGTH] = [
        0xAA, 0xAA, 0xDE, 0x01, 0x00, 0x92, 0xFF, 0x25, 0x08, 0x8D, 0xFE, 0xEC, 0xFF, 0xD1, 0x03, 0x00, 0x00, 0x00,
        0xE7,
    ];

    fn orientation(bytes: &[u8], order: AngleOrder) -> DQuat {
        let record = Decoder::new(order).decode(&mut BytesMut::from(bytes)).unwrap().unwrap();
        match record.reading {
            Reading::Orientation(q) => q,
            other => panic!("{other:?}"),
        }
    }

    fn frame(index: u8, angles: [i16; 3]) -> Vec<u8> {
        let mut bytes = vec![0xAA, 0xAA, index];
        bytes.extend(angles.iter().flat_map(|a| a.to_le_bytes()));
        bytes.extend([0; 9]);
        let sum = bytes[2..].iter().fold(0_u8, |sum, &b| sum.wrapping_add(b));
        bytes.push(sum);
        bytes
    }

    #[test]
    fn the_datasheets_frame_is_decoded() {
        let expected = DQuat::from_rotation_z(0.01_f64.to_radians())
            * DQuat::from_rotation_y((-1.10_f64).to_radians())
            * DQuat::from_rotation_x(20.85_f64.to_radians());
        assert!(orientation(&DATASHEET, AngleOrder::PitchFirst).angle_between(expected) < 1e-7);
        let record = Decoder::new(AngleOrder::PitchFirst).decode(&mut BytesMut::from(&DATASHEET[..])).unwrap().unwrap();
        assert_eq!(record.sequence, Some(222));
    }

    #[test]
    fn the_order_of_pitch_and_roll_is_a_choice() {
        let bytes = frame(0, [0, 9000, 0]);
        assert!((orientation(&bytes, AngleOrder::PitchFirst) * DVec3::X).distance(-DVec3::Z) < 1e-9);
        assert!((orientation(&bytes, AngleOrder::RollFirst) * DVec3::Y).distance(DVec3::Z) < 1e-9);
    }

    #[test]
    fn the_index_is_extended_to_32_bits() {
        assert_eq!(extended_counter(None, 200), 200);
        assert_eq!(extended_counter(Some(255), 0), 256);
        assert_eq!(extended_counter(Some(0x1_05), 0x04), 0x2_04);
        assert_eq!(extended_counter(Some(u32::MAX), 0), 0);
    }

    #[test]
    fn one_error_covers_the_noise_before_a_frame() {
        let mut decoder = Decoder::new(AngleOrder::PitchFirst);
        let mut buffer = BytesMut::from(&[1_u8, 2, 0xAA, 3][..]);
        buffer.extend_from_slice(&frame(7, [0, 0, 0]));
        let error = decoder.decode(&mut buffer).unwrap_err();
        assert_eq!(error, DecodeError { offset: 0, fault: Reason::Noise { byte: 1 }.into() });
        assert_eq!(decoder.decode(&mut buffer).unwrap().unwrap().sequence, Some(7));
        let mut damaged = BytesMut::from(&frame(8, [0, 0, 20_000])[..]);
        let error = decoder.decode(&mut damaged).unwrap_err();
        assert_eq!(error.fault, Reason::Angle { name: "roll", value_deg: 200.0 }.into());
        assert_eq!(decoder.decode(&mut damaged), Ok(None));
    }
}
