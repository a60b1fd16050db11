//! Manifest of a model's inputs and outputs: a strict TOML file next to the `.onnx` file, with the same name.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::GeneratorError;
use crate::files::{self, FileError, FileKind};
use crate::render::FrameQuality;
use crate::settings::Precision;

mod beam_grid;
mod check;
mod quantised;
mod text;

pub use beam_grid::BeamGrid;
use check::{is_file_name, is_sha256};
pub use quantised::Quantised;

/// A generator's manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Version of this format: 1.
    pub format: u32,
    /// Short name, shown while the generator runs.
    pub name: String,
    /// Description in one sentence.
    pub description: String,
    /// Whether the generator is trained or written by hand.
    pub kind: Kind,
    /// Maps that the generator takes, named as in the paper. They must agree with the channels.
    pub variant: Variant,
    /// SHA-256 of the `.onnx` file, 64 hexadecimal digits.
    pub sha256: String,
    /// Multiple to which width and height are padded, 1..=1024. The padding is split equally between both sides; an odd
    /// pixel is at the right or below.
    pub padding_multiple: u32,
    /// Grid of a model in beam coordinates; `None` for a model that takes pictures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beam: Option<BeamGrid>,
    /// Description of the input tensor.
    pub input: InputManifest,
    /// Encoding of the segmentation; present if and only if segmentation is an input channel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub segmentation: Option<SegmentationManifest>,
    /// Description of the output tensor.
    pub output: OutputManifest,
    /// Parity pair: an input and its expected output.
    pub parity: ParityManifest,
    /// Description of the training; present if and only if the generator is trained.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training: Option<Training>,
    /// Quality measured on the test set; `None` if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quality: Option<Quality>,
    /// Files of the model in precisions other than float32.
    #[serde(default, rename = "precision", skip_serializing_if = "Vec::is_empty")]
    pub precisions: Vec<Quantised>,
}

/// Origin of a generator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Trained on pairs of images.
    Trained,
    /// Written by hand: nothing is learnt.
    FixedFilter,
}

/// Maps that a generator takes (Zhang et al. 2020; [`Variant::Maps`]: Zhang et al., IJCARS 2021).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Variant {
    /// Image and mask.
    M,
    /// Image, mask and segmentation.
    MS,
    /// Image, mask, segmentation and attenuation.
    MSA,
    /// Mask, segmentation and attenuation: it needs no rendered image.
    Maps,
}

/// Map that fills one channel of the input, or one channel per class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Channel {
    /// Image: grey level / 255.
    Image,
    /// Mask: 1 inside the sector, 0 outside.
    Mask,
    /// Tissue class: its index in a single channel, or one channel per class with 1 for the pixel's class, else 0.
    Segmentation,
    /// One-way attenuation divided by its 98th percentile, 0..=1.
    Attenuation,
}

/// Mapping y = scale · x^power + offset from a map's value x to the tensor's value y.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Affine {
    /// Factor `scale`.
    pub scale: f32,
    /// Summand `offset`.
    pub offset: f32,
    /// Exponent `power`: 1, or for the attenuation also 0.5 or 0.25. Attenuation falls over ten decades, of which a
    /// linear channel shows only two.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub power: f32,
}

fn one() -> f32 {
    1.0
}

fn is_one(power: &f32) -> bool {
    *power == 1.0
}

impl Affine {
    /// The mapping y = scale · x + offset.
    pub fn new(scale: f32, offset: f32) -> Self {
        Self { scale, offset, power: 1.0 }
    }
}

/// Input tensor [1, channels, height, width] of float32 or uint8. For uint8 the mappings are in the model's graph. The
/// tensor then holds grey levels, the mask as 0 or 255, class indices, and attenuation after its power, times 255.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputManifest {
    /// Name of the tensor in the model.
    pub name: String,
    /// Channels in order. Segmentation fills one channel, or one per class.
    pub channels: Vec<Channel>,
    /// Mapping of [`Channel::Image`] to values of the tensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image: Option<Affine>,
    /// Mapping of [`Channel::Mask`] to values of the tensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<Affine>,
    /// Mapping of [`Channel::Segmentation`] to values of the tensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub segmentation: Option<Affine>,
    /// Mapping of [`Channel::Attenuation`] to values of the tensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attenuation: Option<Affine>,
}

