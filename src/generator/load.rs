//! A station's generators, loaded and measured.

use std::path::PathBuf;

use super::{Generator, GeneratorError, LoadOptions, Runtime, RuntimeError, Settings, Tiers};

/// Runs that a tier is measured by before the session begins.
const MEASURED_RUNS: usize = 5;

/// A model that is not used, and why.
#[derive(Debug)]
pub struct RefusedModel {
    /// Model.
    pub path: PathBuf,
    /// Cause.
    pub error: GeneratorError,
}

/// The generators of a station, the best first, and who decides between them.
#[derive(Debug)]
pub struct LoadedTiers {
    /// Generators; the index is that of the tier.
    pub generators: Vec<Generator>,
    /// Choice among them.
    pub tiers: Tiers,
    /// Models that were refused.
    pub refused: Vec<RefusedModel>,
}

/// Loads every model of `settings`, and measures it at the field of view of `width` × `height`. A model that is refused
/// leaves the others as they are. Takes as long as the models do: not for a thread that shows frames.
///
/// `tissues` are the names of the station's tissues in the order of their numbers, from number 1.
///
/// # Errors
/// There is no ONNX Runtime, though models are named: a station goes on without generators, and says so.
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
