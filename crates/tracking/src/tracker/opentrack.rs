//! opentrack's "UDP over network" (port 4242): one pose per datagram of 48 bytes.
//!
//! Six f64, little-endian: x y z (cm), yaw pitch roll (degrees). A datagram is checked by its length and by whether its
//! numbers form a pose. A buffer must hold whole datagrams: if its length is not a multiple of 48, it is emptied.
//!
//! The rotation is Ry(yaw) · Rx(pitch) · Rz(roll), right-handed about the axes of the position. opentrack's user can
//! reverse signs and swap axes ("Options → Output"), and its versions differ: check the axes once with `insonify
//! trackers`.

use bytes::{Buf, BytesMut};
use glam::{DQuat, DVec3, EulerRot};
use insonify_core::pose::{Pose, PoseError, Reading};
use thiserror::Error;

use super::decoder::{Offset, StreamDecoder};
use super::{DecodeError, Record};

/// Length of a datagram, bytes.
pub(crate) const LENGTH: usize = 48;

const MM_PER_CM: f64 = 10.0;

/// Fault of a datagram.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Reason {
    /// Wrong length.
    #[error("a datagram has {length} bytes; it must have {LENGTH} (six doubles: x, y, z, yaw, pitch, roll)")]
    Length {
        /// Number of bytes found.
        length: usize,
    },
    /// An angle outside its range.
    #[error("`{name}` is {value}°; an angle must be a number within ±{ANGLE_LIMIT_DEG}°")]
    Angle {
        /// `yaw`, `pitch` or `roll`.
        name: &'static str,
        /// Value of the angle, degrees.
        value: f64,
    },
    /// Numbers that are not a pose.
    #[error(transparent)]
    Pose(#[from] PoseError),
}

/// Largest accepted angle, degrees; slightly more than a full turn.
pub(crate) const ANGLE_LIMIT_DEG: f64 = 400.0;

/// Decoder of one sender's datagrams.
#[derive(Debug, Clone, Default)]
pub struct Decoder {
    offset: Offset,
}

impl StreamDecoder for Decoder {
    /// Takes one datagram. If the buffer does not hold whole datagrams, all its bytes are removed.
    fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        let length = buffer.len();
        if length == 0 {
            return Ok(None);
        }
        if !length.is_multiple_of(LENGTH) {
            return Err(self.offset.reject(buffer, length, Reason::Length { length }));
        }
        match parse(buffer) {
            Ok(reading) => {
                self.offset.take(buffer, LENGTH);
                Ok(Some(Record::new(0, reading)))
            }
            Err(reason) => Err(self.offset.reject(buffer, LENGTH, reason)),
        }
    }

    fn offset(&mut self) -> &mut Offset {
        &mut self.offset
    }
}

fn parse(mut datagram: &[u8]) -> Result<Reading, Reason> {
    let position_cm = DVec3::from_array([(); 3].map(|()| datagram.get_f64_le()));
    let angles = [(); 3].map(|()| datagram.get_f64_le());
    for (name, value) in ["yaw", "pitch", "roll"].into_iter().zip(angles) {
        if !(-ANGLE_LIMIT_DEG..=ANGLE_LIMIT_DEG).contains(&value) {
            return Err(Reason::Angle { name, value });
        }
    }
    let [yaw, pitch, roll] = angles.map(f64::to_radians);
    let orientation = DQuat::from_euler(EulerRot::YXZ, yaw, pitch, roll);
    Ok(Reading::Pose(Pose::new(position_cm * MM_PER_CM, orientation)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn datagram(values: [f64; 6]) -> BytesMut {
        values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>().as_slice().into()
    }

    #[test]
    fn a_datagram_is_a_pose() {
        let mut buffer = datagram([1.0, -2.0, 30.0, 90.0, 0.0, 0.0]);
        let record = Decoder::default().decode(&mut buffer).unwrap().unwrap();
        let Reading::Pose(pose) = record.reading else { panic!("{record:?}") };
        assert_eq!(pose.position_mm, DVec3::new(10.0, -20.0, 300.0));
        assert!((pose.orientation * DVec3::Z).distance(DVec3::X) < 1e-12);
        assert!(buffer.is_empty());

        // All three rotations: yaw after pitch after roll.
        let mut buffer = datagram([0.0, 0.0, 0.0, 90.0, 90.0, 90.0]);
        let Reading::Pose(pose) = Decoder::default().decode(&mut buffer).unwrap().unwrap().reading else { panic!() };
        let turned = DQuat::from_rotation_y(90_f64.to_radians())
            * DQuat::from_rotation_x(90_f64.to_radians())
            * DQuat::from_rotation_z(90_f64.to_radians());
        assert!(pose.orientation.angle_between(turned) < 1e-7);
    }

    #[test]
    fn datagrams_that_are_no_pose_are_refused_and_the_next_is_decoded() {
        let good = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let mut decoder = Decoder::default();
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
        assert_eq!(error, DecodeError { offset: 18 * LENGTH as u64, fault: Reason::Length { length: 47 }.into() });
        let mut two = datagram(good);
        two.extend_from_slice(&datagram(good));
        assert!(decoder.decode(&mut two).unwrap().is_some() && decoder.decode(&mut two).unwrap().is_some());
        assert_eq!(decoder.decode(&mut two), Ok(None));
    }
}
