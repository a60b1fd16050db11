//! Small volume files for tests, written from the byte offsets in the formats' specifications.

use std::io::Write as _;

/// Sizes of the test volumes.
pub(super) const SIZE: [usize; 3] = [4, 3, 2];

/// Labels of the test volumes: each voxel has its index.
pub(super) fn labels() -> Vec<u16> {
    (0..24).collect()
}

/// `bytes` compressed with gzip.
pub(super) fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// Bytes of `value`, stored as the NIfTI type `datatype`.
pub(super) fn encoded(datatype: i16, big_endian: bool, value: f64) -> Vec<u8> {
    let mut bytes = match datatype {
        2 => (value as u8).to_le_bytes().to_vec(),
        256 => (value as i8).to_le_bytes().to_vec(),
        4 => (value as i16).to_le_bytes().to_vec(),
        512 => (value as u16).to_le_bytes().to_vec(),
        8 => (value as i32).to_le_bytes().to_vec(),
        768 => (value as u32).to_le_bytes().to_vec(),
        1024 => (value as i64).to_le_bytes().to_vec(),
        1280 => (value as u64).to_le_bytes().to_vec(),
        16 => (value as f32).to_le_bytes().to_vec(),
        64 => value.to_le_bytes().to_vec(),
        _ => panic!("datatype {datatype}"),
    };
    if big_endian {
        bytes.reverse();
    }
    bytes
}

/// A NIfTI file to write.
#[derive(Debug, Clone)]
pub(super) struct Nifti {
    pub version: u8,
    pub big_endian: bool,
    pub pair: bool,
    pub dim: [i64; 8],
    pub datatype: i16,
    pub pixdim: [f64; 4],
    pub scale: [f64; 2],
    pub units: u8,
    pub qform: Option<[f64; 6]>,
    pub sform: Option<[[f64; 4]; 3]>,
    pub extensions: Vec<(i32, Vec<u8>)>,
    pub values: Vec<f64>,
}

impl Default for Nifti {
    fn default() -> Self {
        Self {
            version: 1,
            big_endian: false,
            pair: false,
            dim: [3, 4, 3, 2, 1, 1, 1, 1],
            datatype: 512,
            pixdim: [1.0, 2.0, 3.0, 4.0],
            scale: [0.0, 0.0],
            units: 2,
            qform: None,
            sform: Some([[2.0, 0.0, 0.0, -10.0], [0.0, 3.0, 0.0, -20.0], [0.0, 0.0, 4.0, 30.0]]),
            extensions: Vec::new(),
            values: labels().into_iter().map(f64::from).collect(),
        }
    }
}

impl Nifti {
    /// Bytes of the whole file, or of the header if header and voxels are in two files.
    pub(super) fn bytes(&self) -> Vec<u8> {
        let mut bytes = self.header();
        if !self.pair {
            bytes.extend(self.voxels());
        }
        bytes
    }

    /// Bytes of the voxels alone.
    pub(super) fn voxels(&self) -> Vec<u8> {
        self.values.iter().flat_map(|value| encoded(self.datatype, self.big_endian, *value)).collect()
    }

    fn header(&self) -> Vec<u8> {
        let mut tail = vec![u8::from(!self.extensions.is_empty()), 0, 0, 0];
        for (code, content) in &self.extensions {
            let length = (content.len() + 8).next_multiple_of(16);
            let start = tail.len();
            for number in [length as f64, f64::from(*code)] {
                tail.extend(encoded(8, self.big_endian, number));
            }
            tail.extend(content);
            tail.resize(start + length, 0);
        }
        let mut bytes = vec![0; if self.version == 1 { 348 } else { 540 }];
        let offset = if self.pair { 0.0 } else { (bytes.len() + tail.len()) as f64 };
        let bits = encoded(self.datatype, false, 0.0).len() as f64 * 8.0;
        let [b, c, d, x, y, z] = self.qform.unwrap_or_default();
        let rows = self.sform.unwrap_or_default();
        let codes = [f64::from(self.qform.is_some()), f64::from(self.sform.is_some())];
        let mut put = |at: usize, kind: i16, values: &[f64]| {
            let encoded: Vec<_> = values.iter().flat_map(|value| encoded(kind, self.big_endian, *value)).collect();
            bytes[at..at + encoded.len()].copy_from_slice(&encoded);
        };
        let dim = self.dim.map(|size| size as f64);
        if self.version == 1 {
            put(0, 8, &[348.0]);
            put(40, 4, &dim);
            put(70, 4, &[f64::from(self.datatype), bits]);
            put(76, 16, &self.pixdim);
            put(108, 16, &[offset, self.scale[0], self.scale[1]]);
            put(123, 2, &[f64::from(self.units)]);
            put(252, 4, &codes);
            put(256, 16, &[b, c, d, x, y, z]);
            put(280, 16, rows.as_flattened());
            bytes[344..348].copy_from_slice(if self.pair { b"ni1\0" } else { b"n+1\0" });
        } else {
            put(0, 8, &[540.0]);
            put(12, 4, &[f64::from(self.datatype), bits]);
            put(16, 1024, &dim);
            put(104, 64, &self.pixdim);
            put(168, 1024, &[offset]);
            put(176, 64, &self.scale);
            put(344, 8, &codes);
            put(352, 64, &[b, c, d, x, y, z]);
            put(400, 64, rows.as_flattened());
            put(500, 8, &[f64::from(self.units)]);
            bytes[4..12].copy_from_slice(if self.pair { b"ni2\0\r\n\x1a\n" } else { b"n+2\0\r\n\x1a\n" });
        }
        bytes.extend(tail);
        bytes
    }
}
