//! `insonify evaluate`: compares images with references, and generators with their targets.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Parser;
use insonify::dataset::{Dataset, HEADER_FILE, Split, manifests};
use insonify::files::Outputs;
use insonify::generator::{FeatureScale, generator_files};
use insonify::measuring::MeasuringError;
use insonify::measuring::evaluation::{
    DatasetReport, Evaluation, FeatureModel, ImagesReport, Models, Repeat, Settings, Slide, SteadinessReport, compare,
    steadiness,
};
use insonify::quality::{CROP_COUNT, CROP_SIDE};
use insonify::render::BackendChoice;
use insonify::sink::{create_dir, write_json, write_text};
use insonify::station::Station;
use serde::Serialize;

use super::backend::BackendArgs;
use super::progress::Progress;
use super::runtime_args::RuntimeArgs;
use super::steps::Steps;
use super::{Failure, output};

/// Compare images with their references, or generators with their targets: PSNR, SSIM, pKL and Frechet distances.
///
/// Prints the mean over images and the 5th percentile (pKL: the 95th), as in the paper's table. With --dataset, prints
/// a row for the low quality and one for each generator, on random crops and on the full field of view. Further tables
/// hold the errors by tissue and behind bone. With --steadiness, prints how much generated frames flicker as the probe
/// slides.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Image, or folder of images (.png, 8-bit grey); in a folder written by `render`, the maps are left out
    #[arg(value_name = "A", required_unless_present_any = ["dataset", "steadiness"], requires = "references")]
    images: Option<PathBuf>,

    /// Reference, or folder of references with the same file names
    #[arg(value_name = "B", conflicts_with_all = ["dataset", "steadiness", "model", "again", "frames", "step"])]
    references: Option<PathBuf>,

    /// Compare only where this image isn't black: a mask for all, or a folder of masks with the images' file names
    #[arg(long, value_name = "M", conflicts_with_all = ["dataset", "steadiness"])]
    mask: Option<PathBuf>,

    /// Generator (.onnx), with its manifest in the same folder; may be repeated, the best last
    #[arg(long, value_name = "MODEL")]
    model: Vec<PathBuf>,

    /// Judge low quality and generators on the tuples of this data set (`insonify dataset` writes one)
    #[arg(long, value_name = "DIR")]
    dataset: Option<PathBuf>,

    /// Split of the data set: test, train or all
    #[arg(long, value_name = "SPLIT", default_value = "test", value_parser = ["test", "train", "all"])]
    split: String,

    /// Largest number of tuples, spread evenly over the split
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    limit: Option<u32>,

    /// Random crops of each tuple, 0..=64; 0 leaves their table out
    #[arg(long, value_name = "N", default_value_t = CROP_COUNT as u32, value_parser = clap::value_parser!(u32).range(0..=64))]
    crops: u32,

    /// Side of a crop, pixels, 16..=4096
    #[arg(long, value_name = "PIXELS", default_value_t = CROP_SIDE as u32, value_parser = clap::value_parser!(u32).range(16..=4096))]
    crop: u32,

    /// Seed of the crops' positions
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Also judge the high quality rendered again with N other seeds, 2..=64: one of these images, and their mean
    ///
    /// Their error is random, so no generator can avoid it. The mean is the best guess by PSNR; it has less speckle
    /// than any render. Takes N high-quality renders per tuple, and loads each phantom.
    #[arg(long, value_name = "N", requires = "dataset", value_parser = clap::value_parser!(u32).range(2..=64))]
    again: Option<u32>,

    /// Measure how steady frames are while the probe of this station (TOML) slides in its image plane
    #[arg(long, value_name = "STATION")]
    steadiness: Option<PathBuf>,

    /// Number of frames of the slide, 2..=1000
    #[arg(long, value_name = "N", default_value_t = 12, requires = "steadiness", value_parser = clap::value_parser!(u32).range(2..=1000))]
    frames: u32,

    /// Displacement of the probe from frame to frame, pixels, 1..=100; a pixel of the paper is 0.157 mm
    #[arg(long, value_name = "PIXELS", default_value_t = 1, requires = "steadiness", value_parser = clap::value_parser!(u32).range(1..=100))]
    step: u32,

    /// Folder for tables (table.md) and, with --dataset, pictures of the best, the median and the worst tuple
    #[arg(long, value_name = "DIR", conflicts_with = "references")]
    out: Option<PathBuf>,

    /// Also write everything as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Also write a line for each image
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,

    /// Feature extractor for the Frechet distance (.onnx): float32 [1, 1 or 3, side, side] to [1, d]
    ///
    /// With Inception v3 without its last layer (299 x 299 to 2048), the distance is the FID. It is one number for all
    /// images, without a percentile. Features come from the image's centre, cut into four crops; the mask is ignored.
    /// Data sets are also judged by the built-in network texture64.
    #[arg(long, value_name = "MODEL")]
    features: Option<PathBuf>,

    /// Scale of the extractor's input: signed (-1..1), unit (0..1) or grey (0..255)
    #[arg(long, value_name = "SCALE", default_value_t, requires = "features")]
    features_scale: FeatureScale,

    #[command(flatten)]
    backend: BackendArgs,

    #[command(flatten)]
    runtime: RuntimeArgs,
}

