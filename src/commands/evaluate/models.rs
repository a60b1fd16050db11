//! Generators and feature extractors named on the command line.

use insonify::dataset::Tuple;
use insonify::generator::{Generator, Input, OnnxFeatures, Runtime};
use insonify::quality::{FeatureExtractor, QualityError, crops};
use insonify::transducer::ScanGeometry;

use super::super::{Classify, Failure};
use super::Args;

/// Loads the generators, each with a unique name; `tissues` are names from number 1.
pub(super) fn generators(args: &Args, tissues: &[String]) -> Result<Vec<(String, Generator)>, Failure> {
    let mut named: Vec<(String, Generator)> = Vec::new();
    if args.model.is_empty() {
        return Ok(named);
    }
    let runtime = Runtime::get().input()?;
    let options = args.runtime.options(tissues);
    for path in &args.model {
        let generator = Generator::load(path, runtime, &options)?;
        let name = generator.manifest().name.clone();
        let taken = named.iter().any(|(other, _)| *other == name);
        named.push((if taken { format!("{name} ({})", named.len() + 1) } else { name }, generator));
    }
    Ok(named)
}

/// Runs a generator on the full field of view of a tuple.
pub(super) fn generate(
    generator: &mut Generator,
    tuple: &Tuple,
    attenuation: &[f32],
    scan: Option<ScanGeometry>,
    image: &mut Vec<u8>,
) -> Result<(), Failure> {
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

/// A feature extractor and the name of its distance.
pub(super) struct Extractor {
    pub(super) label: String,
    pub(super) network: OnnxFeatures,
}

/// Adds the features of the crops of an image to `vectors`.
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

/// The built-in network, and the one of `--features`.
pub(super) fn extractors(args: &Args) -> Result<Vec<Extractor>, Failure> {
    let runtime = Runtime::get().input()?;
    let mut all = vec![OnnxFeatures::texture64(runtime)?];
    if let Some(path) = &args.features {
        all.push(OnnxFeatures::load(path, runtime, args.features_scale)?);
    }
    let labelled = |mut network: OnnxFeatures| {
        let side = network.crop();
        let length = network.features(&vec![0; side * side])?.len();
        Ok(Extractor { label: label(network.name(), side, length), network })
    };
    all.into_iter().map(labelled).collect()
}

/// Name of a distance: FID for Inception v3, recognised by its name, input side and 2048 features.
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
