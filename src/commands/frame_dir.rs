//! Reads frames that `insonify render` wrote.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use insonify::files::{self, FileKind, read_grey};
use insonify::generator::{Channel, Input, Manifest};
use insonify::settings::SettingsGroup;
use insonify::transducer::{Probe, ProbeKind, ScanGeometry};
use serde::Deserialize;

/// The maps in a directory.
pub(crate) struct FrameDir {
    pub(crate) directory: PathBuf,
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Names of tissues from number 1.
    pub(crate) tissues: Vec<String>,
    image: Option<Vec<u8>>,
    mask: Vec<u8>,
    segmentation: Option<Vec<u8>>,
    attenuation: Option<Vec<f32>>,
}

impl FrameDir {
    /// Reads mask.png and, if present, bmode.png, attenuation.npy, and segmentation.png with tissues.json.
    pub(crate) fn read(directory: &Path) -> Result<Self> {
        let (mask, [width, height]) = read_grey(&directory.join("mask.png"))?;
        let optional = |name: &str| -> Result<Option<Vec<u8>>> {
            let path = directory.join(name);
            if !path.exists() {
                return Ok(None);
            }
            let (pixels, [w, h]) = read_grey(&path)?;
            ensure!((w, h) == (width, height), "{} is {w} x {h}, mask.png {width} x {height}", path.display());
            Ok(Some(pixels))
        };
        let image = optional("bmode.png")?;
        let segmentation = optional("segmentation.png")?;
        let tissues = if segmentation.is_some() { names(&directory.join("tissues.json"))? } else { Vec::new() };
        let path = directory.join("attenuation.npy");
        let attenuation = path.exists().then(|| floats(&path, [height, width])).transpose()?;
        Ok(Self { directory: directory.to_owned(), width, height, tissues, image, mask, segmentation, attenuation })
    }

    /// Inputs of a generator with `manifest`; an error if one that it takes is missing.
    pub(crate) fn input(&self, manifest: &Manifest) -> Result<Input<'_>> {
        for (channel, there, file) in [
            (Channel::Image, self.image.is_some(), "bmode.png"),
            (Channel::Segmentation, self.segmentation.is_some(), "segmentation.png"),
            (Channel::Attenuation, self.attenuation.is_some(), "attenuation.npy"),
        ] {
            let (variant, directory) = (manifest.variant, self.directory.display());
            let is_there = there || !manifest.takes(channel);
            ensure!(is_there, "the generator is of the variant {variant:?}, and {directory} has no {file}");
        }
        // Only models in beam coordinates ask for the record.
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

/// Probe of a frame's record, as far as its pictures depend on it.
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

/// Scanlines of the frame whose record is at `path`; none without a record.
fn scan(path: &Path, [width, height]: [u32; 2]) -> Result<Option<ScanGeometry>> {
    if !path.exists() {
        return Ok(None);
    }
    let text = files::read(path, FileKind::Stored).with_context(|| format!("cannot read {}", path.display()))?;
    let record: Recorded =
        serde_json::from_slice(&text).with_context(|| format!("{} names no probe of a frame", path.display()))?;
    let RecordedProbe { kind, depth_mm } = record.probe;
    let probe = Probe { kind, depth_mm, ..Probe::default() };
    probe.validate().with_context(|| format!("{} holds a probe out of range", path.display()))?;
    Ok(Some(ScanGeometry::fit(&probe, width, height)))
}

fn names(path: &Path) -> Result<Vec<String>> {
    let text = files::read(path, FileKind::Stored).with_context(|| format!("cannot read {}", path.display()))?;
    let by_number: BTreeMap<usize, String> =
        serde_json::from_slice(&text).with_context(|| format!("{} is not number -> name", path.display()))?;
    let whole = by_number.keys().copied().eq(0..by_number.len());
    ensure!(whole, "{} leaves out a number below its greatest", path.display());
    Ok(by_number.into_values().skip(1).collect())
}

fn floats(path: &Path, shape: [u32; 2]) -> Result<Vec<f32>> {
    let context = || format!("cannot read {}", path.display());
    let bytes = files::read(path, FileKind::Array).with_context(context)?;
    let file = npyz::NpyFile::new(&bytes[..]).with_context(context)?;
    let shape = shape.map(u64::from);
    ensure!(file.shape() == shape, "{} has the shape {:?}; the image's is {shape:?}", path.display(), file.shape());
    file.into_vec().with_context(context)
}
