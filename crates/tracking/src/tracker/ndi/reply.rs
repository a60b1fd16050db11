//! Content of tracking replies.

use insonify_core::pose::{Pose, Reading};

use super::Reason;
use crate::tracker::Record;
use crate::tracker::framing::quote;

/// One port of a tracking reply.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Port {
    /// The tool was measured or is out of view.
    Tracked(Record),
    /// Disabled or unplugged.
    Absent,
}

fn record(handle: u8, status: u32, frame: u32, reading: Reading) -> Record {
    // Bits 1 to 3 of the status are the switches.
    Record { sequence: Some(frame), buttons: (status >> 1) & 7, ..Record::new(u16::from(handle), reading) }
}

fn pose(handle: u8, quaternion: [f64; 4], position_mm: [f64; 3]) -> Result<Pose, Reason> {
    let [qw, qx, qy, qz] = quaternion;
    let [x, y, z] = position_mm;
    Pose::from_components([x, y, z, qw, qx, qy, qz]).map_err(|source| Reason::Pose { handle, source })
}

/// Sequential reader of a reply.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    fn take(&mut self, length: usize) -> Result<&'a [u8], Reason> {
        let end = self.at + length;
        let taken = self.bytes.get(self.at..end).ok_or(Reason::Layout { what: "it ends within a tool" })?;
        self.at = end;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], Reason> {
        self.take(N)?.try_into().map_err(|_| Reason::Layout { what: "it ends within a tool" })
    }

    fn u32_le(&mut self) -> Result<u32, Reason> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    fn floats<const N: usize>(&mut self) -> Result<[f64; N], Reason> {
        let mut floats = [0.0; N];
        for float in &mut floats {
            *float = f64::from(f32::from_le_bytes(self.array()?));
        }
        Ok(floats)
    }

    /// Parses an upper-case hexadecimal number of `digits` digits.
    fn hex(&mut self, digits: usize) -> Result<u32, Reason> {
        let digits = self.take(digits)?;
        digits.iter().try_fold(0_u32, |number, &digit| {
            let value = char::from(digit).to_digit(16).ok_or(Reason::Layout { what: "a hexadecimal digit is none" })?;
            Ok((number << 4) | value)
        })
    }

    /// Parses a sign and `length` − 1 decimal digits.
    fn decimal(&mut self, length: usize) -> Result<f64, Reason> {
        let wrong = Reason::Layout { what: "a number is not a sign and digits" };
        let (sign, digits) = match self.take(length)? {
            [b'+', digits @ ..] => (1.0, digits),
            [b'-', digits @ ..] => (-1.0, digits),
            _ => return Err(wrong),
        };
        let mut number = 0_i32;
        for digit in digits {
            if !digit.is_ascii_digit() {
                return Err(wrong);
            }
            number = number * 10 + i32::from(digit - b'0');
        }
        Ok(sign * f64::from(number))
    }

    fn skip(&mut self, text: &[u8]) -> bool {
        let found = self.bytes[self.at..].starts_with(text);
        if found {
            self.at += text.len();
        }
        found
    }
}

/// Passes each port in the data of a `BX` reply to `found`, with the offset of the byte after the port. Returns the
/// system status.
pub(super) fn binary(data: &[u8], mut found: impl FnMut(usize, Result<Port, Reason>)) -> Result<u16, Reason> {
    const VALID: u8 = 1;
    const MISSING: u8 = 2;
    const DISABLED: u8 = 4;
    let mut cursor = Cursor { bytes: data, at: 0 };
    let [count] = cursor.array()?;
    for _ in 0..count {
        let [handle, state] = cursor.array()?;
        let port = match state {
            VALID => {
                let quaternion = cursor.floats()?;
                let position_mm = cursor.floats()?;
                let [_error] = cursor.floats()?;
                let (status, frame) = (cursor.u32_le()?, cursor.u32_le()?);
                pose(handle, quaternion, position_mm)
                    .map(|pose| Port::Tracked(record(handle, status, frame, Reading::Pose(pose))))
            }
            MISSING => {
                let (status, frame) = (cursor.u32_le()?, cursor.u32_le()?);
                Ok(Port::Tracked(record(handle, status, frame, Reading::OutOfView)))
            }
            DISABLED => Ok(Port::Absent),
            _ => return Err(Reason::Layout { what: "a tool's state is none of 01, 02, 04" }),
        };
        found(cursor.at, port);
    }
    let status = u16::from_le_bytes(cursor.array()?);
    if cursor.at == data.len() { Ok(status) } else { Err(Reason::Layout { what: "bytes follow the system status" }) }
}

/// Whether `text`, without its checksum, is a `TX` reply. Other replies to the driver's commands have no line feed,
/// and their lengths differ from a `TX` reply without tools.
pub(super) fn is_text_reply(text: &[u8]) -> bool {
    text.contains(&b'\n') || (text.len() == 6 && text.starts_with(b"00"))
}

