//! Comparison of image files with their references.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::fmt;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::FeatureModel;
use super::models::add_features;
use super::tables::{CSV_SCORES, csv_scores};
use crate::files::{FileError, read_grey};
use crate::generator::OnnxFeatures;
use crate::measuring::MeasuringError;
use crate::measuring::table::csv_field;
use crate::names::counted;
use crate::quality::{Pair, Scores, SeenError, Summary, frechet_distance_of};

/// Record that `render` writes into a frame's folder, and the images of that folder that show maps instead of echoes.
const RECORD: &str = "frame.json";
const MAPS: [&str; 2] = ["mask.png", "segmentation.png"];

/// Scores of images against their references.
#[derive(Debug, Clone, Serialize)]
pub struct ImagesReport {
    /// Image file, or folder of images.
    pub images: PathBuf,
    /// Reference file, or folder of references.
    pub references: PathBuf,
    /// Mask file, or folder of masks.
    pub mask: Option<PathBuf>,
    /// Model file of the feature extractor.
    pub features: Option<PathBuf>,
    /// Images that were not compared: the maps in a rendered frame's folder.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
    /// Means and percentiles of the scores.
    pub summary: Summary,
    /// Fréchet distance over all images; `None` without an extractor.
    pub frechet_distance: Option<f64>,
    /// Scores of each image.
    pub scores: Vec<NamedScores>,
}

/// Scores of one image.
#[derive(Debug, Clone, Serialize)]
pub struct NamedScores {
    /// File name of the image.
    pub name: String,
    /// Scores.
    #[serde(flatten)]
    pub scores: Scores,
}

/// Files of an image, of its reference and of its mask.
struct Files {
    name: OsString,
    image: PathBuf,
    reference: PathBuf,
    mask: Option<PathBuf>,
}

/// Feature vectors of images and of references.
struct Features {
    extractor: OnnxFeatures,
    sets: [Vec<Vec<f64>>; 2],
}

impl Features {
    fn load(model: &FeatureModel) -> Result<Self, MeasuringError> {
        Ok(Self { extractor: model.load()?, sets: Default::default() })
    }

    fn add(&mut self, images: [&[u8]; 2], size: [usize; 2]) -> Result<(), MeasuringError> {
        let mut pairs = self.sets.iter_mut().zip(images);
        Ok(pairs.try_for_each(|(set, image)| add_features(&mut self.extractor, image, size, set))?)
    }
}

/// Compares `images`, a grey PNG file or a folder of them, with `references`, a file or a folder with the same file
/// names.
///
/// Only pixels where the mask isn't black count. `mask` is one file for all images, or a folder. `features` adds a
/// Fréchet distance over all images. In folders of rendered frames, maps are left out.
///
/// # Errors
/// Files that cannot be read, images without a partner or of different sizes, or a feature extractor that cannot be
/// loaded.
pub fn compare(
    images: &Path,
    references: &Path,
    mask: Option<&Path>,
    features: Option<&FeatureModel>,
    progress: &dyn Fn(usize, usize),
) -> Result<ImagesReport, MeasuringError> {
    let (files, left_out) = paired(images, references, mask)?;
    let mut network = features.map(Features::load).transpose()?;
    let mut scores = Vec::with_capacity(files.len());
    for (done, pair) in files.iter().enumerate() {
        progress(done, files.len());
        let name = pair.name.to_string_lossy().into_owned();
        let found = score(pair, network.as_mut());
        let of_image = |source| MeasuringError::Image { name: name.clone(), source: Box::new(source) };
        scores.push(NamedScores { scores: found.map_err(of_image)?, name });
    }
    let all: Vec<Scores> = scores.iter().map(|named| named.scores).collect();
    let summary = Summary::of(&all).ok_or(MeasuringError::Nothing("image"))?;
    let frechet_distance = network.map(|f| frechet_distance_of(&f.sets[0], &f.sets[1])).transpose()?;
    Ok(ImagesReport {
        images: images.to_owned(),
        references: references.to_owned(),
        mask: mask.map(Path::to_owned),
        features: features.map(|model| model.path.clone()),
        left_out,
        summary,
        frechet_distance,
        scores,
    })
}

