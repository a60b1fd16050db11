//! OpenIGTLink messages that the tests write themselves.

use glam::{DMat3, DVec3};

/// CRC-64/ECMA-182, computed bit by bit, independently of the code under test.
pub(crate) fn crc(bytes: &[u8]) -> u64 {
    const POLYNOMIAL: u64 = 0x42F0_E1EB_A9EA_3693;
    bytes.iter().fold(0, |crc, &byte| {
        (0..8).fold(
            crc ^ (u64::from(byte) << 56),
            |crc, _| {
                if crc >> 63 == 1 { (crc << 1) ^ POLYNOMIAL } else { crc << 1 }
            },
        )
    })
}

pub(crate) fn matrix(rotation: DMat3, translation: DVec3) -> Vec<u8> {
    let columns = [rotation.x_axis, rotation.y_axis, rotation.z_axis, translation];
    columns.iter().flat_map(|column| column.to_array()).flat_map(|value| (value as f32).to_be_bytes()).collect()
}

pub(crate) fn floats(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| (*value as f32).to_be_bytes()).collect()
}

fn padded(text: &str, length: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(length, 0);
    bytes
}

pub(crate) fn tool(name: &str, matrix: &[u8]) -> Vec<u8> {
    [&padded(name, 20)[..], &[1, 0], matrix].concat()
}

/// A message of protocol version 1, or of version 3 with metadata.
pub(crate) fn message(version: u16, kind: &str, device: &str, seconds: u32, content: &[u8]) -> Vec<u8> {
    let body = if version == 1 {
        content.to_vec()
    } else {
        let metadata = b"\x00\x01\x00\x01\x00\x03\x00\x00\x00\x02avv";
        let mut body = vec![0, 12, 0, 10, 0, 0, 0, 3, 0, 0, 0, 7];
        body.extend(content);
        body.extend(metadata);
        body
    };
    let mut bytes = version.min(2).to_be_bytes().to_vec();
    bytes.extend(padded(kind, 12));
    bytes.extend(padded(device, 20));
    bytes.extend(seconds.to_be_bytes());
    bytes.extend([0; 4]);
    bytes.extend((body.len() as u64).to_be_bytes());
    bytes.extend(crc(&body).to_be_bytes());
    bytes.extend(body);
    bytes
}
