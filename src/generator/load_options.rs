//! Options for loading and running a model.

use super::{Precision, Provider};

/// Options for loading a model.
#[derive(Debug, Clone, Default)]
pub struct LoadOptions<'a> {
    /// Execution provider.
    pub provider: Provider,
    /// Number of threads of one run; 0 for one thread per processor core.
    pub threads: u32,
    /// Precision of the model.
    pub precision: Precision,
    /// Names of the station's tissues in the order of their numbers, from number 1.
    pub tissues: &'a [String],
}

/// Execution of a model by ONNX Runtime, after all choices are made.
#[cfg_attr(not(feature = "generator"), allow(dead_code, reason = "sessions read it"))]
#[derive(Debug, Clone, Copy)]
pub(super) struct Execution<'a> {
    /// Provider.
    pub(super) provider: Provider,
    /// Precision that was chosen.
    pub(super) precision: Precision,
    /// Number of threads of one run, at least 1.
    pub(super) threads: usize,
    /// SHA-256 of the model's file, 64 hexadecimal digits.
    pub(super) sha256: &'a str,
}
