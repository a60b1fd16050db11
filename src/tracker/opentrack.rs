//! opentrack's "UDP over network" (port 4242): one pose per datagram of 48 bytes.
//!
//! Six f64, little-endian: x y z (cm), yaw pitch roll (degrees). A datagram is checked by its length and by whether its
//! numbers make a pose. Each call decodes whole datagrams: a buffer whose length is not a multiple of 48 is emptied.
//!
//! The rotation is Ry(yaw) · Rx(pitch) · Rz(roll), right-handed about the axes of the position. opentrack's user can
//! reverse signs and swap axes ("Options → Output"), and its versions differ: check the axes once with `insonify
//! trackers`.

use bytes::{Buf, BytesMut};
use glam::{DQuat, EulerRot};
use thiserror::Error;

use super::Record;
use crate::pose::{Pose, PoseError, Reading};

/// Length of a datagram, bytes.
pub const LENGTH: usize = 48;

const MM_PER_CM: f64 = 10.0;

/// A datagram that is not a pose.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("datagram {number} of opentrack: {reason}")]
pub struct DecodeError {
    /// Number of earlier datagrams.
    pub number: u64,
    /// Fault of the datagram.
    pub reason: Reason,
}

/// Fault of a datagram.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Reason {
    /// Wrong length.
    #[error("it has {length} bytes; it must have {LENGTH} (six doubles: x, y, z, yaw, pitch, roll)")]
    Length {
        /// Bytes found.
        length: usize,
    },
    /// An angle outside its range.
    #[error("`{name}` is {value}°; an angle must be a number within ±{ANGLE_LIMIT_DEG}°")]
    Angle {
        /// `yaw`, `pitch` or `roll`.
        name: &'static str,
        /// Its value, degrees.
        value: f64,
    },
    /// Numbers that are not a pose.
    #[error(transparent)]
    Pose(#[from] PoseError),
}

/// Largest accepted angle, degrees: somewhat more than a turn.
pub const ANGLE_LIMIT_DEG: f64 = 400.0;

/// Decoder of one sender's datagrams.
#[derive(Debug, Clone, Default)]
pub struct Decoder {
    number: u64,
}

impl Decoder {
    /// A decoder before the first datagram.
    pub fn new() -> Self {
        Self::default()
    }

    /// Decodes and removes the first of the datagrams in `buffer`.
    ///
    /// # Errors
    /// A datagram that is not a pose. It is removed; if its length is wrong, the whole buffer is.
    pub fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        if buffer.is_empty() {
            return Ok(None);
        }
        let number = self.number;
        self.number += 1;
        let length = buffer.len();
        let reading = if length.is_multiple_of(LENGTH) {
            parse(&mut buffer.split_to(LENGTH))
        } else {
            buffer.clear();
            Err(Reason::Length { length })
        };
        let reading = reading.map_err(|reason| DecodeError { number, reason })?;
        Ok(Some(Record { sensor: 0, sequence: None, device_time_us: None, buttons: 0, reading }))
    }

    /// Ends the stream; a datagram is never left in part.
    ///
    /// # Errors
    /// None; the signature is that of the other decoders.
    pub fn finish(&mut self, buffer: &mut BytesMut) -> Result<(), DecodeError> {
        buffer.clear();
        Ok(())
    }
}

fn parse(datagram: &mut BytesMut) -> Result<Reading, Reason> {
    let [x, y, z] = [(); 3].map(|()| datagram.get_f64_le() * MM_PER_CM);
    let angles = [(); 3].map(|()| datagram.get_f64_le());
    for (name, value) in ["yaw", "pitch", "roll"].into_iter().zip(angles) {
        if !(-ANGLE_LIMIT_DEG..=ANGLE_LIMIT_DEG).contains(&value) {
            return Err(Reason::Angle { name, value });
        }
    }
    let [yaw, pitch, roll] = angles.map(f64::to_radians);
    let q = DQuat::from_euler(EulerRot::YXZ, yaw, pitch, roll);
    Ok(Reading::Pose(Pose::from_components([x, y, z, q.w, q.x, q.y, q.z])?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn datagram(values: [f64; 6]) -> BytesMut {
        values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>().as_slice().into()
    }

    #[test]
    fn a_datagram_is_a_pose() {
        let mut buffer = datagram([1.0, -2.0, 30.0, 90.0, 0.0, 0.0]);
        let record = Decoder::new().decode(&mut buffer).unwrap().unwrap();
        let Reading::Pose(pose) = record.reading else { panic!("{record:?}") };
        assert_eq!(pose.position_mm, DVec3::new(10.0, -20.0, 300.0));
        assert!((pose.orientation * DVec3::Z).distance(DVec3::X) < 1e-12);
        assert!(buffer.is_empty());

        // All three rotations: yaw after pitch after roll.
        let mut buffer = datagram([0.0, 0.0, 0.0, 90.0, 90.0, 90.0]);
        let Reading::Pose(pose) = Decoder::new().decode(&mut buffer).unwrap().unwrap().reading else { panic!() };
        let turned = DQuat::from_rotation_y(90_f64.to_radians())
            * DQuat::from_rotation_x(90_f64.to_radians())
            * DQuat::from_rotation_z(90_f64.to_radians());
        assert!(pose.orientation.angle_between(turned) < 1e-7);
    }

    #[test]
    fn datagrams_that_are_no_pose_are_refused_and_the_next_is_decoded() {
        let good = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let mut decoder = Decoder::new();
        for index in 0..6 {
            for bad in [f64::NAN, f64::INFINITY, -1e300] {
                let mut values = good;
                values[index] = bad;
                let mut buffer = datagram(values);
                assert!(decoder.decode(&mut buffer).is_err(), "{values:?}");
                assert!(buffer.is_empty());
            }
        }
        let mut buffer = datagram(good);
        buffer.truncate(47);
        let error = decoder.decode(&mut buffer).unwrap_err();
        assert_eq!(error, DecodeError { number: 18, reason: Reason::Length { length: 47 } });
        let mut two = datagram(good);
        two.extend_from_slice(&datagram(good));
        assert!(decoder.decode(&mut two).unwrap().is_some() && decoder.decode(&mut two).unwrap().is_some());
        assert_eq!(decoder.decode(&mut two), Ok(None));
    }
}
