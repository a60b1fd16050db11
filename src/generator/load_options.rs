//! Options for loading and running a model.

use super::{Precision, Provider};

/// Options for loading a model.
#[derive(Debug, Clone, Default)]
pub struct LoadOptions<'a> {
    /// Execution provider that runs the model.
    pub provider: Provider,
    /// Number of threads of one run; 0 for one thread per processor core.
    pub threads: u32,
    /// Precision of the model.
    pub precision: Precision,
    /// Names of the station's tissues in the order of their numbers, from number 1.
    pub tissues: &'a [String],
}

/// How ONNX Runtime executes a model, after all choices are made.
#[cfg_attr(not(feature = "generator"), allow(dead_code, reason = "sessions read it"))]
#[derive(Debug, Clone, Copy)]
pub(super) struct Execution<'a> {
    /// Execution provider.
    pub(super) provider: Provider,
    /// Chosen precision; never `Auto`.
    pub(super) precision: Precision,
    /// Number of threads of one run, at least 1.
    pub(super) threads: usize,
    /// SHA-256 of the model's file, 64 hexadecimal digits.
    pub(super) sha256: &'a str,
}
