//! NumPy arrays (`.npy`), row-major, in the byte order of this machine, which the header names.

use std::io::Write;
use std::path::Path;

use npyz::{DType, TypeStr, WriteOptions, WriterBuilder};

use super::error::check_shape;
use super::{SinkError, write_with};

/// Writes `values` [rows × columns] as `float32`.
///
/// # Errors
/// `values` does not fill `shape`, or the file cannot be written.
pub fn write_f32(path: &Path, shape: [usize; 2], values: &[f32]) -> Result<(), SinkError> {
    check_shape(path, shape, values.len())?;
    write(path, shape, "f4", bytemuck::cast_slice(values))
}

/// Writes `values` (re, im) [rows × columns] as `complex64`.
///
/// # Errors
/// `values` does not fill `shape`, or the file cannot be written.
pub(crate) fn write_complex64(path: &Path, shape: [usize; 2], values: &[[f32; 2]]) -> Result<(), SinkError> {
    check_shape(path, shape, values.len())?;
    write(path, shape, "c8", bytemuck::cast_slice(values))
}

/// Bytes of a `.npy` file with a `uint8` array: [planes × rows × columns], or [rows × columns] for a single plane.
///
/// # Errors
/// A plane does not fill `shape`, rows and columns; `path` only names it in the error.
pub(crate) fn bytes_of_u8(path: &Path, shape: [usize; 2], planes: &[&[u8]]) -> Result<Vec<u8>, SinkError> {
    planes.iter().try_for_each(|plane| check_shape(path, shape, plane.len()))?;
    let mut bytes = Vec::with_capacity(planes.iter().map(|plane| plane.len()).sum::<usize>() + 256);
    header_of_u8(path, shape, planes.len(), &mut bytes)?;
    planes.iter().for_each(|plane| bytes.extend_from_slice(plane));
    Ok(bytes)
}

/// Header of a `uint8` array: [planes × rows × columns], or [rows × columns] for a single plane.
///
/// # Errors
/// Writing to memory cannot fail; `path` only names the file in an error.
pub(crate) fn header_of_u8(path: &Path, shape: [usize; 2], planes: usize, into: &mut Vec<u8>) -> Result<(), SinkError> {
    let [rows, columns] = shape.map(|n| n as u64);
    match planes {
        1 => header(path, &[rows, columns], "|u1", into),
        count => header(path, &[count as u64, rows, columns], "|u1", into),
    }
}

fn write(path: &Path, shape: [usize; 2], kind: &str, bytes: &[u8]) -> Result<(), SinkError> {
    let order = if cfg!(target_endian = "big") { '>' } else { '<' };
    write_with(path, |w| {
        header(path, &shape.map(|n| n as u64), &format!("{order}{kind}"), w)?;
        w.write_all(bytes).map_err(SinkError::io(path))
    })
}

fn header(path: &Path, shape: &[u64], kind: &str, w: &mut impl Write) -> Result<(), SinkError> {
    let invalid = |e| SinkError::io(path)(std::io::Error::new(std::io::ErrorKind::InvalidInput, e));
    let dtype: TypeStr = kind.parse().map_err(invalid)?;
    let options = WriteOptions::new_header_only().dtype(DType::new_scalar(dtype)).shape(shape).writer(&mut *w);
    options.write_header_only().map(drop).map_err(SinkError::io(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn floats_come_back_bit_for_bit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        let values = [0.0f32, -0.0, 1.5, f32::MIN_POSITIVE / 8.0, 1e30, -3.25];
        write_f32(&path, [2, 3], &values).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let npy = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!((npy.shape(), npy.order()), (&[2, 3][..], npyz::Order::C));
        let back: Vec<f32> = npy.into_vec().unwrap();
        assert_eq!(back.map_bits(), values.to_vec().map_bits());
    }

    #[test]
    fn complex_numbers_have_numpys_type_and_layout() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        let values = [[1.0f32, -2.0], [3.0, 4.5], [0.0, 1e-20]];
        write_complex64(&path, [1, 3], &values).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let npy = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(npy.shape(), &[1, 3]);
        assert_eq!(npy.dtype().descr(), if cfg!(target_endian = "big") { "'>c8'" } else { "'<c8'" });
        let data = &bytes[bytes.len() - 24..];
        assert_eq!(data, bytemuck::cast_slice::<[f32; 2], u8>(&values));
    }

    #[test]
    fn bytes_are_planes_of_an_array() {
        let path = Path::new("a.npy");
        let bytes = bytes_of_u8(path, [2, 3], &[&[1, 2, 3, 4, 5, 6], &[7, 8, 9, 10, 11, 12]]).unwrap();
        let npy = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!((npy.shape(), npy.dtype().descr()), (&[2, 2, 3][..], "'|u1'".to_owned()));
        assert_eq!(npy.into_vec::<u8>().unwrap(), (1..=12).collect::<Vec<u8>>());
        let one = bytes_of_u8(path, [1, 2], &[&[0, 255]]).unwrap();
        assert_eq!(npyz::NpyFile::new(&one[..]).unwrap().shape(), &[1, 2]);
        assert!(bytes_of_u8(path, [2, 3], &[&[1]]).is_err());
    }

    #[test]
    fn an_empty_array_is_an_error_where_values_were_promised() {
        assert!(write_complex64(Path::new("lines.npy"), [256, 3072], &[]).is_err());
    }

    trait MapBits {
        fn map_bits(self) -> Vec<u32>;
    }
    impl MapBits for Vec<f32> {
        fn map_bits(self) -> Vec<u32> {
            self.into_iter().map(f32::to_bits).collect()
        }
    }
}
