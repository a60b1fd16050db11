//! Loading of a station's generators.

use std::path::PathBuf;

use super::{Generator, GeneratorError, LoadOptions, Runtime, RuntimeError, Settings};

/// A model that can't be used, with the reason.
#[derive(Debug)]
pub struct RefusedModel {
    /// Path of the model.
    pub path: PathBuf,
    /// Reason for the refusal.
    pub error: GeneratorError,
}

/// A station's generators.
#[derive(Debug, Default)]
pub struct LoadedGenerators {
    /// Generators, in the order of the station.
    pub generators: Vec<Generator>,
    /// Models that were refused.
    pub refused: Vec<RefusedModel>,
}

/// Loads every model of `settings`. A refused model does not affect the others. Blocks until all models are loaded
/// and their parity pairs have run, so don't call it on a thread that shows frames.
///
/// `tissues` are the names of the station's tissues in the order of their numbers, from number 1.
///
/// # Errors
/// Models are named, but ONNX Runtime is missing or unusable. A station can still run without generators.
pub fn load_generators(settings: &Settings, tissues: &[String]) -> Result<LoadedGenerators, RuntimeError> {
    let mut loaded = LoadedGenerators::default();
    if !settings.enabled || settings.models.is_empty() {
        return Ok(loaded);
    }
    let runtime = Runtime::get()?;
    let options =
        LoadOptions { provider: settings.provider, threads: settings.threads, precision: settings.precision, tissues };
    for path in &settings.models {
        match Generator::load(path, runtime, &options) {
            Ok(generator) => loaded.generators.push(generator),
            Err(error) => loaded.refused.push(RefusedModel { path: path.clone(), error }),
        }
    }
    Ok(loaded)
}
