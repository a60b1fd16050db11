//! Manifest of a model's inputs and outputs: a strict TOML file beside the `.onnx`, of the same name.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::GeneratorError;

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
    /// Trained or written down.
    pub kind: Kind,
    /// Variant by the paper's name; must agree with the channels.
    pub variant: Variant,
    /// SHA-256 of the `.onnx` file, 64 hexadecimal digits.
    pub sha256: String,
    /// Width and height are padded to a multiple of this, 1..=1024: half before, half behind, the odd pixel behind.
    pub padding_multiple: u32,
    /// The input tensor.
    pub input: InputManifest,
    /// Encoding of the segmentation; present if and only if it is a channel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub segmentation: Option<SegmentationManifest>,
    /// The output tensor.
    pub output: OutputManifest,
    /// An input and its expected output.
    pub parity: ParityManifest,
    /// Training data; present if and only if it is a trained one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub training: Option<Training>,
    /// Measured quality.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quality: Option<Quality>,
}

/// Origin of a generator.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Trained on pairs of images.
    Trained,
    /// Written down: nothing was learnt.
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

/// A map that becomes a channel, or with classes several.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Channel {
    /// Grey level / 255.
    Image,
    /// 1 inside the sector, 0 outside.
    Mask,
    /// The class of the tissue: its index, or 1 in the channel of the class and 0 in those of others.
    Segmentation,
    /// One-way attenuation over its 98th percentile, 0..=1.
    Attenuation,
}

/// y = scale · x^power + offset.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Affine {
    /// Scale.
    pub scale: f32,
    /// Offset.
    pub offset: f32,
    /// 1, or for the attenuation 0.5 or 0.25: it falls over ten decades, and a linear network sees but the first two.
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
    /// y = scale · x + offset.
    pub fn new(scale: f32, offset: f32) -> Self {
        Self { scale, offset, power: 1.0 }
    }
}

/// The input tensor: float32 [1, channels, height, width].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputManifest {
    /// Its name in the model.
    pub name: String,
    /// Its channels, in order; the segmentation may be one or one a class.
    pub channels: Vec<Channel>,
    /// From the map's own values, as [`Channel`] tells them, to those of the tensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image: Option<Affine>,
    /// Likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<Affine>,
    /// Likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub segmentation: Option<Affine>,
    /// Likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attenuation: Option<Affine>,
}

/// Mapping of tissues to classes. Tissues go by name: their numbers differ from station to station.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SegmentationManifest {
    /// One channel or several.
    pub encoding: Encoding,
    /// Names of classes in their order: tissues, or groups that [`Self::of`] puts tissues into; `outside` is what is
    /// outside the sector.
    pub classes: Vec<String>,
    /// The class that stands for every tissue not named. Without it, such a tissue is an error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other: Option<String>,
    /// The class of each tissue that is not its own: `tissue = "class"`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub of: BTreeMap<String, String>,
}

impl SegmentationManifest {
    /// Index of the class of the tissue of that name: by [`Self::of`], else the class of its name, else
    /// [`Self::other`]'s.
    pub fn class_of(&self, tissue: &str) -> Option<usize> {
        let index = |name: &String| self.classes.iter().position(|class| class == name);
        let own = || self.classes.iter().position(|class| class == tissue);
        self.of.get(tissue).and_then(index).or_else(own).or_else(|| self.other.as_ref().and_then(index))
    }
}

/// Channels of the segmentation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Encoding {
    /// One channel with the index of the class.
    Map,
    /// One channel a class with 0 or 1.
    Classes,
}

/// The output tensor: float32 [1, 1, height, width].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutputManifest {
    /// Its name in the model.
    pub name: String,
    /// Grey level / 255 = scale · y + offset.
    pub scale: f32,
    /// See `scale`.
    pub offset: f32,
}

/// Two `.npy` files of float32 beside the manifest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParityManifest {
    /// Planes [4, height, width]: grey levels 0..=255, classes, attenuation 0..=1, mask 0 or 255; those that the model
    /// does not take are not looked at by it.
    pub input: String,
    /// Grey levels before rounding [height, width], 0 outside the sector.
    pub output: String,
    /// Greatest difference allowed, grey levels.
    pub tolerance: f32,
}

/// Training data of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Training {
    /// SHA-256 of the data set's list of files.
    pub data_sha256: String,
    /// Iterations.
    pub iterations: u64,
}

/// Figures on the test set: means.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quality {
    /// Peak signal-to-noise ratio, dB.
    pub psnr_db: f64,
    /// Structural similarity, 0..=1.
    pub ssim: f64,
    /// Patch-wise Kullback-Leibler divergence of histograms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pkl: Option<f64>,
    /// Fréchet inception distance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fid: Option<f64>,
}

