//! Encoding and decoding of message headers and bodies.

use bytes::{BufMut, BytesMut};
use crc::{CRC_64_ECMA_182, Crc, Table};
use glam::{DMat3, DVec3};

use insonify_core::pose::{Pose, PoseError};

/// Length of a header, bytes.
pub const HEAD: usize = 58;

/// Length of the extended header that starts a v3 body, bytes.
pub(crate) const EXTENDED_HEAD: usize = 12;

/// Length of a `TRANSFORM`'s content, bytes.
pub const TRANSFORM: usize = 48;

/// Length of a tool entry of a `TDATA`, bytes.
pub(crate) const TOOL: usize = 70;

/// Status code: OK.
pub const STATUS_OK: u16 = 1;

/// Status code: not ready.
pub const STATUS_NOT_READY: u16 = 13;

/// Table of CRC-64/ECMA-182. It processes sixteen bytes per step, because images have about 1 MB.
static CRC64: Crc<u64, Table<16>> = Crc::<u64, Table<16>>::new(&CRC_64_ECMA_182);

/// Checksum of a body: CRC-64/ECMA-182.
pub fn crc64(body: &[u8]) -> u64 {
    CRC64.checksum(body)
}

/// A text in a field of fixed length, padded with zeros.
pub type Field<const N: usize> = [u8; N];

/// `text` as a field. Excess characters and characters that are not graphic ASCII are dropped.
pub fn field<const N: usize>(text: &str) -> Field<N> {
    let mut field = [0; N];
    for (slot, byte) in field.iter_mut().zip(text.bytes().filter(u8::is_ascii_graphic)) {
        *slot = byte;
    }
    field
}

/// The text of a field, up to its first zero.
pub fn text(field: &[u8]) -> String {
    let end = field.iter().position(|&b| b == 0).unwrap_or(field.len());
    String::from_utf8_lossy(field[..end].trim_ascii()).into_owned()
}

/// Header of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Head {
    /// 1, or 2 for a v3 body with its extended header.
    pub version: u16,
    /// Message type.
    pub kind: Field<12>,
    /// Device name.
    pub device: Field<20>,
    /// Time stamp: seconds since 1970 in the upper 32 bits, 2⁻³² s in the lower; 0 for none.
    pub time: u64,
    /// Length of the body, bytes.
    pub body_size: u64,
    /// CRC-64 of the body.
    pub crc: u64,
}

impl Head {
    /// Parses the header at the front of `bytes`, unchecked; `None` if there are too few bytes.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        let u64_at = |at: usize| Some(u64::from_be_bytes(bytes.get(at..at + 8)?.try_into().ok()?));
        Some(Self {
            version: u16::from_be_bytes(bytes.get(..2)?.try_into().ok()?),
            kind: bytes.get(2..14)?.try_into().ok()?,
            device: bytes.get(14..34)?.try_into().ok()?,
            time: u64_at(34)?,
            body_size: u64_at(42)?,
            crc: u64_at(50)?,
        })
    }

    /// Time stamp, µs since 1970; `None` if the message has none.
    pub(crate) fn time_us(&self) -> Option<u64> {
        let (seconds, fraction) = (self.time >> 32, self.time & 0xFFFF_FFFF);
        (self.time != 0).then(|| seconds * 1_000_000 + ((fraction * 1_000_000) >> 32))
    }
}

/// Time stamp of `time_ns`, ns since 1970.
pub(crate) fn time_stamp(time_ns: u64) -> u64 {
    let (seconds, ns) = (time_ns / 1_000_000_000, time_ns % 1_000_000_000);
    (seconds << 32) | ((ns << 32) / 1_000_000_000)
}

/// Appends a version 1 message; `write` appends its body.
pub fn put(out: &mut BytesMut, kind: &str, device: &str, time_ns: u64, write: impl FnOnce(&mut BytesMut)) {
    let start = out.len();
    out.put_u16(1);
    out.put_slice(&field::<12>(kind));
    out.put_slice(&field::<20>(device));
    out.put_u64(time_stamp(time_ns));
    out.put_bytes(0, 16);
    let body = out.len();
    write(out);
    let (size, crc) = ((out.len() - body) as u64, crc64(&out[body..]));
    out[start + 42..start + 50].copy_from_slice(&size.to_be_bytes());
    out[start + 50..start + 58].copy_from_slice(&crc.to_be_bytes());
}

/// Appends three numbers.
fn put_vector(out: &mut BytesMut, v: DVec3) {
    for component in v.to_array() {
        out.put_f32(component as f32);
    }
}

/// Appends the content of a `TRANSFORM`: the columns of `rotation`, then `translation_mm`.
pub fn put_matrix(out: &mut BytesMut, rotation: DMat3, translation_mm: DVec3) {
    for column in [rotation.x_axis, rotation.y_axis, rotation.z_axis, translation_mm] {
        put_vector(out, column);
    }
}

/// Appends a `TRANSFORM` message.
pub fn put_transform(out: &mut BytesMut, device: &str, time_ns: u64, rotation: DMat3, translation_mm: DVec3) {
    put(out, "TRANSFORM", device, time_ns, |body| put_matrix(body, rotation, translation_mm));
}

