//! ONNX Runtime in a build without the feature `generator`. It can't be loaded.

use std::convert::Infallible;
use std::path::Path;

use super::RuntimeError;

/// Stand-in for ONNX Runtime. It has no values.
#[derive(Debug)]
pub struct Runtime(Infallible);

impl Runtime {
    /// Loads the runtime.
    ///
    /// # Errors
    /// Always: the build lacks the feature `generator`.
    pub fn get() -> Result<&'static Self, RuntimeError> {
        Err(RuntimeError::NotBuilt)
    }

    /// Path of the loaded library.
    pub fn library(&self) -> &Path {
        match self.0 {}
    }

    /// Returns a value of any type. Never called, because no value of [`Runtime`] exists.
    pub(super) fn none<T>(&self) -> T {
        match self.0 {}
    }
}
