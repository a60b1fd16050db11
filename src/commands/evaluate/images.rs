//! Images and their references, as files.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail, ensure};
use insonify::generator::{OnnxFeatures, Runtime};
use insonify::quality::{Pair, Scores, Summary, frechet_distance_of};
use insonify::sink::{write_json, write_text};
use insonify::tradeoff::csv_field;
use serde::Serialize;

use super::super::frame_dir::grey;
use super::super::progress::Progress;
use super::super::{Classify, Failure, output};
use super::Args;
use super::models::add_features;
use super::tables::csv_scores;

#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    images: &'a PathBuf,
    references: &'a PathBuf,
    mask: Option<&'a PathBuf>,
    features: Option<&'a PathBuf>,
    summary: Summary,
    /// Over all images, if there is an extractor.
    frechet_distance: Option<f64>,
    scores: &'a [Named],
}

#[derive(Serialize)]
struct Named {
    name: String,
    #[serde(flatten)]
    scores: Scores,
}

/// Files of an image, its reference and its mask.
struct Files {
    name: OsString,
    image: PathBuf,
    reference: PathBuf,
    mask: Option<PathBuf>,
}

/// Features of images and of references.
struct Features {
    extractor: OnnxFeatures,
    sets: [Vec<Vec<f64>>; 2],
}

impl Features {
    fn load(args: &Args) -> Result<Option<Self>, Failure> {
        let Some(path) = &args.features else { return Ok(None) };
        let extractor = OnnxFeatures::load(path, Runtime::get().input()?, args.features_scale)?;
        Ok(Some(Self { extractor, sets: Default::default() }))
    }

    fn add(&mut self, images: [&[u8]; 2], size: [usize; 2]) -> Result<()> {
        let mut pairs = self.sets.iter_mut().zip(images);
        Ok(pairs.try_for_each(|(set, image)| add_features(&mut self.extractor, image, size, set))?)
    }
}

/// Compares `images` with `references`.
pub(super) fn run(args: &Args, images: &PathBuf, references: &PathBuf) -> Result<(), Failure> {
    let files = paired(images, references, args.mask.as_ref()).input()?;
    let mut features = Features::load(args)?;
    let total = files.len();
    let progress = Progress::new("evaluate", total);
    let mut scores = Vec::with_capacity(files.len());
    for (done, files) in files.iter().enumerate() {
        progress.set(done, total);
        let name = files.name.to_string_lossy().into_owned();
        scores.push(Named { scores: score(files, features.as_mut()).with_context(|| name.clone()).input()?, name });
    }
    drop(progress);
    let all: Vec<Scores> = scores.iter().map(|named| named.scores).collect();
    let summary = Summary::of(&all).ok_or_else(|| anyhow!("there is no image")).input()?;
    let distance = features.map(|f| frechet_distance_of(&f.sets[0], &f.sets[1])).transpose()?;
    if let Some(path) = &args.csv {
        write_text(path, &csv(&scores))?;
    }
    if let Some(path) = &args.json {
        let report = Report {
            version: env!("CARGO_PKG_VERSION"),
            images,
            references,
            mask: args.mask.as_ref(),
            features: args.features.as_ref(),
            summary,
            frechet_distance: distance,
            scores: &scores,
        };
        write_json(path, &report)?;
    }
    print(&summary, distance)
}