const AFTER_HELP: &str = "\
PSNR   10 log10(255^2 / MSE), dB. Identical images are infinitely good and are left out of its mean.
SSIM   as MATLAB's ssim: Gaussian 11 x 11, sigma 1.5, K 0.01 and 0.03, edges replicated
pKL    mean of D(B || A) over patches of 32 x 32, histograms of 50 bins with half a pixel added to each; shown x 100,
       and as - where no patch is half inside
FD     Frechet distance of the feature vectors; needs 2 crops at least. texture64 is a fixed bank of filters: no FID
All but FD are of the pixels inside the sector.

Crops of a data set are cut from what a generator makes of the full field of view; the paper runs generators on crops.
With frozen statistics both are the same but for a margin. At least half of a crop lies inside the sector.
Behind bone are the pixels of a scanline more than 2 mm deeper than its first bone (tissues named bone, calvaria, skull).

Examples:
  insonify evaluate out/lq/bmode.png out/hq/bmode.png --mask out/hq/mask.png
  insonify evaluate generated/ hq/ --mask masks/ --csv scores.csv --json scores.json
  insonify evaluate --dataset data/ --model m.onnx --model ms.onnx --model msa.onnx --out out/evaluation
  insonify evaluate --dataset data/ --model msa.onnx --again 8 --limit 20
  insonify evaluate --model msa.onnx --steadiness configs/obstetric.toml";

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    check_outputs(args)?;
    if let (Some(images), Some(references)) = (&args.images, &args.references) {
        return of_images(args, images, references);
    }
    if args.dataset.is_none() && args.csv.is_some() {
        return Err(Failure::Input(anyhow!("--csv has a line an image: it needs images, or a --dataset")));
    }
    let data = args.dataset.as_ref().map(|directory| of_dataset(args, directory)).transpose()?;
    let steady = args.steadiness.as_ref().map(|station| of_station(args, station)).transpose()?;
    write(args, data.as_ref(), steady.as_ref())
}

/// Judges low quality and generators on the data set in `directory`.
fn of_dataset(args: &Args, directory: &Path) -> Result<DatasetReport, Failure> {
    let dataset = Dataset::open(directory)?;
    let settings = Settings {
        split: match args.split.as_str() {
            "all" => None,
            "train" => Some(Split::Train),
            _ => Some(Split::Test),
        },
        limit: args.limit.map(|n| n as usize),
        crops: args.crops as usize,
        crop_side: args.crop as usize,
        seed: args.seed,
        sheets: args.out.clone(),
    };
    let evaluation = Evaluation::new(&dataset, &models(args), settings)?;
    let backend = args.again.map(|_| args.backend.open(BackendChoice::Auto)).transpose()?;
    let again = backend.as_ref().zip(args.again).map(|(backend, renders)| Repeat { backend, renders });
    let steps = Steps::new(Progress::new("evaluate", evaluation.tuples()));
    Ok(evaluation.run(again, &|step| steps.set(step))?)
}