/// Passes each port in a `TX` reply, given without its checksum, to `found`, with the offset of the byte after the
/// port. Returns the system status.
pub(super) fn text(text: &[u8], mut found: impl FnMut(usize, Result<Port, Reason>)) -> Result<u16, Reason> {
    let mut cursor = Cursor { bytes: text, at: 0 };
    let count = cursor.hex(2)?;
    for _ in 0..count {
        let handle = cursor.hex(2)? as u8;
        let port = if cursor.skip(b"MISSING") {
            let (status, frame) = (cursor.hex(8)?, cursor.hex(8)?);
            Ok(Port::Tracked(record(handle, status, frame, Reading::OutOfView)))
        } else if cursor.skip(b"UNOCCUPIED") {
            Ok(Port::Absent)
        } else if cursor.skip(b"DISABLED") {
            // Sources disagree on whether status and frame follow.
            if cursor.bytes.get(cursor.at).is_some_and(|&b| b != b'\n') {
                cursor.take(16)?;
            }
            Ok(Port::Absent)
        } else {
            let mut numbers = [0.0; 8];
            for (i, number) in numbers.iter_mut().enumerate() {
                let is_position = (4..7).contains(&i);
                *number = cursor.decimal(if is_position { 7 } else { 6 })? * if is_position { 0.01 } else { 1e-4 };
            }
            let [q0, qx, qy, qz, x, y, z, _error] = numbers;
            let (status, frame) = (cursor.hex(8)?, cursor.hex(8)?);
            pose(handle, [q0, qx, qy, qz], [x, y, z])
                .map(|pose| Port::Tracked(record(handle, status, frame, Reading::Pose(pose))))
        };
        cursor.skip(b"\n");
        found(cursor.at, port);
    }
    let status = cursor.hex(4)? as u16;
    if cursor.at == text.len() { Ok(status) } else { Err(Reason::Layout { what: "text follows the system status" }) }
}

/// Handles in a `PHSR` reply.
pub(super) fn handles(reply: &str) -> Result<Vec<u8>, Reason> {
    let wrong = || Reason::Unexpected { text: quote(reply.as_bytes()), command: "PHSR".to_owned() };
    let mut cursor = Cursor { bytes: reply.as_bytes(), at: 0 };
    let count = cursor.hex(2).map_err(|_| wrong())?;
    let mut handles = Vec::with_capacity(count as usize);
    for _ in 0..count {
        handles.push(cursor.hex(2).map_err(|_| wrong())? as u8);
        cursor.hex(3).map_err(|_| wrong())?;
    }
    if cursor.at == reply.len() { Ok(handles) } else { Err(wrong()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_text_reply_gives_each_tool() {
        let reply = b"0401+05000-05000+05000+05000+001234-056789-123456+00012\
            0000003300001A2B\n02MISSING0000003100001A2B\n03DISABLED\n04UNOCCUPIED\n0000";
        let mut ports = Vec::new();
        assert_eq!(text(reply, |end, port| ports.push((end, port.unwrap()))), Ok(0));
        let [(_, Port::Tracked(first)), (_, Port::Tracked(second)), (_, Port::Absent), (end, Port::Absent)] =
            &ports[..]
        else {
            panic!("{ports:?}")
        };
        assert_eq!((first.sensor, first.sequence, first.buttons), (1, Some(0x1A2B), 1));
        let Reading::Pose(pose) = first.reading else { panic!("{first:?}") };
        assert!(pose.position_mm.distance(DVec3::new(12.34, -567.89, -1234.56)) < 1e-9);
        assert!((pose.orientation.w - 0.5).abs() < 1e-12 && (pose.orientation.x + 0.5).abs() < 1e-12);
        assert_eq!((second.sensor, second.reading), (2, Reading::OutOfView));
        assert_eq!(*end, reply.len() - 4);
    }

    #[test]
    fn an_inconsistent_reply_is_refused() {
        let refused = |reply: &[u8]| matches!(text(reply, |_, _| ()), Err(Reason::Layout { .. }));
        assert!(refused(b"01"));
        assert!(refused(b"0101MISSING0000003100001A2B\n000"));
        assert!(refused(b"0101MISSING0000003100001A2B\n00000"));
        assert!(refused(b"0101*05000-05000+05000+05000+001234-056789-123456+000120000003300001A2B\n0000"));
        assert!(matches!(binary(&[1, 1, 8, 0, 0], |_, _| ()), Err(Reason::Layout { .. })));
        assert!(matches!(binary(&[1, 1, 1, 0, 0], |_, _| ()), Err(Reason::Layout { .. })));
        assert!(matches!(binary(&[], |_, _| ()), Err(Reason::Layout { .. })));
        assert!(matches!(binary(&[0, 0, 0, 0], |_, _| ()), Err(Reason::Layout { .. })));
        assert_eq!(binary(&[0, 0x40, 0], |_, _| ()), Ok(0x40));
    }

    #[test]
    fn port_handles_are_listed() {
        assert_eq!(handles("020A00110031"), Ok(vec![0x0A, 0x10]));
        assert_eq!(handles("00"), Ok(vec![]));
        assert!(handles("OKAY").is_err() && handles("010A0").is_err() && handles("010A0010").is_err());
    }
}