impl Manifest {
    /// Path of the manifest of `model`: the same name with `.toml`.
    pub fn path_of(model: &Path) -> PathBuf {
        model.with_extension("toml")
    }

    /// Reads and checks the manifest at `path`.
    ///
    /// # Errors
    /// A file that cannot be read, text that is no manifest, or values that contradict each other; each names the file.
    pub fn load(path: &Path) -> Result<Self, GeneratorError> {
        let text =
            std::fs::read_to_string(path).map_err(|source| GeneratorError::Io { path: path.to_owned(), source })?;
        Self::parse(&text).map_err(|reason| GeneratorError::Manifest { path: path.to_owned(), reason })
    }

    /// A checked manifest from its text; the error says what is wrong.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let manifest: Self = toml::from_str(text).map_err(|e| e.to_string().trim().to_owned())?;
        manifest.check()?;
        Ok(manifest)
    }

    /// Scale and offset from the values of `channel` to those of the tensor.
    pub(super) fn affine(&self, channel: Channel) -> Option<Affine> {
        match channel {
            Channel::Image => self.input.image,
            Channel::Mask => self.input.mask,
            Channel::Segmentation => self.input.segmentation,
            Channel::Attenuation => self.input.attenuation,
        }
    }

    /// Whether the model takes that map.
    pub fn takes(&self, channel: Channel) -> bool {
        self.input.channels.contains(&channel)
    }

    /// Channels of the input tensor.
    pub fn tensor_channels(&self) -> usize {
        let of = |channel: &Channel| match (channel, &self.segmentation) {
            (Channel::Segmentation, Some(s)) if s.encoding == Encoding::Classes => s.classes.len(),
            _ => 1,
        };
        self.input.channels.iter().map(of).sum()
    }

    fn check(&self) -> Result<(), String> {
        if self.format != 1 {
            return Err(format!("format is {}; this version of insonify reads 1", self.format));
        }
        if self.name.is_empty() || self.name.len() > 40 {
            return Err("name must have 1..=40 letters".to_owned());
        }
        if !is_sha256(&self.sha256) {
            return Err(format!("sha256 is `{}`; it must be 64 hexadecimal digits", self.sha256));
        }
        if !(1..=1024).contains(&self.padding_multiple) {
            return Err(format!("padding_multiple is {}; it must be 1..=1024", self.padding_multiple));
        }
        self.check_channels()?;
        self.check_segmentation()?;
        if !(self.output.scale.is_finite() && self.output.offset.is_finite()) || self.output.scale == 0.0 {
            return Err("output.scale must be finite and not 0, output.offset finite".to_owned());
        }
        if !(self.parity.tolerance > 0.0 && self.parity.tolerance <= 16.0) {
            return Err(format!("parity.tolerance is {}; it must be above 0 and at most 16", self.parity.tolerance));
        }
        for file in [&self.parity.input, &self.parity.output] {
            if Path::new(file).file_name().and_then(|n| n.to_str()) != Some(file.as_str()) {
                return Err(format!("parity file `{file}` must be the name of a file beside the manifest"));
            }
        }
        match (self.kind, &self.training) {
            (Kind::Trained, None) => Err("a trained generator must say on what, in [training]".to_owned()),
            (Kind::FixedFilter, Some(_)) => Err("[training] does not apply to a fixed filter".to_owned()),
            (_, Some(training)) if !is_sha256(&training.data_sha256) => {
                Err(format!("training.data_sha256 is `{}`; it must be 64 hexadecimal digits", training.data_sha256))
            }
            _ => Ok(()),
        }
    }

    fn check_channels(&self) -> Result<(), String> {
        let channels = &self.input.channels;
        for channel in [Channel::Image, Channel::Mask, Channel::Segmentation, Channel::Attenuation] {
            let name = format!("{channel:?}").to_lowercase();
            match (channels.iter().filter(|c| **c == channel).count(), self.affine(channel)) {
                (0, None) => (),
                (0, Some(_)) => return Err(format!("input.{name} is given, but {name} is not in input.channels")),
                (1, None) => {
                    return Err(format!("input.{name} is missing: say {{ scale = 1.0, offset = 0.0 }} or other"));
                }
                (1, Some(affine)) if affine.scale.is_finite() && affine.offset.is_finite() => {
                    let roots: &[f32] = if channel == Channel::Attenuation { &[1.0, 0.5, 0.25] } else { &[1.0] };
                    if !roots.contains(&affine.power) {
                        let power = affine.power;
                        return Err(format!("input.{name}.power is {power}; it must be one of {roots:?}"));
                    }
                }
                (1, Some(_)) => return Err(format!("input.{name} must be finite")),
                (n, _) => return Err(format!("input.channels holds {name} {n} times")),
            }
        }
        let has = |channel| channels.contains(&channel);
        if !has(Channel::Mask) {
            return Err("input.channels must hold mask".to_owned());
        }
        let found = match [Channel::Image, Channel::Segmentation, Channel::Attenuation].map(has) {
            [true, false, false] => Variant::M,
            [true, true, false] => Variant::MS,
            [true, true, true] => Variant::MSA,
            [false, true, true] => Variant::Maps,
            [true, false, true] => return Err("input.channels holds attenuation without segmentation".to_owned()),
            [false, ..] => {
                return Err("input.channels must hold image, or segmentation and attenuation without it".to_owned());
            }
        };
        if found != self.variant {
            return Err(format!("variant is {:?}, but input.channels are those of {found:?}", self.variant));
        }
        Ok(())
    }

    fn check_segmentation(&self) -> Result<(), String> {
        let needed = self.input.channels.contains(&Channel::Segmentation);
        let segmentation = match (&self.segmentation, needed) {
            (Some(segmentation), true) => segmentation,
            (None, false) => return Ok(()),
            (None, true) => return Err("[segmentation] is missing: it names the classes".to_owned()),
            (Some(_), false) => return Err("[segmentation] is given, but is not in input.channels".to_owned()),
        };
        let classes = &segmentation.classes;
        if !(2..=255).contains(&classes.len()) || !classes.iter().any(|c| c == "outside") {
            return Err("segmentation.classes must be 2..=255 names, `outside` among them".to_owned());
        }
        if let Some((i, twice)) = classes.iter().enumerate().find(|(i, c)| classes[..*i].contains(c)) {
            return Err(format!("segmentation.classes holds `{twice}` again at {i}"));
        }
        for (tissue, class) in &segmentation.of {
            if !classes.contains(class) {
                return Err(format!(
                    "segmentation.of.{tissue} is `{class}`, which is not in segmentation.classes: {}",
                    classes.join(", ")
                ));
            }
            if tissue != class && classes.contains(tissue) {
                return Err(format!("segmentation.of.{tissue} is `{class}`, but `{tissue}` is a class itself"));
            }
        }
        match &segmentation.other {
            Some(other) if !classes.contains(other) => {
                Err(format!("segmentation.other is `{other}`, which is not in segmentation.classes"))
            }
            _ => Ok(()),
        }
    }
}

