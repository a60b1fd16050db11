//! Sessions of ONNX Runtime in a build without the feature `generator`. None can be opened.

use std::convert::Infallible;
use std::path::Path;

use super::load_options::Execution;
use super::maps::Geometry;
use super::tensor_values::{Planes, Values};
use super::{GeneratorError, Manifest, Runtime, RuntimeError};

/// Handle that stops a run from another thread.
#[derive(Debug, Clone)]
pub struct Terminator(Infallible);

impl Terminator {
    /// Number of the run in progress, from 1; `None` if no run is in progress.
    pub fn running(&self) -> Option<u64> {
        match self.0 {}
    }

    /// Stops the run in progress. Returns whether there was one.
    pub fn terminate(&self) -> bool {
        match self.0 {}
    }

    /// Stops the run with this number, if it is in progress. Returns whether it was.
    pub fn terminate_run(&self, _number: u64) -> bool {
        match self.0 {}
    }
}

/// Reason why a run gave no image.
pub(super) enum RunFailure {
    #[expect(dead_code, reason = "nothing runs")]
    Stopped,
    #[expect(dead_code, reason = "nothing runs")]
    Failed(String),
}

/// Stand-in for the session of a model. It has no values.
pub(super) struct Session(Infallible);

impl Session {
    pub(super) fn new(
        runtime: &Runtime,
        _path: &Path,
        _model: &[u8],
        _manifest: &Manifest,
        _execution: Execution<'_>,
    ) -> Result<Self, GeneratorError> {
        runtime.none()
    }

    pub(super) fn terminator(&self) -> Terminator {
        match self.0 {}
    }

    pub(super) fn input(&mut self, _geometry: &Geometry) -> Result<Planes<'_>, RunFailure> {
        match self.0 {}
    }

    pub(super) fn run(&mut self) -> Result<Values<'_>, RunFailure> {
        match self.0 {}
    }
}

/// Checks the SHA-256 of a model's file.
pub(super) fn check_hash(_path: &Path, _model: &[u8], _expected: &str) -> Result<(), GeneratorError> {
    Err(RuntimeError::NotBuilt.into())
}
