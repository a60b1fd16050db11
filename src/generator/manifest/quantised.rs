//! A model in a precision other than float32.

use serde::{Deserialize, Serialize};

use super::{is_file_name, is_sha256};
use crate::settings::Precision;

/// The same model with rounded weights and values. It has its own `.onnx` file, and its own expected output for the
/// parity pair's input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quantised {
    /// Name of the precision: `int8`.
    pub name: String,
    /// Name of the `.onnx` file, next to the manifest.
    pub model: String,
    /// SHA-256 of the `.onnx` file, 64 hexadecimal digits.
    pub sha256: String,
    /// File of the grey levels expected for the parity input, as
    /// [`ParityManifest::output`](super::ParityManifest::output).
    pub output: String,
    /// Largest allowed difference, grey levels. Processors round differently, and a sum may be rounded to the next
    /// step.
    pub tolerance: f32,
    /// Peak signal-to-noise ratio of this model on frames of the test set, dB.
    pub psnr_db: f64,
}

impl Quantised {
    /// Precision called `name`; `None` if insonify does not know it.
    pub fn precision(&self) -> Option<Precision> {
        Precision::named(&self.name).filter(|precision| *precision == Precision::Int8)
    }

    /// Checks the values. The error describes the fault.
    pub(super) fn check(&self) -> Result<(), String> {
        if self.precision().is_none() {
            return Err(format!("precision.name is `{}`; it must be int8", self.name));
        }
        if !is_sha256(&self.sha256) {
            return Err(format!("precision.sha256 is `{}`; it must be 64 hexadecimal digits", self.sha256));
        }
        if !(self.tolerance > 0.0 && self.tolerance <= 16.0) {
            return Err(format!("precision.tolerance is {}; it must be above 0 and at most 16", self.tolerance));
        }
        if !self.psnr_db.is_finite() {
            return Err(format!("precision.psnr_db is {}; it must be finite", self.psnr_db));
        }
        match [&self.model, &self.output].into_iter().find(|file| !is_file_name(file)) {
            Some(file) => Err(format!("precision: `{file}` must be the name of a file beside the manifest")),
            None => Ok(()),
        }
    }
}
