//! Generators to judge, and feature extractors to judge them with.

use std::path::PathBuf;

use crate::dataset::Tuple;
use crate::generator::{FeatureScale, Generator, Input, LoadOptions, OnnxFeatures, Precision, Provider, Runtime};
use crate::measuring::MeasuringError;
use crate::measuring::harness::distinct;
use crate::quality::{FeatureExtractor, QualityError, crops};
use crate::transducer::ScanGeometry;

/// Models of an evaluation.
#[derive(Debug, Clone, Default)]
pub struct Models {
    /// Files of generators (.onnx), in order of quality with the best last. A manifest lies next to each.
    pub generators: Vec<PathBuf>,
    /// Execution provider of the generators.
    pub provider: Provider,
    /// Precision of the generators.
    pub precision: Precision,
    /// Threads of one generator run; 0 for one per processor.
    pub threads: u32,
    /// Feature extractor of a second Fréchet distance, if wanted.
    pub features: Option<FeatureModel>,
}

/// Feature extractor with an ONNX model.
#[derive(Debug, Clone)]
pub struct FeatureModel {
    /// Model file (.onnx). The model maps float32 [1, 1 or 3, side, side] to [1, d].
    pub path: PathBuf,
    /// Scale of the model's input values.
    pub scale: FeatureScale,
}

impl FeatureModel {
    /// Loads the feature extractor.
    pub(super) fn load(&self) -> Result<OnnxFeatures, MeasuringError> {
        Ok(OnnxFeatures::load(&self.path, Runtime::get()?, self.scale)?)
    }
}

impl Models {
    /// Loads the generators, each with a unique name. `tissues` holds the tissue names from class number 1.
    pub(super) fn load_generators(&self, tissues: &[String]) -> Result<Vec<(String, Generator)>, MeasuringError> {
        if self.generators.is_empty() {
            return Ok(Vec::new());
        }
        let runtime = Runtime::get()?;
        let options =
            LoadOptions { provider: self.provider, threads: self.threads, precision: self.precision, tissues };
        let loaded = self.generators.iter().map(|path| Generator::load(path, runtime, &options));
        let loaded = loaded.collect::<Result<Vec<_>, _>>()?;
        let names: Vec<&str> = loaded.iter().map(|generator| generator.manifest().name.as_str()).collect();
        Ok(distinct(&names).into_iter().zip(loaded).collect())
    }

    /// Loads the built-in network texture64, and the further feature extractor if there is one.
    pub(super) fn load_extractors(&self) -> Result<Vec<Extractor>, MeasuringError> {
        let mut all = vec![OnnxFeatures::texture64(Runtime::get()?)?];
        if let Some(features) = &self.features {
            all.push(features.load()?);
        }
        let labelled = |mut network: OnnxFeatures| {
            let side = network.crop();
            let length = network.features(&vec![0; side * side])?.len();
            Ok(Extractor { label: label(network.name(), side, length), network })
        };
        all.into_iter().map(labelled).collect()
    }
}

/// Runs a generator on the full field of view of a tuple, into `image`.
pub(super) fn generate(
    generator: &mut Generator,
    tuple: &Tuple,
    attenuation: &[f32],
    scan: Option<ScanGeometry>,
    image: &mut Vec<u8>,
) -> Result<(), MeasuringError> {
    let [width, height] = tuple.size.map(|n| n as u32);
    let input = Input {
        width,
        height,
        image: &tuple.lq,
        segmentation: &tuple.segmentation,
        attenuation,
        mask: &tuple.mask,
        scan,
    };
    Ok(generator.run(&input, image)?)
}

/// A feature extractor and the name of its Fréchet distance.
#[derive(Debug)]
pub(super) struct Extractor {
    pub(super) label: String,
    pub(super) network: OnnxFeatures,
}

/// Appends the features of an image's crops to `vectors`.
pub(super) fn add_features(
    network: &mut OnnxFeatures,
    image: &[u8],
    size: [usize; 2],
    vectors: &mut Vec<Vec<f64>>,
) -> Result<(), QualityError> {
    for crop in crops(image, size, network.crop())? {
        vectors.push(network.features(&crop)?);
    }
    Ok(())
}

/// Name of a Fréchet distance. It is FID for Inception v3, which is recognised by its name, input side and 2048
/// features.
fn label(name: &str, side: usize, length: usize) -> String {
    let is_inception = name.to_ascii_lowercase().contains("inception") && (side, length) == (299, 2048);
    if is_inception { "FID".to_owned() } else { format!("FD {name}") }
}

#[cfg(test)]
mod tests {
    use super::label;

    #[test]
    fn only_inception_makes_the_fid() {
        assert_eq!(label("inception_v3", 299, 2048), "FID");
        assert_eq!(label("Inception_v3", 299, 1000), "FD Inception_v3");
        assert_eq!(label("texture64", 256, 64), "FD texture64");
        assert_eq!(label("resnet50", 299, 2048), "FD resnet50");
    }
}
