//! Parity check: a model has to reproduce a recorded output on this machine.

use std::fmt;
use std::path::Path;

use serde::Serialize;

use super::manifest::ParityManifest;
use super::{GeneratorError, Input};
use crate::files::{self, FileError, FileKind};
use crate::render::Frame;

/// Largest side of the planes in a parity pair, pixels.
const LARGEST: u64 = 4096;

/// Result of the parity check of a model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ParityReport {
    /// Greatest difference from the expected grey levels.
    pub difference: f32,
    /// Row of the pixel with the greatest difference.
    pub row: usize,
    /// Column of the pixel with the greatest difference.
    pub column: usize,
    /// Largest allowed difference, grey levels.
    pub tolerance: f32,
}

impl fmt::Display for ParityReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { difference, row, column, tolerance } = self;
        write!(f, "{difference:.4} grey levels off at most (row {row}, column {column}), of {tolerance} allowed")
    }
}

/// A parity pair in memory: input planes and expected grey levels.
#[derive(Debug)]
pub(super) struct Pair {
    frame: Frame,
    expected: Vec<f32>,
}

impl Pair {
    pub(super) fn input(&self) -> Input<'_> {
        Input::from(&self.frame)
    }
}

/// Reads the parity pair that the manifest at `manifest_path` names.
pub(super) fn read(manifest_path: &Path, parity: &ParityManifest) -> Result<Pair, GeneratorError> {
    let wrong = |reason: String| GeneratorError::ParityPair { path: manifest_path.to_owned(), reason };
    let (shape, planes) = read_npy(&manifest_path.with_file_name(&parity.input))?;
    let &[4, height @ 1..=LARGEST, width @ 1..=LARGEST] = &shape[..] else {
        return Err(wrong(format!("{} has the shape {shape:?}; it must be [4, height, width]", parity.input)));
    };
    let (output_shape, expected) = read_npy(&manifest_path.with_file_name(&parity.output))?;
    if output_shape != [height, width] {
        return Err(wrong(format!("{} has the shape {output_shape:?}; it must be [{height}, {width}]", parity.output)));
    }
    if let Some(v) = expected.iter().find(|v| !(0.0..=255.0).contains(*v)) {
        return Err(wrong(format!("{} holds {v}; grey levels are 0..=255", parity.output)));
    }
    let bytes = |plane: usize, what: &str| -> Result<Vec<u8>, GeneratorError> {
        let values = planes.chunks_exact(expected.len()).nth(plane).unwrap_or_default();
        let byte = |v: f32| (v.fract() == 0.0 && (0.0..=255.0).contains(&v)).then_some(v as u8);
        let bad = |v: f32| wrong(format!("{} holds the {what} {v}; it must be whole and 0..=255", parity.input));
        values.iter().map(|&v| byte(v).ok_or_else(|| bad(v))).collect()
    };
    let attenuation = planes.chunks_exact(expected.len()).nth(2).unwrap_or_default().to_vec();
    if let Some(v) = attenuation.iter().find(|v| !(0.0..=1.0).contains(*v)) {
        return Err(wrong(format!("{} holds the attenuation {v}; it must be 0..=1", parity.input)));
    }
    let frame = Frame {
        width: width as u32,
        height: height as u32,
        bmode: bytes(0, "grey level")?,
        segmentation: bytes(1, "class")?,
        attenuation,
        mask: bytes(3, "mask")?.into(),
        ..Frame::default()
    };
    Ok(Pair { frame, expected })
}

/// Reads a `.npy` file of float32 in C order. Returns shape and values.
fn read_npy(path: &Path) -> Result<(Vec<u64>, Vec<f32>), GeneratorError> {
    let io = FileError::at("read", path);
    let bytes = files::read(path, FileKind::Array).map_err(io)?;
    let file = files::npy(&bytes).map_err(io)?;
    let shape = file.shape().to_vec();
    if file.order() != npyz::Order::C {
        return Err(io(std::io::Error::new(std::io::ErrorKind::InvalidData, "the array must be in C order")).into());
    }
    // A damaged header may claim more data than the file holds.
    let promised = shape.iter().try_fold(4u64, |product, n| product.checked_mul(*n));
    if promised.is_none_or(|promised| promised > bytes.len() as u64) {
        return Err(io(std::io::Error::new(std::io::ErrorKind::UnexpectedEof, "the array is cut short")).into());
    }
    Ok((shape, file.into_vec().map_err(io)?))
}

/// Compares a model's output `found` with the expected grey levels.
pub(super) fn compare(path: &Path, pair: &Pair, found: &[f32], tolerance: f32) -> Result<ParityReport, GeneratorError> {
    let differences = found.iter().zip(&pair.expected).map(|(f, e)| (f - e).abs()).enumerate();
    let (at, difference) = differences.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
    let width = pair.frame.width as usize;
    let (row, column) = (at / width, at % width);
    if difference <= tolerance && found.len() == pair.expected.len() {
        return Ok(ParityReport { difference, row, column, tolerance });
    }
    let level = |levels: &[f32]| levels.get(at).copied().unwrap_or(f32::NAN);
    let (expected, found) = (level(&pair.expected), level(found));
    Err(GeneratorError::Parity { path: path.to_owned(), difference, row, column, expected, found, tolerance })
}
