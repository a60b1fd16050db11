//! Translation of LQ stills by the best shipped generator for LQ frames.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use crate::generator::{Generator, GeneratorError, Input, Kind, LoadOptions, Manifest, Runtime};
use crate::measuring::{ErrorTable, ExpectedErrors, GeneratorKey, scene_name};
use crate::pose::ProbeSpeed;
use crate::render::{Frame, FrameQuality};
use crate::station::Station;
use crate::transducer::Sector;

/// Folder of the shipped generators below the repository's root. Each generator has a folder in it.
const FOLDER: &str = "assets/generators";

/// A generator with the image of its last run.
pub struct Translation {
    generator: Generator,
    /// Frame quality that the generator was trained to produce.
    pub target: FrameQuality,
    /// Error of the generator on LQ frames in the error table, grey levels.
    error: f64,
    /// Grey levels of the last generated image [height × width].
    pub image: Vec<u8>,
}

/// Description of the generator, for JSON.
#[derive(Debug, Serialize)]
pub struct TranslationReport {
    name: String,
    sha256: String,
    model: PathBuf,
    target: FrameQuality,
    error: f64,
}

impl Translation {
    /// Loads the best generator of LQ frames. `tissues` holds the tissue names from class number 1.
    ///
    /// # Errors
    /// No generator is available; the text gives the reason in one line.
    pub fn load(station: &Station, tissues: &[String], sector: &Sector) -> Result<Self, String> {
        let table = ErrorTable::shipped().map_err(|error| error.to_string())?;
        let expected = table.expected(&scene_name(station), &station.probe);
        let folder = folder().ok_or_else(|| format!("there is no folder {FOLDER} above the program"))?;
        let Best { model, target, error } = best(&folder, &expected)?;
        let runtime = Runtime::get().map_err(|error| error.to_string())?;
        let options = LoadOptions { tissues, ..LoadOptions::default() };
        let mut generator = Generator::load(&model, runtime, &options).map_err(|error| error.to_string())?;
        // The first run allocates memory, so it isn't timed.
        generator.measure(sector.width, sector.height, 0).map_err(|error| error.to_string())?;
        Ok(Self { generator, target, error, image: Vec::new() })
    }

    /// Translates a frame into [`Self::image`]. Returns the duration, ms.
    ///
    /// # Errors
    /// As [`Generator::run`].
    pub fn run(&mut self, frame: &Frame) -> Result<f64, GeneratorError> {
        let started = Instant::now();
        self.generator.run(&Input::from(frame), &mut self.image)?;
        Ok(started.elapsed().as_secs_f64() * 1e3)
    }

    /// Name of the generator.
    pub fn name(&self) -> &str {
        &self.generator.manifest().name
    }

    /// Description of the generator for JSON.
    pub fn report(&self) -> TranslationReport {
        let Manifest { name, sha256, .. } = self.generator.manifest().clone();
        let model = self.generator.path().to_owned();
        TranslationReport { name, sha256, model, target: self.target, error: self.error }
    }
}

/// A model file, its training target, and its error on LQ frames.
#[derive(Debug, PartialEq)]
struct Best {
    model: PathBuf,
    target: FrameQuality,
    error: f64,
}

/// The folder of shipped generators above the program or its sources, if found.
fn folder() -> Option<PathBuf> {
    let program = std::env::current_exe().unwrap_or_default();
    let above = program.ancestors().skip(1).chain([Path::new(env!("CARGO_MANIFEST_DIR"))]);
    above.map(|folder| folder.join(FOLDER)).find(|folder| folder.is_dir())
}

/// Generator in `folder` that takes low-quality (LQ) frames and has the least error at rest, according to `expected`.
/// PSNRs in manifests are not comparable, because their data sets differ.
fn best(folder: &Path, expected: &ExpectedErrors<'_>) -> Result<Best, String> {
    let entries = std::fs::read_dir(folder).map_err(|error| format!("cannot read {}: {error}", folder.display()))?;
    let measured = entries.flatten().filter_map(|entry| {
        let model = entry.path().join(entry.file_name()).with_extension("onnx");
        let manifest = Manifest::load(&Manifest::path_of(&model)).ok()?;
        let takes_lq = manifest.kind == Kind::Trained && manifest.lq().contains(&FrameQuality::LQ);
        let target = manifest.training.as_ref()?.hq.filter(|_| takes_lq)?;
        let key = GeneratorKey { name: manifest.name, sha256: manifest.sha256 };
        // Frames for translation are stills, so the error at rest counts.
        let error = expected.of(FrameQuality::LQ, Some(&key), ProbeSpeed::AtRest)?;
        Some(Best { model, target, error })
    });
    measured
        .min_by(|a, b| a.error.total_cmp(&b.error))
        .ok_or_else(|| format!("{} has no generator of LQ frames that the table of errors knows", folder.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measuring::{PointError, StationErrors};
    use crate::transducer::Probe;

    const SHIPPED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets/generators");

    #[test]
    fn the_shipped_generator_with_the_least_error_on_lq_frames_is_taken() {
        let table = ErrorTable::shipped().unwrap();
        let expected = table.expected("obstetric", &Probe::default());
        let found = best(Path::new(SHIPPED), &expected).unwrap();
        let manifest = Manifest::load(&Manifest::path_of(&found.model)).unwrap();
        assert_eq!(Some(found.target), manifest.training.unwrap().hq);
        assert!(found.target.angles > 1, "{found:?}");
        let errors = table.stations.iter().flat_map(|station| &station.points);
        let errors = errors.filter(|point| point.generator.is_some() && point.quality == FrameQuality::LQ);
        assert_eq!(Some(found.error), errors.map(|point| point.at(ProbeSpeed::AtRest)).min_by(f64::total_cmp));
        assert!(found.error < expected.of(FrameQuality::LQ, None, ProbeSpeed::AtRest).unwrap(), "{found:?}");
    }

    #[test]
    fn the_table_decides_not_the_name_nor_the_models_own_figure() {
        let of = |name: &str| Manifest::load(Path::new(&format!("{SHIPPED}/{name}/{name}.toml"))).unwrap();
        let point = |name: &str, rmse| {
            let generator = Some(GeneratorKey { name: name.into(), sha256: of(name).sha256 });
            PointError::fixture(FrameQuality::LQ, generator, rmse)
        };
        // `fast_msa` has the highest PSNR on its own data set; `beam_m_rolling` takes frames of another quality.
        let points = vec![point("fast_msa", 20.0), point("fast_m", 12.0), point("beam_m_rolling", 5.0)];
        let station = StationErrors::fixture("obstetric", "convex", points);
        let table = ErrorTable { stations: vec![station], ..ErrorTable::new(String::new()) };
        let found = best(Path::new(SHIPPED), &table.expected("obstetric", &Probe::default())).unwrap();
        assert!(found.model.ends_with("fast_m/fast_m.onnx") && found.error == 12.0, "{found:?}");
        let none = ErrorTable::new(String::new());
        let error = best(Path::new(SHIPPED), &none.expected("obstetric", &Probe::default())).unwrap_err();
        assert!(error.contains("no generator of LQ frames"), "{error}");
        let error = best(Path::new("/nowhere"), &table.expected("obstetric", &Probe::default())).unwrap_err();
        assert!(error.contains("/nowhere") && error.lines().count() == 1, "{error}");
    }
}