/// Mapping of tissues to classes. It names the tissues, because their numbers differ between stations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SegmentationManifest {
    /// Whether segmentation fills one channel or one per class.
    pub encoding: Encoding,
    /// Names of the classes in order: of tissues, or of groups that [`Self::of`] defines. The class `outside` is the
    /// area outside the sector.
    pub classes: Vec<String>,
    /// Class of all tissues that are named nowhere else; `None` makes such a tissue an error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other: Option<String>,
    /// Class of each tissue that has no class of its own name, as `tissue = "class"`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub of: BTreeMap<String, String>,
}

impl SegmentationManifest {
    /// Index of the class of `tissue`: from [`Self::of`], else of the class with the tissue's name, else of
    /// [`Self::other`]. `None` if there is none.
    pub fn class_of(&self, tissue: &str) -> Option<usize> {
        let index = |name: &String| self.classes.iter().position(|class| class == name);
        let own = || self.classes.iter().position(|class| class == tissue);
        self.of.get(tissue).and_then(index).or_else(own).or_else(|| self.other.as_ref().and_then(index))
    }
}

/// Form of the segmentation in the input tensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Encoding {
    /// One channel that holds the class index.
    Map,
    /// One channel per class, holding 0 or 1.
    Classes,
}

/// Output tensor [1, 1, height, width] of float32 or uint8. With uint8, its values are rounded grey levels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputManifest {
    /// Name of the tensor in the model.
    pub name: String,
    /// Factor in the formula grey level / 255 = scale · y + offset, where y is a value of the tensor.
    pub scale: f32,
    /// Offset in the same formula.
    pub offset: f32,
}

/// Parity pair: an input and its expected output, in two `.npy` files of float32 next to the manifest. For a model in
/// beam coordinates, height and width are range cells and scanlines.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParityManifest {
    /// File of the input planes [4, height, width]: grey levels 0..=255, class indices, attenuation 0..=1, mask 0 or
    /// 255. Planes that the model does not take are ignored.
    pub input: String,
    /// File of the expected grey levels [height, width] before rounding, 0 outside the sector.
    pub output: String,
    /// Largest allowed difference, grey levels.
    pub tolerance: f32,
}

/// Training of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Training {
    /// SHA-256 of the data set's list of files.
    pub data_sha256: String,
    /// Number of training iterations.
    pub iterations: u64,
    /// Quality of the input frames in training; `None` if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lq: Option<FrameQuality>,
    /// Further qualities of the input frames in training.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lq_more: Vec<FrameQuality>,
    /// Quality of the target frames in training; `None` if unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hq: Option<FrameQuality>,
}

/// Means of quality metrics over the test set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quality {
    /// Peak signal-to-noise ratio of the output, dB.
    pub psnr_db: f64,
    /// Structural similarity of the output.
    pub ssim: f64,
    /// Peak signal-to-noise ratio of the input on the same frames, dB.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lq_psnr_db: Option<f64>,
    /// Kullback–Leibler divergence between grey-level histograms of patches.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pkl: Option<f64>,
    /// Fréchet inception distance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fid: Option<f64>,
}

/// Files of the generator at `model`: the model, its manifest, and the files that the manifest names.
pub fn generator_files(model: &Path) -> Vec<PathBuf> {
    let manifest = Manifest::path_of(model);
    let named = |found: Manifest| {
        let others = found.precisions.into_iter().flat_map(|other| [other.model, other.output]);
        [found.parity.input, found.parity.output].into_iter().chain(others).collect::<Vec<_>>()
    };
    let named = Manifest::load(&manifest).map(named).unwrap_or_default();
    let named = named.iter().map(|name| manifest.with_file_name(name));
    [model.to_owned(), manifest.clone()].into_iter().chain(named).collect()
}

impl Manifest {
    /// Path of the manifest of `model`: the same path with the extension `.toml`.
    pub fn path_of(model: &Path) -> PathBuf {
        model.with_extension("toml")
    }

    /// Reads and checks the manifest at `path`.
    ///
    /// # Errors
    /// A file that cannot be read, text that is no manifest, or values that contradict each other. The error names the
    /// file.
    pub fn load(path: &Path) -> Result<Self, GeneratorError> {
        let text = files::read_text(path, FileKind::Manifest).map_err(FileError::at("read", path))?;
        Self::parse(&text).map_err(|reason| GeneratorError::Manifest { path: path.to_owned(), reason })
    }