/// Measures the steadiness of frames of the station at `path`.
fn of_station(args: &Args, path: &Path) -> Result<SteadinessReport, Failure> {
    let station = Station::load(path)?;
    let backend = args.backend.open(station.backend)?;
    let slide = Slide { frames: args.frames as usize, step_pixels: args.step };
    let steps = Steps::new(Progress::new("steadiness", 0));
    Ok(steadiness(&station, &models(args), slide, &backend, &|step| steps.set(step))?)
}

/// Models named on the command line.
fn models(args: &Args) -> Models {
    let generators = args.model.clone();
    Models {
        generators,
        provider: args.runtime.provider,
        precision: args.runtime.precision,
        threads: args.runtime.threads,
        features: features(args),
    }
}

fn features(args: &Args) -> Option<FeatureModel> {
    args.features.clone().map(|path| FeatureModel { path, scale: args.features_scale })
}

#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    dataset: Option<&'a DatasetReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    steadiness: Option<&'a SteadinessReport>,
}

/// Prints the tables of the reports and writes the requested files.
fn write(args: &Args, data: Option<&DatasetReport>, steady: Option<&SteadinessReport>) -> Result<(), Failure> {
    let mut text = String::new();
    text.extend(data.map(DatasetReport::markdown));
    text.extend(steady.map(SteadinessReport::markdown));
    output::line(text.trim_end())?;
    if let (Some(path), Some(data)) = (&args.csv, data) {
        write_text(path, &data.csv())?;
    }
    if let Some(path) = &args.json {
        write_json(path, &Report { version: env!("CARGO_PKG_VERSION"), dataset: data, steadiness: steady })?;
    }
    if let Some(out) = &args.out {
        create_dir(out)?;
        write_text(&out.join("table.md"), &text)?;
        output::line(out.join("table.md").display())?;
        data.iter().flat_map(|data| &data.sheets).try_for_each(|path| output::line(path.display()))?;
    }
    Ok(())
}

#[derive(Serialize)]
struct Printed<'a> {
    version: &'static str,
    #[serde(flatten)]
    report: &'a ImagesReport,
}

/// Compares image files or folders with their references.
fn of_images(args: &Args, images: &Path, references: &Path) -> Result<(), Failure> {
    let progress = Progress::new("evaluate", 0);
    let show = |done, total| progress.set(done, total);
    let report = match compare(images, references, args.mask.as_deref(), features(args).as_ref(), &show) {
        Err(MeasuringError::MaskFolder(_)) => {
            return Err(Failure::Input(anyhow!("--mask is a folder; two images have one mask")));
        }
        compared => compared?,
    };
    drop(progress);
    if let Some(path) = &args.csv {
        write_text(path, &report.csv())?;
    }
    if let Some(path) = &args.json {
        write_json(path, &Printed { version: env!("CARGO_PKG_VERSION"), report: &report })?;
    }
    output::text(&report)
}

/// Refuses output files that are inputs of the command.
fn check_outputs(args: &Args) -> Result<(), Failure> {
    let images = [&args.images, &args.references, &args.mask].into_iter().flatten().flat_map(|path| images_of(path));
    let dataset = args.dataset.iter().flat_map(|directory| {
        manifests(directory).unwrap_or_default().into_iter().chain([directory.join(HEADER_FILE)])
    });
    let models = args.model.iter().flat_map(|model| generator_files(model));
    let mut outputs =
        Outputs::apart_from(images).and(dataset).and(models).and(args.features.iter().chain(&args.steadiness));
    for (option, path) in [("--json", &args.json), ("--csv", &args.csv)] {
        if let Some(path) = path {
            outputs = outputs.replaced(option, path)?;
        }
    }
    if let Some(out) = &args.out {
        outputs.within("--out", out, &["table.md", "best_*.png", "median_*.png", "worst_*.png"])?;
    }
    Ok(())
}

/// The images in a folder, or the file itself.
fn images_of(path: &Path) -> Vec<PathBuf> {
    let is_image = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "png");
    match std::fs::read_dir(path) {
        Ok(entries) => entries.flatten().map(|entry| entry.path()).filter(is_image).collect(),
        Err(_) => vec![path.to_owned()],
    }
}