impl ImagesReport {
    /// CSV with a line for each image: name, PSNR, SSIM, pKL, seen error and its parts.
    pub fn csv(&self) -> String {
        let mut text = format!("image,{CSV_SCORES}\n");
        for NamedScores { name, scores } in &self.scores {
            text += &format!("{},{}\n", csv_field(name), csv_scores(scores));
        }
        text
    }
}

impl fmt::Display for ImagesReport {
    /// Writes a table of means and percentiles.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Summary { images, identical, psnr_db, ssim, without_pkl, pkl, seen } = &self.summary;
        writeln!(f, "{:12} {:>9} {:>9}", "", "mean", "5/95 %")?;
        writeln!(f, "{:12} {:>9.2} {:>9.2}", "PSNR [dB]", psnr_db.mean, psnr_db.percentile)?;
        writeln!(f, "{:12} {:>9.2} {:>9.2}", "SSIM [%]", 100.0 * ssim.mean, 100.0 * ssim.percentile)?;
        match pkl {
            Some(pkl) => writeln!(f, "{:12} {:>9.2} {:>9.2}", "pKL x100", 100.0 * pkl.mean, 100.0 * pkl.percentile)?,
            None => writeln!(f, "{:12} {:>9} {:>9}", "pKL x100", "-", "-")?,
        }
        if let Some(SeenError { whole, levels, texture }) = seen {
            for (name, value) in [("seen error", whole), ("  levels", levels), ("  texture", texture)] {
                writeln!(f, "{name:12} {value:>9.2} {:>9}", "-")?;
            }
        }
        if let Some(distance) = self.frechet_distance {
            writeln!(f, "{:12} {distance:>9.2} {:>9}", "FD", "-")?;
        }
        write!(f, "{}", counted(*images, "image"))?;
        if *identical > 0 {
            write!(f, "; {identical} identical, not in the mean of PSNR")?;
        }
        if *without_pkl > 0 {
            write!(f, "; {without_pkl} without pKL and seen error, as no patch of 32 x 32 is half inside")?;
        }
        writeln!(f)?;
        match self.left_out.as_slice() {
            [] => Ok(()),
            names => writeln!(f, "left out, as maps of a rendered frame: {}", names.join(", ")),
        }
    }
}

/// Pairs two images, or the images of two folders by their names. Also returns the names of the maps that were left
/// out.
fn paired(images: &Path, references: &Path, mask: Option<&Path>) -> Result<(Vec<Files>, Vec<String>), MeasuringError> {
    if !images.is_dir() && !references.is_dir() {
        if let Some(path) = mask.filter(|mask| mask.is_dir()) {
            return Err(MeasuringError::MaskFolder(path.to_owned()));
        }
        let name = images.file_name().map_or_else(|| images.as_os_str().to_owned(), Into::into);
        let [image, reference] = [images, references].map(Path::to_owned);
        return Ok((vec![Files { name, image, reference, mask: mask.map(Path::to_owned) }], Vec::new()));
    }
    if let Some(path) = [images, references].into_iter().find(|path| !path.is_dir()) {
        return Err(MeasuringError::NoFolder(path.to_owned()));
    }
    let (mut names, mut others) = (names(images)?, names(references)?);
    let of_frame = [images, references].iter().any(|folder| folder.join(RECORD).is_file());
    let maps = MAPS.into_iter().filter(|_| of_frame);
    let left_out: Vec<String> = maps
        .filter(|&map| [&mut names, &mut others].map(|names| names.remove(OsStr::new(map))).contains(&true))
        .map(str::to_owned)
        .collect();
    if names.is_empty() {
        return Err(MeasuringError::NoImages(images.to_owned()));
    }
    let mut unpaired = only_in(images, &names, &others);
    unpaired.extend(only_in(references, &others, &names));
    if let Some(folder) = mask.filter(|m| m.is_dir()) {
        let masks = self::names(folder)?;
        let missing =
            names.difference(&masks).map(|name| format!("{} has no mask in {}", name.display(), folder.display()));
        unpaired.extend(missing);
    }
    if !unpaired.is_empty() {
        return Err(MeasuringError::Unpaired { unpaired });
    }
    let files = names.into_iter().map(|name| {
        let mask = mask.map(|m| if m.is_dir() { m.join(&name) } else { m.to_owned() });
        Files { image: images.join(&name), reference: references.join(&name), mask, name }
    });
    Ok((files.collect(), left_out))
}