/// Appends a `STATUS` message.
pub fn put_status(out: &mut BytesMut, device: &str, time_ns: u64, code: u16, name: &str, text: &str) {
    put(out, "STATUS", device, time_ns, |body| {
        body.put_u16(code);
        body.put_i64(0);
        body.put_slice(&field::<20>(name));
        body.put_slice(text.as_bytes());
        body.put_u8(0);
    });
}

/// Position and orientation of an image in RAS coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Vector from a pixel to the next in its row, mm.
    pub column_mm: DVec3,
    /// Vector from a row to the next, mm.
    pub row_mm: DVec3,
    /// Slice normal times the slice thickness, mm.
    pub slice_mm: DVec3,
    /// Centre of the image, mm.
    pub centre_mm: DVec3,
}

/// Appends an `IMAGE` message of one slice of u8 \[height × width\], the first row first.
pub fn put_image(out: &mut BytesMut, device: &str, time_ns: u64, size: [u16; 2], placement: &Placement, pixels: &[u8]) {
    const SCALAR: u8 = 1;
    const U8: u8 = 3;
    const LITTLE_ENDIAN: u8 = 2;
    const RAS: u8 = 1;
    put(out, "IMAGE", device, time_ns, |body| {
        let [width, height] = size;
        body.put_u16(1);
        body.put_slice(&[SCALAR, U8, LITTLE_ENDIAN, RAS]);
        for extent in [width, height, 1] {
            body.put_u16(extent);
        }
        for vector in [placement.column_mm, placement.row_mm, placement.slice_mm, placement.centre_mm] {
            put_vector(body, vector);
        }
        for extent in [0, 0, 0, width, height, 1] {
            body.put_u16(extent);
        }
        body.put_slice(pixels);
    });
}

/// `N` big-endian f32 at `at`; zeros if the slice is too short. Callers check the length.
pub(super) fn floats<const N: usize>(bytes: &[u8], at: usize) -> [f64; N] {
    let mut floats = [0.0; N];
    for (float, chunk) in floats.iter_mut().zip(bytes.get(at..).unwrap_or_default().chunks_exact(4)) {
        *float = f64::from(f32::from_be_bytes([chunk[0], chunk[1], chunk[2], chunk[3]]));
    }
    floats
}

/// Pose of a `TRANSFORM`'s content, 48 bytes at `at`.
pub(super) fn pose_of_matrix(bytes: &[u8], at: usize) -> Result<Pose, PoseError> {
    let numbers: [f64; 12] = floats(bytes, at);
    let column = |i: usize| DVec3::from_slice(&numbers[3 * i..]);
    Pose::from_matrix(DMat3::from_cols(column(0), column(1), column(2)), column(3))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A complete message from the documentation of the protocol, with its CRC.
    const VECTOR: &str = "0001 5452414E53464F524D000000 4465766963654E616D6500000000000000000000 00000000499602D4 \
        0000000000000030 F6DD2B8EB4DF6DD2 BF7473CD3E4959E6BE63DD98BE4959E63E12491B3F7852D63E63DD983F7852D6\
        BDC830AE42383660419BC46742383660";

    fn bytes(hex: &str) -> Vec<u8> {
        let hex = hex.replace(' ', "");
        (0..hex.len() / 2).map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).unwrap()).collect()
    }

    #[test]
    fn the_checksum_is_that_of_the_protocol() {
        assert_eq!(crc64(b"123456789"), 0x6C40_DF5F_0B49_7347);
        let message = bytes(VECTOR);
        let head = Head::read(&message).unwrap();
        assert_eq!(head.crc, crc64(&message[HEAD..]));
        assert_eq!((text(&head.kind), text(&head.device)), ("TRANSFORM".into(), "DeviceName".into()));
        assert_eq!((head.version, head.body_size, head.time), (1, 48, 0x4996_02D4));
    }

    #[test]
    fn a_written_pose_equals_the_documented_message() {
        let message = bytes(VECTOR);
        let pose = pose_of_matrix(&message, HEAD).unwrap();
        assert!((pose.position_mm - DVec3::new(46.053, 19.471, 46.053)).length() < 1e-3, "{pose:?}");
        let mut out = BytesMut::new();
        // 0x499602D4 is in the fraction: 0.2875 s.
        put_transform(&mut out, "DeviceName", 0, DMat3::from_quat(pose.orientation), pose.position_mm);
        assert_eq!(out[..34], message[..34]);
        assert_eq!(out[42..50], message[42..50]);
        let (ours, theirs): ([f64; 12], [f64; 12]) = (floats(&out, HEAD), floats(&message, HEAD));
        assert!(ours.iter().zip(theirs).all(|(a, b)| (a - b).abs() < 1e-6), "{ours:?}");
    }

    #[test]
    fn time_stamps_are_encoded_and_decoded() {
        let stamp = time_stamp(1_790_000_000_123_456_789);
        let head = Head { version: 1, kind: [0; 12], device: [0; 20], time: stamp, body_size: 0, crc: 0 };
        assert_eq!(head.time_us(), Some(1_790_000_000_123_456));
        assert_eq!(Head { time: 0, ..head }.time_us(), None);
    }
}
