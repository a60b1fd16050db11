//! 3Dconnexion SpaceMouse: HID input reports (usage page 1, usage 8; vendors 046D and 256F).
//!
//! | report | bytes | content, i16 little-endian |
//! |---|---|---|
//! | split | 7 | `01` x y z, then in a second report `02` rx ry rz |
//! | combined | 13 | `01` x y z rx ry rz |
//! | buttons | 2 or more | `03`, one bit per button from the lowest |
//! | battery | any | `17`, ignored |
//!
//! Split and combined reports differ by their length, not by the product; some systems pad reports with zeros. A
//! report does not state its length, so each call decodes the whole buffer as one report. Each axis or button report
//! gives a record of the complete state: rates and pressed buttons. A puck at rest sends nothing.
//!
//! The axes are the device's; other implementations disagree on their signs. Sources: VRPN, spacenavd, PLUS.

use bytes::BytesMut;
use glam::DVec3;
use insonify_core::pose::Reading;
use thiserror::Error;

use super::decoder::{Offset, StreamDecoder};
use super::{DecodeError, Record};

/// Approximate report value at full deflection; the devices do not specify it.
pub const RANGE: f64 = insonify_core::settings::PUCK_RANGE;

/// Longest report, bytes.
pub(crate) const REPORT_LIMIT: usize = 64;

/// USB vendors: Logitech, which made the first pucks, and 3Dconnexion.
pub const VENDORS: [u16; 2] = [0x046D, 0x256F];

/// HID usage page and usage of a multi-axis controller.
pub const USAGE: (u16, u16) = (1, 8);

/// Products of 3Dconnexion that have that usage but are not pucks: keyboards, mice and their receivers.
pub const NOT_A_PUCK: [u16; 11] =
    [0xC650, 0xC651, 0xC654, 0xC655, 0xC656, 0xC657, 0xC658, 0xC664, 0xC665, 0xC668, 0xC62C];

const TRANSLATION: u8 = 0x01;
const ROTATION: u8 = 0x02;
const BUTTONS: u8 = 0x03;
const BATTERY: u8 = 0x17;
const SPLIT: usize = 7;
const COMBINED: usize = 13;

/// Fault of a report.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum Reason {
    /// Unknown kind of report.
    #[error("a report is of kind 0x{kind:02X}; known are 01 and 02 (axes), 03 (buttons) and 17 (battery)")]
    Kind {
        /// First byte.
        kind: u8,
    },
    /// A report too short for its kind.
    #[error("a report of kind 0x{kind:02X} has {length} bytes; it must have at least {least}")]
    Length {
        /// First byte.
        kind: u8,
        /// Number of bytes present.
        length: usize,
        /// Number of bytes required.
        least: usize,
    },
    /// More bytes than a report can have.
    #[error("a report of {length} bytes; it must have at most {REPORT_LIMIT}")]
    TooLong {
        /// Number of bytes present.
        length: usize,
    },
}

/// Decoder of one device's reports.
#[derive(Debug, Clone)]
pub struct Decoder {
    range: f64,
    offset: Offset,
    translation: DVec3,
    rotation: DVec3,
    buttons: u32,
}

impl Decoder {
    /// Decoder of a device that reports `range` at full deflection. Larger values are clamped to it.
    pub fn new(range: f64) -> Self {
        let range = if range.is_finite() && range >= 1.0 { range } else { RANGE };
        Self { range, offset: Offset::default(), translation: DVec3::ZERO, rotation: DVec3::ZERO, buttons: 0 }
    }

    fn report(&mut self, report: &[u8]) -> Result<bool, Reason> {
        let (length, kind) = (report.len(), report[0]);
        if length > REPORT_LIMIT {
            return Err(Reason::TooLong { length });
        }
        let least = match kind {
            TRANSLATION | ROTATION => SPLIT,
            BUTTONS => 2,
            BATTERY => return Ok(false),
            _ => return Err(Reason::Kind { kind }),
        };
        if length < least {
            return Err(Reason::Length { kind, length, least });
        }
        match kind {
            TRANSLATION => {
                self.translation = self.axes(&report[1..SPLIT]);
                if length >= COMBINED {
                    self.rotation = self.axes(&report[SPLIT..COMBINED]);
                }
            }
            ROTATION => self.rotation = self.axes(&report[1..SPLIT]),
            _ => {
                let bytes = report[1..].iter().take(4).enumerate();
                self.buttons = bytes.fold(0, |bits, (i, &byte)| bits | (u32::from(byte) << (8 * i)));
            }
        }
        Ok(true)
    }

