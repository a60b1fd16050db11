//! Feature extractors in a build without the feature `generator`. None can be loaded.

use std::convert::Infallible;
use std::path::Path;

use super::{FeatureScale, GeneratorError, Runtime, RuntimeError};
use crate::quality::{FeatureExtractor, QualityError};

/// Stand-in for the feature extractor. It has no values.
#[derive(Debug)]
pub struct OnnxFeatures(Infallible);

impl OnnxFeatures {
    /// Loads the model at `path`.
    ///
    /// # Errors
    /// Always: the build lacks the feature `generator`.
    pub fn load(_path: &Path, _runtime: &Runtime, _scale: FeatureScale) -> Result<Self, GeneratorError> {
        Err(RuntimeError::NotBuilt.into())
    }

    /// Loads the built-in network `texture64`.
    ///
    /// # Errors
    /// Always: the build lacks the feature `generator`.
    pub fn texture64(_runtime: &Runtime) -> Result<Self, GeneratorError> {
        Err(RuntimeError::NotBuilt.into())
    }

    /// Name of the model.
    pub fn name(&self) -> &str {
        match self.0 {}
    }
}

impl FeatureExtractor for OnnxFeatures {
    fn crop(&self) -> usize {
        match self.0 {}
    }

    fn features(&mut self, _crop: &[u8]) -> Result<Vec<f64>, QualityError> {
        match self.0 {}
    }
}