/// Pairs two images, or the images of two folders by their names.
fn paired(images: &PathBuf, references: &PathBuf, mask: Option<&PathBuf>) -> Result<Vec<Files>> {
    if !images.is_dir() && !references.is_dir() {
        ensure!(mask.is_none_or(|m| !m.is_dir()), "--mask is a folder; two images have one mask");
        let name = images.file_name().map_or_else(|| images.clone().into_os_string(), Into::into);
        return Ok(vec![Files { name, image: images.clone(), reference: references.clone(), mask: mask.cloned() }]);
    }
    for path in [images, references] {
        ensure!(path.is_dir(), "{} is no folder; give two images or two folders", path.display());
    }
    let (names, others) = (names(images)?, names(references)?);
    ensure!(!names.is_empty(), "{} holds no .png", images.display());
    let mut unpaired = only_in(images, &names, &others);
    unpaired.extend(only_in(references, &others, &names));
    if let Some(folder) = mask.filter(|m| m.is_dir()) {
        let masks = self::names(folder)?;
        let missing =
            names.difference(&masks).map(|name| format!("{} has no mask in {}", name.display(), folder.display()));
        unpaired.extend(missing);
    }
    if !unpaired.is_empty() {
        bail!("images go by their names, and some have no partner: {}", unpaired.join(", "));
    }
    let files = names.into_iter().map(|name| {
        let mask = mask.map(|m| if m.is_dir() { m.join(&name) } else { m.clone() });
        Files { image: images.join(&name), reference: references.join(&name), mask, name }
    });
    Ok(files.collect())
}

fn names(folder: &Path) -> Result<BTreeSet<OsString>> {
    let context = || format!("cannot read {}", folder.display());
    let mut names = BTreeSet::new();
    for entry in std::fs::read_dir(folder).with_context(context)? {
        let path = entry.with_context(context)?.path();
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("png")) && path.is_file() {
            names.extend(path.file_name().map(OsString::from));
        }
    }
    Ok(names)
}

fn only_in(folder: &Path, names: &BTreeSet<OsString>, others: &BTreeSet<OsString>) -> Vec<String> {
    names.difference(others).map(|name| format!("{} is only in {}", name.to_string_lossy(), folder.display())).collect()
}

fn score(files: &Files, features: Option<&mut Features>) -> Result<Scores> {
    let (image, [width, height]) = grey(&files.image)?;
    let same_size = |path: &PathBuf| -> Result<Vec<u8>> {
        let (pixels, [w, h]) = grey(path)?;
        let (path, first) = (path.display(), files.image.display());
        ensure!((w, h) == (width, height), "{path} is {w} x {h}, {first} is {width} x {height}");
        Ok(pixels)
    };
    let reference = same_size(&files.reference)?;
    let mask = files.mask.as_ref().map(same_size).transpose()?;
    let size = [width as usize, height as usize];
    if let Some(features) = features {
        features.add([&image, &reference], size)?;
    }
    Ok(Scores::of(&Pair::new(size, &image, &reference, mask.as_deref())?))
}

fn csv(scores: &[Named]) -> String {
    let mut text = "image,psnr_db,ssim,pkl\n".to_owned();
    for Named { name, scores } in scores {
        text += &format!("{},{}\n", csv_field(name), csv_scores(scores));
    }
    text
}

fn print(summary: &Summary, distance: Option<f64>) -> Result<(), Failure> {
    let Summary { images, identical, psnr_db, ssim, without_pkl, pkl } = summary;
    output::line(format!("{:12} {:>9} {:>9}", "", "mean", "5/95 %"))?;
    let row = |name: &str, mean: f64, percentile: f64, digits: usize| {
        output::line(format!("{name:12} {mean:>9.digits$} {percentile:>9.digits$}"))
    };
    row("PSNR [dB]", psnr_db.mean, psnr_db.percentile, 2)?;
    row("SSIM [%]", 100.0 * ssim.mean, 100.0 * ssim.percentile, 2)?;
    match pkl {
        Some(pkl) => row("pKL x100", 100.0 * pkl.mean, 100.0 * pkl.percentile, 2)?,
        None => output::line(format!("{:12} {:>9} {:>9}", "pKL x100", "-", "-"))?,
    }
    if let Some(distance) = distance {
        output::line(format!("{:12} {distance:>9.2} {:>9}", "FD", "-"))?;
    }
    let mut note = String::new();
    if *identical > 0 {
        note += &format!("; {identical} identical, not in the mean of PSNR");
    }
    if *without_pkl > 0 {
        note += &format!("; {without_pkl} without pKL, as no patch of 32 x 32 is half inside");
    }
    output::line(output::counted(*images, "image") + &note)
}
