//! Encoded data of VTP files: base64 or raw, compressed or not.

use std::io::Read;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::read::ZlibDecoder;
use insonify_core::files::memory_for;
use roxmltree::Node;

use super::super::numbers::{Number, Order};

/// Most values of one array: 33 million points, or the corners of as many triangles.
const VALUES_MAX: usize = 100_000_000;

/// Memory per value after decoding, bytes: the number, and its part of a vertex or triangle.
const VALUE_BYTES: usize = 20;

/// Format of all encoded data of a file.
pub(super) struct Format {
    order: Order,
    /// Type of the lengths that precede the data.
    length: Number,
    compressed: bool,
}

/// Encoded data, which start with their length.
#[derive(Clone, Copy)]
pub(super) enum Encoding<'a> {
    Raw(&'a [u8]),
    Base64(&'a [u8]),
}

impl<'a> Encoding<'a> {
    /// The data from an offset on, in bytes or base64 characters; `None` beyond the end.
    pub(super) fn from(self, offset: usize) -> Option<Self> {
        match self {
            Self::Raw(bytes) => Some(Self::Raw(bytes.get(offset..)?)),
            Self::Base64(text) => Some(Self::Base64(text.get(offset..)?)),
        }
    }

    /// Number of raw bytes, or of base64 characters.
    fn len(self) -> usize {
        match self {
            Self::Raw(bytes) | Self::Base64(bytes) => bytes.len(),
        }
    }

    /// The first `length` bytes, decoded, and the data after these bytes. Base64 must encode the bytes as a unit.
    fn take(self, length: usize) -> Result<(Vec<u8>, Self), String> {
        let truncated = |left: usize| format!("truncated: {length} bytes are promised, {left} are left");
        match self {
            Self::Raw(bytes) => {
                let (taken, rest) = bytes.split_at_checked(length).ok_or_else(|| truncated(bytes.len()))?;
                Ok((taken.to_vec(), Self::Raw(rest)))
            }
            Self::Base64(text) => {
                let characters = length.div_ceil(3).saturating_mul(4);
                let (taken, rest) = text.split_at_checked(characters).ok_or_else(|| truncated(text.len() / 4 * 3))?;
                let mut bytes = STANDARD.decode(taken).map_err(|e| format!("it is not base64: {e}"))?;
                if bytes.len() < length {
                    return Err(truncated(bytes.len()));
                }
                bytes.truncate(length);
                Ok((bytes, Self::Base64(rest)))
            }
        }
    }
}

impl Format {
    /// Format according to the attributes of the root element.
    pub(super) fn of(root: &Node<'_, '_>) -> Result<Self, String> {
        let compressed = match root.attribute("compressor") {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => return Err(format!("it is compressed by {other}: save it uncompressed, or with zlib")),
        };
        let order = if root.attribute("byte_order") == Some("BigEndian") { Order::Big } else { Order::Little };
        let length = if root.attribute("header_type") == Some("UInt64") { Number::U64 } else { Number::U32 };
        Ok(Self { order, length, compressed })
    }

    /// Type of numbers with this VTK name.
    pub(super) fn number(name: &str) -> Option<Number> {
        Some(match name {
            "Int8" => Number::I8,
            "UInt8" => Number::U8,
            "Int16" => Number::I16,
            "UInt16" => Number::U16,
            "Int32" => Number::I32,
            "UInt32" => Number::U32,
            "Int64" => Number::I64,
            "UInt64" => Number::U64,
            "Float32" => Number::F32,
            "Float64" => Number::F64,
            // Texts are lists of bytes that end with 0.
            "String" => Number::U8,
            _ => return None,
        })
    }

    /// Decoded values of an array.
    pub(super) fn values(&self, data: Encoding<'_>, number: Option<Number>) -> Result<Vec<f64>, String> {
        let number = number.ok_or("it is of an unknown type of numbers")?;
        let bytes = if self.compressed { self.compressed(data, number)? } else { self.plain(data, number)? };
        Ok(bytes.chunks_exact(number.size()).map(|value| number.read(value, self.order)).collect())
    }

    /// Refuses an array of `bytes` bytes that has too many values or exceeds the available memory, before decoding.
    fn check_size(bytes: usize, number: Number) -> Result<(), String> {
        let values = bytes / number.size();
        if values > VALUES_MAX {
            return Err(format!("it has {values} values, and at most {VALUES_MAX} are read: decimate the mesh"));
        }
        let needed = bytes.saturating_add(values.saturating_mul(VALUE_BYTES)) as u64;
        memory_for(needed).map_err(|none| format!("{none}: decimate the mesh"))
    }

    fn lengths(&self, bytes: &[u8]) -> Vec<usize> {
        bytes.chunks_exact(self.length.size()).map(|value| self.length.read(value, self.order) as usize).collect()
    }

    /// Bytes of uncompressed data. Base64 encodes the length and the bytes as a unit.
    fn plain(&self, data: Encoding<'_>, number: Number) -> Result<Vec<u8>, String> {
        let size = self.length.size();
        let length = match data {
            Encoding::Raw(_) => self.lengths(&data.take(size)?.0)[0],
            // Decodes only the base64 units that contain the length.
            Encoding::Base64(text) => {
                let start = text.get(..size.div_ceil(3) * 4).ok_or("truncated: it has no length")?;
                let bytes = STANDARD.decode(start).map_err(|e| format!("it is not base64: {e}"))?;
                *self.lengths(bytes.get(..size).ok_or("truncated: it has no length")?).first().unwrap_or(&0)
            }
        };
        Self::check_size(length.min(data.len()), number)?;
        let (mut bytes, _) = data.take(size.saturating_add(length))?;
        bytes.drain(..size);
        Ok(bytes)
    }

    /// Bytes of compressed data: zlib blocks, preceded by the number and sizes of the blocks.
    fn compressed(&self, data: Encoding<'_>, number: Number) -> Result<Vec<u8>, String> {
        let size = self.length.size();
        let first = match data {
            Encoding::Raw(bytes) => bytes.get(..size).map(<[u8]>::to_vec),
            Encoding::Base64(text) => text.get(..size.div_ceil(3) * 4).and_then(|start| STANDARD.decode(start).ok()),
        };
        let first = first.filter(|bytes| bytes.len() >= size).ok_or("truncated: it has no number of blocks")?;
        let blocks = self.lengths(&first[..size])[0];
        let (head, rest) = data.take(blocks.saturating_add(3).saturating_mul(size))?;
        let head = self.lengths(&head);
        let [_, block, last, packed @ ..] = &head[..] else {
            return Err("truncated: it has no sizes of blocks".to_owned());
        };
        let total = packed.iter().fold(0usize, |sum, size| sum.saturating_add(*size));
        let (bytes, _) = rest.take(total)?;
        let expected = |i: usize| if i + 1 == packed.len() && *last > 0 { *last } else { *block };
        Self::check_size((0..packed.len()).map(expected).fold(0, usize::saturating_add), number)?;
        let mut unpacked = Vec::new();
        let mut at = 0;
        for (i, size) in packed.iter().enumerate() {
            let (expected, before) = (expected(i), unpacked.len());
            let decoder = ZlibDecoder::new(&bytes[at..at + size]);
            // Only the announced size of a block is decompressed, even if the block contains more.
            let read = decoder.take(expected as u64).read_to_end(&mut unpacked);
            read.map_err(|e| format!("block {i} is not zlib data: {e}"))?;
            if unpacked.len() - before != expected {
                return Err(format!("block {i} has {} bytes, not {expected}", unpacked.len() - before));
            }
            at += size;
        }
        Ok(unpacked)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_that_exceed_the_data_are_refused() {
        let format = Format { order: Order::Little, length: Number::U32, compressed: false };
        let values = format.values(Encoding::Raw(&[2, 0, 0, 0, 1, 2]), Some(Number::U8)).unwrap();
        assert_eq!(values, [1.0, 2.0]);
        let fault = format.values(Encoding::Raw(&[9, 0, 0, 0, 1, 2]), Some(Number::U8)).unwrap_err();
        assert!(fault.starts_with("truncated"), "{fault}");
        let packed = Format { compressed: true, ..format };
        assert!(packed.values(Encoding::Raw(&[255; 64]), Some(Number::U8)).is_err());
        assert!(packed.values(Encoding::Base64(b"////////"), Some(Number::U8)).is_err());
    }

    #[test]
    fn a_bomb_is_refused_by_its_promise() {
        let format = Format { order: Order::Little, length: Number::U32, compressed: true };
        // 1000 blocks of 5 bytes that announce 1 MiB each: far more than 100 million values.
        let head = [1000u32, 1 << 20, 0].into_iter().chain([5; 1000]);
        let mut bytes: Vec<u8> = head.flat_map(u32::to_le_bytes).collect();
        bytes.extend([0; 5000]);
        let fault = format.values(Encoding::Raw(&bytes), Some(Number::U8)).unwrap_err();
        assert!(fault.contains("1048576000 values") && fault.contains("decimate"), "{fault}");
        let fault = format.values(Encoding::Raw(&bytes), Some(Number::F64)).unwrap_err();
        assert!(fault.contains("131072000 values"), "{fault}");
    }
}