    fn axes(&self, bytes: &[u8]) -> DVec3 {
        let axis = |i: usize| {
            let raw = i16::from_le_bytes([bytes[2 * i], bytes[2 * i + 1]]);
            (f64::from(raw) / self.range).clamp(-1.0, 1.0)
        };
        DVec3::new(axis(0), axis(1), axis(2))
    }
}

impl StreamDecoder for Decoder {
    /// Decodes the report in `buffer` and empties it; `Ok(None)` for a battery report.
    fn decode(&mut self, buffer: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        if buffer.is_empty() {
            return Ok(None);
        }
        let (changed, length) = (self.report(buffer), buffer.len());
        match changed {
            Ok(changed) => {
                self.offset.take(buffer, length);
                let reading = Reading::Rates { translation: self.translation, rotation: self.rotation };
                Ok(changed.then(|| Record { buttons: self.buttons, ..Record::new(0, reading) }))
            }
            Err(reason) => Err(self.offset.reject(buffer, length, reason)),
        }
    }

    fn offset(&mut self) -> &mut Offset {
        &mut self.offset
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracker::Fault;

    fn decode(decoder: &mut Decoder, report: &[u8]) -> Result<Option<(DVec3, DVec3, u32)>, Fault> {
        let mut buffer = BytesMut::from(report);
        let decoded = decoder.decode(&mut buffer).map_err(|error| error.fault)?;
        assert!(buffer.is_empty());
        Ok(decoded.map(|record| match record.reading {
            Reading::Rates { translation, rotation } => (translation, rotation, record.buttons),
            other => panic!("{other:?}"),
        }))
    }

    /// Report layouts in the readers of VRPN and spacenavd.
    #[test]
    fn split_and_combined_reports_are_distinguished_by_length() {
        let mut split = Decoder::new(350.0);
        let first = decode(&mut split, &[1, 0x5E, 0x01, 0xA2, 0xFE, 0xAF, 0x00]);
        assert_eq!(first, Ok(Some((DVec3::new(1.0, -1.0, 0.5), DVec3::ZERO, 0))));
        let second = decode(&mut split, &[2, 0, 0, 0x46, 0, 0xBA, 0xFF]).unwrap().unwrap();
        assert_eq!(second, (DVec3::new(1.0, -1.0, 0.5), DVec3::new(0.0, 0.2, -0.2), 0));

        let mut combined = Decoder::new(350.0);
        let both = decode(&mut combined, &[1, 0x5E, 0x01, 0xA2, 0xFE, 0xAF, 0, 0, 0, 0x46, 0, 0xBA, 0xFF]);
        assert_eq!(both, Ok(Some(second)));
        // A split report padded by the system.
        let filled = decode(&mut combined, &[1, 0, 0, 0, 0, 0, 0, 9, 9, 9, 9, 9]).unwrap().unwrap();
        assert_eq!(filled, (DVec3::ZERO, DVec3::new(0.0, 0.2, -0.2), 0));
    }

    #[test]
    fn buttons_are_held_and_rates_clamped() {
        let mut decoder = Decoder::new(350.0);
        assert_eq!(decode(&mut decoder, &[3, 0x02]), Ok(Some((DVec3::ZERO, DVec3::ZERO, 2))));
        let pushed = decode(&mut decoder, &[1, 0xFF, 0x7F, 0, 0x80, 0, 0]).unwrap().unwrap();
        assert_eq!(pushed, (DVec3::new(1.0, -1.0, 0.0), DVec3::ZERO, 2));
        assert_eq!(decode(&mut decoder, &[3, 0, 0, 0, 0x80, 0, 0]).unwrap().unwrap().2, 0x8000_0000);
        assert_eq!(decode(&mut decoder, &[0x17, 88, 0]), Ok(None));
    }

    #[test]
    fn malformed_reports_are_named() {
        let mut decoder = Decoder::new(350.0);
        assert_eq!(decode(&mut decoder, &[9, 1, 2]), Err(Reason::Kind { kind: 9 }.into()));
        assert_eq!(decode(&mut decoder, &[1, 0, 0]), Err(Reason::Length { kind: 1, length: 3, least: 7 }.into()));
        assert_eq!(decode(&mut decoder, &[3]), Err(Reason::Length { kind: 3, length: 1, least: 2 }.into()));
        assert_eq!(decode(&mut decoder, &[1; 65]), Err(Reason::TooLong { length: 65 }.into()));
        let error = decoder.decode(&mut BytesMut::from(&[9_u8][..])).unwrap_err();
        assert_eq!(error.offset, 3 + 3 + 1 + 65);
    }
}
