//! Reading of frames that [`FrameFiles`](super::FrameFiles) wrote.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use thiserror::Error;

use crate::files::{self, FileError, FileKind, GreyError, read_grey};
use crate::generator::{Channel, Input, Manifest};
use crate::settings::SettingsGroup;
use crate::transducer::{Probe, ProbeKind, ScanGeometry};

/// Reason why a file of a frame can't be used.
#[derive(Debug, Error)]
pub enum FrameFileError {
    /// A grey picture can't be read.
    #[error(transparent)]
    Grey(#[from] GreyError),
    /// A file can't be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file has another content than expected.
    #[error("{path} {what}")]
    Content {
        /// The file.
        path: PathBuf,
        /// Description of the fault.
        what: String,
    },
    /// A map that the generator takes is missing.
    #[error("the generator is of the variant {variant}, and {directory} has no {file}")]
    Missing {
        /// Variant of the generator.
        variant: String,
        /// The directory.
        directory: PathBuf,
        /// File of the map.
        file: &'static str,
    },
}

type Result<T> = std::result::Result<T, FrameFileError>;

fn refused(path: &Path, what: impl Into<String>) -> FrameFileError {
    FrameFileError::Content { path: path.to_owned(), what: what.into() }
}

fn bytes(path: &Path, kind: FileKind) -> Result<Vec<u8>> {
    Ok(files::read(path, kind).map_err(FileError::at("read", path))?)
}

/// Maps of a frame, read from a directory.
#[derive(Debug)]
pub struct FrameDirectory {
    /// The directory.
    pub directory: PathBuf,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Names of the tissues; number n of the segmentation is `tissues[n - 1]`.
    pub tissues: Vec<String>,
    image: Option<Vec<u8>>,
    mask: Vec<u8>,
    segmentation: Option<Vec<u8>>,
    attenuation: Option<Vec<f32>>,
}

impl FrameDirectory {
    /// Reads mask.png and, if present, bmode.png, attenuation.npy, and segmentation.png with tissues.json.
    ///
    /// # Errors
    /// The mask is missing, or a file can't be read or has another size than the mask.
    pub fn read(directory: &Path) -> Result<Self> {
        let (mask, [width, height]) = read_grey(&directory.join("mask.png"))?;
        let optional = |name: &str| -> Result<Option<Vec<u8>>> {
            let path = directory.join(name);
            if !path.exists() {
                return Ok(None);
            }
            let (pixels, [w, h]) = read_grey(&path)?;
            match (w, h) == (width, height) {
                true => Ok(Some(pixels)),
                false => Err(refused(&path, format!("is {w} x {h}, mask.png {width} x {height}"))),
            }
        };
        let image = optional("bmode.png")?;
        let segmentation = optional("segmentation.png")?;
        let tissues = if segmentation.is_some() { names(&directory.join("tissues.json"))? } else { Vec::new() };
        let path = directory.join("attenuation.npy");
        let attenuation = path.exists().then(|| floats(&path, [height, width])).transpose()?;
        Ok(Self { directory: directory.to_owned(), width, height, tissues, image, mask, segmentation, attenuation })
    }

    /// Inputs of the generator that `manifest` describes.
    ///
    /// # Errors
    /// A map that the generator takes is missing, or a generator in beam coordinates can't use frame.json.
    pub fn input(&self, manifest: &Manifest) -> Result<Input<'_>> {
        for (channel, there, file) in [
            (Channel::Image, self.image.is_some(), "bmode.png"),
            (Channel::Segmentation, self.segmentation.is_some(), "segmentation.png"),
            (Channel::Attenuation, self.attenuation.is_some(), "attenuation.npy"),
        ] {
            if !there && manifest.takes(channel) {
                let (variant, directory) = (format!("{:?}", manifest.variant), self.directory.clone());
                return Err(FrameFileError::Missing { variant, directory, file });
            }
        }
        // Only models in beam coordinates need the record.
        let record = self.directory.join("frame.json");
        let scan = manifest.beam.map(|_| scan(&record, [self.width, self.height])).transpose()?.flatten();
        Ok(Input {
            width: self.width,
            height: self.height,
            image: self.image.as_deref().unwrap_or_default(),
            segmentation: self.segmentation.as_deref().unwrap_or_default(),
            attenuation: self.attenuation.as_deref().unwrap_or_default(),
            mask: &self.mask,
            scan,
        })
    }
}

/// The probe settings in a frame's record that determine the geometry of its picture.
#[derive(Deserialize)]
struct Recorded {
    probe: RecordedProbe,
}

#[derive(Deserialize)]
struct RecordedProbe {
    #[serde(flatten)]
    kind: ProbeKind,
    depth_mm: f64,
}

/// Scanline geometry of the frame whose record is at `path`; none without a record.
fn scan(path: &Path, [width, height]: [u32; 2]) -> Result<Option<ScanGeometry>> {
    if !path.exists() {
        return Ok(None);
    }
    let record: Recorded = serde_json::from_slice(&bytes(path, FileKind::Stored)?)
        .map_err(|error| refused(path, format!("names no probe of a frame: {error}")))?;
    let RecordedProbe { kind, depth_mm } = record.probe;
    let probe = Probe { kind, depth_mm, ..Probe::default() };
    probe.validate().map_err(|error| refused(path, format!("holds a probe out of range: {error}")))?;
    Ok(Some(ScanGeometry::fit(&probe, width, height)))
}

fn names(path: &Path) -> Result<Vec<String>> {
    let by_number: BTreeMap<usize, String> = serde_json::from_slice(&bytes(path, FileKind::Stored)?)
        .map_err(|error| refused(path, format!("is not number -> name: {error}")))?;
    if !by_number.keys().copied().eq(0..by_number.len()) {
        return Err(refused(path, "leaves out a number below its greatest"));
    }
    Ok(by_number.into_values().skip(1).collect())
}

fn floats(path: &Path, shape: [u32; 2]) -> Result<Vec<f32>> {
    let failed = FileError::at("read", path);
    let bytes = bytes(path, FileKind::Array)?;
    let file = files::npy(&bytes).map_err(failed)?;
    let shape = shape.map(u64::from);
    if file.shape() != shape {
        return Err(refused(path, format!("has the shape {:?}; the image's is {shape:?}", file.shape())));
    }
    Ok(file.into_vec().map_err(failed)?)
}
