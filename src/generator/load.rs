//! A station's generators, loaded and measured.

use std::path::PathBuf;

use super::{Generator, GeneratorError, LoadOptions, Runtime, RuntimeError, Settings, Tiers};

/// Timed runs per tier before the session begins.
const MEASURED_RUNS: usize = 5;

/// A model that is not used, and why.
#[derive(Debug)]
pub struct RefusedModel {
    /// Model.
    pub path: PathBuf,
    /// Cause.
    pub error: GeneratorError,
}

/// A station's generators, the best first, and the choice among them.
#[derive(Debug)]
pub struct LoadedTiers {
    /// Generators; the index is that of the tier.
    pub generators: Vec<Generator>,
    /// Choice among them.
    pub tiers: Tiers,
    /// Models that were refused.
    pub refused: Vec<RefusedModel>,
}

/// Loads every model of `settings` and times it on frames of `width` × `height` pixels. A refused model does not affect
/// the others. Blocks while the models load and run: don't call it on a thread that shows frames.
///
/// `tissues` are the names of the station's tissues in the order of their numbers, from number 1.
///
/// # Errors
/// Models are named, but ONNX Runtime is missing or unusable. A station can still run without generators.
pub fn load_tiers(
    settings: &Settings,
    tissues: &[String],
    width: u32,
    height: u32,
) -> Result<LoadedTiers, RuntimeError> {
    let mut loaded = LoadedTiers { generators: Vec::new(), tiers: Tiers::new(settings.budget()), refused: Vec::new() };
    if !settings.enabled || settings.models.is_empty() {
        return Ok(loaded);
    }
    let runtime = Runtime::get()?;
    let options = LoadOptions { provider: settings.provider, threads: settings.threads, tissues };
    for path in &settings.models {
        let measured = Generator::load(path, runtime, &options)
            .and_then(|mut generator| generator.measure(width, height, MEASURED_RUNS).map(|times| (generator, times)));
        match measured {
            Ok((generator, times)) => {
                loaded.tiers.add(&generator.manifest().name, &times);
                loaded.generators.push(generator);
            }
            Err(error) => loaded.refused.push(RefusedModel { path: path.clone(), error }),
        }
    }
    Ok(loaded)
}
