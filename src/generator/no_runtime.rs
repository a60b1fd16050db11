//! ONNX Runtime in a build without the feature `generator`. It can't be loaded.

use std::convert::Infallible;
use std::path::Path;

use super::RuntimeError;

/// ONNX Runtime. No value of it exists.
#[derive(Debug)]
pub struct Runtime(Infallible);

impl Runtime {
    /// The runtime.
    ///
    /// # Errors
    /// Always: the build lacks the feature `generator`.
    pub fn get() -> Result<&'static Self, RuntimeError> {
        Err(RuntimeError::NotBuilt)
    }

    /// The file that was loaded.
    pub fn library(&self) -> &Path {
        match self.0 {}
    }

    /// Any value: without a runtime this is never called.
    pub(super) fn none<T>(&self) -> T {
        match self.0 {}
    }
}
