//! Feature vectors of images, computed by any suitable ONNX model, for the Fréchet distance.

use std::fmt;
use std::path::{Path, PathBuf};

use ort::session::Session;
use ort::value::{Outlet, Tensor, TensorElementType, ValueType};

use super::external_data::check_one_file;
use super::{FeatureScale, GeneratorError, Runtime};
use crate::files::{self, FileError, FileKind};
use crate::quality::{CROP, FeatureExtractor, QualityError};

/// Network `texture64`, written by `training/make_features.py`.
const TEXTURE64: &[u8] = include_bytes!("../../assets/quality/texture64.onnx");

impl FeatureScale {
    fn value(self, level: u8) -> f32 {
        match self {
            Self::Signed => f32::from(level) / 127.5 - 1.0,
            Self::Unit => f32::from(level) / 255.0,
            Self::Grey => f32::from(level),
        }
    }
}

/// Feature extractor with an ONNX model, such as Inception v3 without its last layer.
///
/// The only input is float32 [1, 1 or 3, side, side], with the grey level in every channel. If the model leaves the
/// side open, it is 299. The first output is float32 [1, d], or [1, d, …], which is averaged over the trailing
/// dimensions.
pub struct OnnxFeatures {
    name: String,
    path: PathBuf,
    session: Session,
    channels: usize,
    crop: usize,
    scale: FeatureScale,
}

impl fmt::Debug for OnnxFeatures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OnnxFeatures").field("path", &self.path).field("crop", &self.crop).finish_non_exhaustive()
    }
}

impl OnnxFeatures {
    /// Loads the model at `path`.
    ///
    /// # Errors
    /// The file can't be read, ONNX Runtime refuses the model, or its tensors have another shape.
    pub fn load(path: &Path, runtime: &Runtime, scale: FeatureScale) -> Result<Self, GeneratorError> {
        let model = files::read(path, FileKind::Model).map_err(FileError::at("read", path))?;
        let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        Self::of_model(stem, path, &model, runtime, scale)
    }

    /// Loads the built-in network `texture64`, which computes 64 fixed texture statistics of a crop of 256 × 256.
    /// Nothing in it is learnt. The statistics are means, deviations and correlations of Gabor magnitudes at 4 octaves
    /// and 4 orientations (after Portilla and Simoncelli, IJCV 2000).
    ///
    /// `training/make_features.py` writes the network and documents each statistic. A distance over these features is
    /// no FID.
    ///
    /// # Errors
    /// ONNX Runtime refuses the network.
    pub fn texture64(runtime: &Runtime) -> Result<Self, GeneratorError> {
        let path = Path::new("assets/quality/texture64.onnx");
        Self::of_model("texture64".to_owned(), path, TEXTURE64, runtime, FeatureScale::Unit)
    }

    fn of_model(
        name: String,
        path: &Path,
        model: &[u8],
        runtime: &Runtime,
        scale: FeatureScale,
    ) -> Result<Self, GeneratorError> {
        let refused = |e: ort::Error| GeneratorError::Model { path: path.to_owned(), reason: e.message().to_owned() };
        check_one_file(path, model)?;
        let mut builder = Session::builder(runtime.environment()).map_err(refused)?;
        let session = builder.commit_from_memory(model).map_err(refused)?;
        let (channels, crop) =
            signature(&session).map_err(|reason| GeneratorError::Signature { path: path.to_owned(), reason })?;
        Ok(Self { name, path: path.to_owned(), session, channels, crop, scale })
    }

    /// Name of the model: its file name without the extension.
    pub fn name(&self) -> &str {
        &self.name
    }

    fn run(&mut self, crop: &[u8]) -> Result<Vec<f64>, String> {
        let message = |e: ort::Error| e.message().to_owned();
        let plane = crop.iter().map(|&level| self.scale.value(level));
        let values: Vec<f32> = (0..self.channels).flat_map(|_| plane.clone()).collect();
        let shape = [1, self.channels, self.crop, self.crop];
        let input = Tensor::from_array((shape, values)).map_err(message)?;
        let outputs = self.session.run(ort::inputs![input]).map_err(message)?;
        let (shape, values) = outputs[0].try_extract_tensor::<f32>().map_err(message)?;
        let length = shape.get(1).and_then(|&d| usize::try_from(d).ok()).filter(|&d| d > 0 && shape[0] == 1);
        let length =
            length.ok_or_else(|| format!("its output has the shape {shape}; it must be [1, d] or [1, d, ...]"))?;
        let positions = values.len() / length;
        let mean = |values: &[f32]| values.iter().map(|&v| f64::from(v)).sum::<f64>() / positions as f64;
        Ok(values.chunks_exact(positions.max(1)).map(mean).collect())
    }
}

impl FeatureExtractor for OnnxFeatures {
    fn crop(&self) -> usize {
        self.crop
    }

    fn features(&mut self, crop: &[u8]) -> Result<Vec<f64>, QualityError> {
        let (found, side) = (crop.len(), self.crop);
        if found != side * side {
            return Err(QualityError::Size { what: "crop", found, width: side, height: side });
        }
        self.run(crop)
            .map_err(|reason| QualityError::Extractor { reason: format!("{}: {reason}", self.path.display()) })
    }
}

/// Number of channels of the model's input, and its side in pixels.
fn signature(session: &Session) -> Result<(usize, usize), String> {
    let [input] = session.inputs() else {
        return Err(format!("it has {} inputs; a feature extractor has one", session.inputs().len()));
    };
    let output = session.outputs().first().ok_or("it has no output")?;
    for outlet in [input, output] {
        if !matches!(outlet.dtype(), ValueType::Tensor { ty: TensorElementType::Float32, .. }) {
            return Err(format!("`{}` is {}; it must be a tensor of float32", outlet.name(), outlet.dtype()));
        }
    }
    sides(input)
        .ok_or_else(|| format!("`{}` is {}; it must be float32 [1, 1 or 3, side, side]", input.name(), input.dtype()))
}

fn sides(input: &Outlet) -> Option<(usize, usize)> {
    let ValueType::Tensor { shape, .. } = input.dtype() else { return None };
    let &[batch, channels, height, width] = &shape[..] else { return None };
    let channels = match channels {
        1 => 1,
        3 | -1 => 3,
        _ => return None,
    };
    // −1 stands for a dimension that the model leaves open.
    let side = match (height, width) {
        (-1, -1) => CROP,
        (side, -1) | (-1, side) => usize::try_from(side).ok()?,
        (height, width) if height == width => usize::try_from(height).ok()?,
        _ => return None,
    };
    (matches!(batch, -1 | 1) && side > 0).then_some((channels, side))
}