fn names(folder: &Path) -> Result<BTreeSet<OsString>, MeasuringError> {
    let failed = |source| MeasuringError::Folder(FileError::at("read", folder)(source));
    let mut names = BTreeSet::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) && path.is_file() {
            names.extend(path.file_name().map(OsString::from));
        }
    }
    Ok(names)
}

fn only_in(folder: &Path, names: &BTreeSet<OsString>, others: &BTreeSet<OsString>) -> Vec<String> {
    names.difference(others).map(|name| format!("{} is only in {}", name.to_string_lossy(), folder.display())).collect()
}

fn score(files: &Files, features: Option<&mut Features>) -> Result<Scores, MeasuringError> {
    let (image, expected) = read_grey(&files.image)?;
    let same_size = |path: &PathBuf| match read_grey(path)? {
        (pixels, size) if size == expected => Ok(pixels),
        (_, size) => Err(MeasuringError::Size { path: path.clone(), size, first: files.image.clone(), expected }),
    };
    let reference = same_size(&files.reference)?;
    let mask = files.mask.as_ref().map(same_size).transpose()?;
    let size = expected.map(|n| n as usize);
    if let Some(features) = features {
        features.add([&image, &reference], size)?;
    }
    Ok(Scores::of(&Pair::new(size, &image, &reference, mask.as_deref())?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sink::png::{Effort, write_grey};

    #[test]
    fn images_are_paired_by_name_and_have_one_size() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, width: u32, level: u8| {
            let path = dir.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            write_grey(&path, width, 40, &vec![level; width as usize * 40], Effort::Small).unwrap();
        };
        let compare = |a: &str, b: &str| {
            compare(&dir.path().join(a), &dir.path().join(b), None, None, &|_, _| ()).map_err(|error| error.to_string())
        };
        ["a/1.png", "b/1.png"].iter().for_each(|name| write(name, 50, 100));
        write("a/2.png", 50, 110);
        let error = compare("a", "b").unwrap_err();
        assert!(error.contains("2.png is only in"), "{error}");
        write("b/2.png", 40, 100);
        let error = compare("a", "b").unwrap_err();
        assert!(error.starts_with("2.png: ") && error.contains("40 x 40") && error.contains("50 x 40"), "{error}");
        write("b/2.png", 50, 100);
        let report = compare("a", "b").unwrap();
        assert_eq!((report.summary.images, report.summary.identical), (2, 1));
        assert_eq!(report.csv().lines().count(), 3);
        let error = compare("a", "b/1.png").unwrap_err();
        assert!(error.contains("1.png is no folder"), "{error}");
        // Folders of rendered frames: their maps are left out.
        ["a/mask.png", "b/mask.png", "b/segmentation.png"].iter().for_each(|name| write(name, 50, 255));
        assert!(compare("a", "b").unwrap_err().contains("segmentation.png is only in"));
        std::fs::write(dir.path().join("b/frame.json"), "{}").unwrap();
        let report = compare("a", "b").unwrap();
        assert_eq!((report.summary.images, report.summary.identical), (2, 1));
        let text = report.to_string();
        assert!(text.ends_with("left out, as maps of a rendered frame: mask.png, segmentation.png\n"), "{text}");
        std::fs::create_dir(dir.path().join("c")).unwrap();
        assert!(compare("c", "c").unwrap_err().contains("holds no .png"));
    }
}