    /// Reads and checks the text of a manifest. The error describes the fault.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let manifest: Self = toml::from_str(text).map_err(|e| files::toml_reason(text, &e))?;
        manifest.check()?;
        Ok(manifest)
    }

    /// Mapping of `channel` to values of the tensor, if the manifest has one.
    pub(super) fn affine(&self, channel: Channel) -> Option<Affine> {
        match channel {
            Channel::Image => self.input.image,
            Channel::Mask => self.input.mask,
            Channel::Segmentation => self.input.segmentation,
            Channel::Attenuation => self.input.attenuation,
        }
    }

    /// The model's file in a `precision` other than float32; `None` if the manifest has none.
    pub fn quantised(&self, precision: Precision) -> Option<&Quantised> {
        self.precisions.iter().find(|other| other.precision() == Some(precision))
    }

    /// Qualities of the frames that the model translates: the training's input qualities, or low quality if unknown.
    pub fn lq(&self) -> Vec<FrameQuality> {
        let training = self.training.as_ref();
        let first = training.and_then(|training| training.lq).unwrap_or(FrameQuality::LQ);
        std::iter::once(first).chain(training.into_iter().flat_map(|training| training.lq_more.clone())).collect()
    }

    /// Whether the model takes `channel` as an input.
    pub fn takes(&self, channel: Channel) -> bool {
        self.input.channels.contains(&channel)
    }

    /// Whether the model takes segmentation or attenuation maps.
    pub fn reads_maps(&self) -> bool {
        self.takes(Channel::Segmentation) || self.takes(Channel::Attenuation)
    }

    /// Number of channels of the input tensor.
    pub fn tensor_channels(&self) -> usize {
        let of = |channel: &Channel| match (channel, &self.segmentation) {
            (Channel::Segmentation, Some(s)) if s.encoding == Encoding::Classes => s.classes.len(),
            _ => 1,
        };
        self.input.channels.iter().map(of).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = include_str!("../../../tests/data/generators/weighted_maps.toml");

    #[test]
    fn a_manifest_says_what_the_tensor_holds() {
        let manifest = Manifest::parse(TEXT).unwrap();
        assert_eq!((manifest.variant, manifest.tensor_channels()), (Variant::MSA, 4));
        let classes = Manifest::parse(&TEXT.replace("\"map\"", "\"classes\"")).unwrap();
        assert_eq!(classes.tensor_channels(), 7);
        let again: Manifest = toml::from_str(&toml::to_string(&manifest).unwrap()).unwrap();
        assert_eq!(again, manifest);
    }

    #[test]
    fn tissues_find_their_class() {
        let of = "other = \"placenta\"\n[segmentation.of]\ncalvaria = \"skull\"\nskull = \"skull\"\n\n[output]";
        let manifest = Manifest::parse(&TEXT.replace("[output]", of)).unwrap();
        let segmentation = manifest.segmentation.as_ref().unwrap();
        let classes = ["outside", "skull", "calvaria", "amniotic_fluid", "steel"].map(|t| segmentation.class_of(t));
        assert_eq!(classes, [Some(0), Some(3), Some(3), Some(1), Some(2)]);
        let again: Manifest = toml::from_str(&toml::to_string(&manifest).unwrap()).unwrap();
        assert_eq!(again, manifest);
        let none = SegmentationManifest { other: None, ..segmentation.clone() };
        assert_eq!(none.class_of("steel"), None);
    }

    #[test]
    fn a_generator_of_maps_takes_no_image() {
        let text = TEXT
            .replace("\"image\", ", "")
            .replace("image = { scale = 1.0, offset = 0.0 }\n", "")
            .replace("variant = \"MSA\"", "variant = \"Maps\"");
        let manifest = Manifest::parse(&text).unwrap();
        assert_eq!((manifest.variant, manifest.tensor_channels()), (Variant::Maps, 3));
        assert!(!manifest.takes(Channel::Image) && manifest.takes(Channel::Attenuation));
        let lone = text.replace("\"attenuation\", ", "").replace("attenuation = { scale = 1.0, offset = 0.0 }\n", "");
        assert!(Manifest::parse(&lone).unwrap_err().contains("must hold image, or"));
    }
}
