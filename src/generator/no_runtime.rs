//! What stands for ONNX Runtime in a build without the feature `generator`: there is none.

use std::convert::Infallible;
use std::path::Path;

use super::RuntimeError;

/// ONNX Runtime, which this build cannot load.
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

    /// What nobody can ask for: there is no runtime.
    pub(super) fn none<T>(&self) -> T {
        match self.0 {}
    }
}