fn is_sha256(text: &str) -> bool {
    text.len() == 64 && text.bytes().all(|b| b.is_ascii_hexdigit())
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = include_str!("../../tests/data/generators/weighted_maps.toml");

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

    #[test]
    fn contradictions_are_told() {
        let with = |from: &str, to: &str| {
            assert!(TEXT.contains(from), "{from}");
            Manifest::parse(&TEXT.replacen(from, to, 1)).unwrap_err()
        };
        for (from, to, word) in [
            ("format = 1", "format = 2", "format is 2"),
            ("name = \"weighted_maps\"", "nam = \"x\"", "unknown field `nam`"),
            ("sha256 = \"", "sha256 = \"0", "64 hexadecimal digits"),
            ("padding_multiple = 1", "padding_multiple = 0", "1..=1024"),
            ("variant = \"MSA\"", "variant = \"M\"", "MSA"),
            ("\"attenuation\", ", "", "input.attenuation is given"),
            ("\"image\", \"mask\"]", "\"image\", \"image\", \"mask\"]", "image 2 times"),
            ("attenuation = { scale = 1.0, offset = 0.0 }\n", "", "input.attenuation is missing"),
            ("attenuation = { scale = 1.0", "attenuation = { scale = inf", "finite"),
            ("attenuation = { scale = 1.0", "attenuation = { power = 0.3, scale = 1.0", "[1.0, 0.5, 0.25]"),
            ("mask = { scale = 1.0", "mask = { power = 0.5, scale = 1.0", "input.mask.power is 0.5"),
            ("\"outside\", ", "", "`outside`"),
            ("\"placenta\"", "\"outside\"", "again"),
            ("encoding = \"map\"", "encoding = \"map\"\nother = \"gas\"", "`gas`"),
            ("encoding = \"map\"", "encoding = \"map\"\nof = { calvaria = \"bone\" }", "of.calvaria is `bone`"),
            ("encoding = \"map\"", "encoding = \"map\"\nof = { placenta = \"skull\" }", "a class itself"),
            ("scale = 1.0\noffset = 0.0\n", "scale = 0.0\noffset = 0.0\n", "output.scale"),
            ("tolerance = 0.01", "tolerance = 0.0", "parity.tolerance"),
            ("input = \"speckle", "input = \"../speckle", "beside the manifest"),
            ("kind = \"fixed-filter\"", "kind = \"trained\"", "[training]"),
            ("kind = \"fixed-filter\"", "kind = \"magic\"", "magic"),
        ] {
            let error = with(from, to);
            assert!(error.contains(word), "`{word}`: {error}");
        }
    }
}
