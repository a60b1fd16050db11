//! `insonify dataset`: renders paired frames to train generators with.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::anyhow;
use clap::Parser;
use insonify::dataset::{Dataset, DatasetError, HEADER_FILE, Maker, Recipe, Shard, Verified};
use insonify::files::Outputs;
use insonify::names::{counted, listed};
use insonify::render::{BackendChoice, FrameQuality};
use insonify::settings::{ANGLES_MAX, LookSettings, SettingsGroup};
use insonify::station::Station;
use serde::Serialize;

use super::backend::BackendArgs;
use super::progress::Progress;
use super::steps::Steps;
use super::{Failure, output};

/// Render paired frames of low and high quality with their maps, to train and judge generators.
///
/// The seed determines phantoms, sessions of simulated hands over them, and settings; key frames of a session lie far
/// apart. Training and test share no session and no phantom. --verify renders tuples again from their rows in the
/// manifest; on the same device they are equal bit for bit. A stopped run continues where it ended; tuples with missing
/// or truncated files are made again.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Station files (TOML) with probe, image, tissues and scene; frames are divided evenly among them
    #[arg(required_unless_present = "verify", conflicts_with_all = ["verify", "tuples"])]
    stations: Vec<PathBuf>,

    /// Tuples to make, 2..=10000000
    #[arg(long, value_name = "N", default_value_t = 600, value_parser = clap::value_parser!(u32).range(2..=10_000_000))]
    frames: u32,

    /// Seed of phantoms, sessions, settings and key frames
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,

    /// Directory to write to; made if missing
    #[arg(long, value_name = "DIR", required_unless_present = "verify")]
    out: Option<PathBuf>,

    /// Make only part i of n, from 1/n to n/n, as one job of an array; all jobs may write to the same directory
    #[arg(long, value_name = "I/N", default_value = "1/1")]
    shard: Shard,

    /// Random phantoms per station with the obstetric scene; 0 keeps its own [default: one per 40 frames, at least 4]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(..=1_000_000))]
    phantoms: Option<u32>,

    /// Tuples per session
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=1000))]
    frames_per_exam: u32,

    /// Share of test tuples, above 0 and below 1; the split is by whole phantoms, else by whole sessions
    #[arg(long, value_name = "X", default_value_t = 0.1)]
    test_share: f64,

    /// Rays x layers of the low quality, or a preset; successive tuples take several, separated by commas, in turn
    #[arg(long, value_name = "QUALITY", default_value = "lq", value_delimiter = ',')]
    lq: Vec<FrameQuality>,

    /// Rays x layers of the high quality, or a preset
    #[arg(long, value_name = "QUALITY", default_value = "hq")]
    hq: FrameQuality,

    /// Steering angles compounded for the high quality; even numbers are rounded down
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(ANGLES_MAX)))]
    angles: u32,

    /// Steering angles of the low quality, compounded as in a live session: one angle from each of the last frames,
    /// while the hand moves, at 10 to 30 frames per second
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(ANGLES_MAX)))]
    lq_angles: u32,

    /// Angle between the outermost directions of compounding, degrees [default: the first station's `[look] span_deg`]
    #[arg(long, value_name = "DEG", value_parser = span)]
    span: Option<f64>,

    /// Copy the high quality from this data set, which must have the same plan; the low quality may differ
    #[arg(long, value_name = "DIR", conflicts_with = "verify")]
    hq_from: Option<PathBuf>,

    /// Render tuples of this existing data set again, and compare them and their files with the stored SHA-256
    #[arg(long, value_name = "DIR", conflicts_with_all = ["out", "shard"])]
    verify: Option<PathBuf>,

    /// Number of tuples to render again, spread over the data set; 0: all
    #[arg(long, value_name = "N", default_value_t = 4, requires = "verify")]
    tuples: usize,

    #[command(flatten)]
    backend: BackendArgs,

    /// Print the plan without making anything
    #[arg(long)]
    dry_run: bool,

    /// Print what was made as JSON
    #[arg(long)]
    json: bool,
}

const AFTER_HELP: &str = "\
Files:
  dataset.json          what holds for all: version, seed, names of the classes, qualities
  manifest.jsonl        a row a tuple: station, phantom, session, pose, settings, seed, files, SHA-256
                        (with --shard manifest.I-of-N.jsonl; readers take all of them)
  tuples/NNNNNNN.npy    uint8 [4, height, width]: LQ, HQ, number of the tissue, 255 x attenuation^(1/4)
  masks/*.npy           uint8 [height, width], 255 inside the sector
  stations/*.toml       the station files as they were

Examples:
  insonify dataset configs/obstetric.toml --frames 600 --seed 1 --out out/data
  insonify dataset configs/obstetric.toml --frames 6669 --test-share 0.1 --out /scratch/data --shard $SLURM_ARRAY_TASK_ID/64
  insonify dataset configs/obstetric.toml --hq 32x3 --angles 9 --out out/data
  insonify dataset configs/obstetric.toml --lq 1x3 --hq 32x3 --angles 9 --hq-from out/data --out out/data_1x3
  insonify dataset --verify out/data --tuples 10";

/// Largest number of faulty files that are listed.
const FAULTS_SHOWN: usize = 8;

#[derive(Serialize)]
struct MadeDataset<'a> {
    out: &'a PathBuf,
    shard: String,
    made: usize,
    kept: usize,
    train: usize,
    test: usize,
    bytes: u64,
    seconds: f64,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    match (&args.verify, &args.out) {
        (Some(directory), _) => verify(args, directory),
        (None, Some(out)) => make(args, out),
        (None, None) => Err(Failure::Input(anyhow!("--out is missing: the directory to write to"))),
    }
}

fn make(args: &Args, out: &PathBuf) -> Result<(), Failure> {
    let stations = args.stations.iter().map(|path| Ok(Station::load(path)?)).collect::<Result<Vec<_>, Failure>>()?;
    // High-quality frames can't be copied from the data set that is written.
    let read = stations.iter().flat_map(Station::files).chain(args.hq_from.iter().map(|from| from.join(HEADER_FILE)));
    Outputs::apart_from(read).within("--out", out, &[HEADER_FILE, "manifest*"])?;
    let choice = stations.first().map(|station| station.backend).unwrap_or_default();
    let pair = |quality: &FrameQuality| [quality.rays, quality.layers];
    let maker = Maker::new(Recipe {
        frames: args.frames as usize,
        seed: args.seed,
        phantoms: args.phantoms.map(|n| n as usize),
        frames_per_exam: args.frames_per_exam as usize,
        test_share: args.test_share,
        lq: args.lq.iter().map(pair).collect(),
        hq: pair(&args.hq),
        lq_angles: args.lq_angles,
        hq_angles: args.angles,
        span_deg: args.span,
        hq_from: args.hq_from.clone(),
        shard: args.shard,
        ..Recipe::new(stations)
    });
    let maker = maker.map_err(of_options)?;
    eprintln!("dataset: {maker}");
    if args.dry_run {
        return Ok(());
    }
    let mut job = maker.open(out)?;
    if job.lost() > 0 {
        let lost = counted(job.lost(), "tuple");
        eprintln!("dataset: making {lost} again: files in {} are missing or cut short", out.display());
    }
    let started = Instant::now();
    if job.missing() > 0 {
        let steps = Steps::new(Progress::new("dataset", job.total()));
        let backend = args.backend.open(choice)?;
        job.render(&backend, &|step| steps.set(step)).map_err(of_options)?;
    }
    let made = job.made();
    let report = MadeDataset {
        out,
        shard: args.shard.to_string(),
        made: made.made,
        kept: made.kept,
        train: made.train,
        test: made.test,
        bytes: made.bytes,
        seconds: started.elapsed().as_secs_f64(),
    };
    if args.json {
        return output::json(&report);
    }
    output::line(format!("{made} in {:.0} s", report.seconds))?;
    output::line(made.manifest.display())
}

/// Converts the error, with the name of the option that caused it.
fn of_options(error: DatasetError) -> Failure {
    match &error {
        DatasetError::OtherTarget { key, .. } => {
            let option = match *key {
                "look.hq_angles" => "--angles",
                "look.span_deg" => "--span",
                "seed" => "--seed",
                _ => "--hq",
            };
            Failure::Input(anyhow!("--hq-from {error}: {option} says so"))
        }
        DatasetError::Target { .. } => Failure::Input(anyhow!("--hq-from {error}")),
        _ => error.into(),
    }
}

/// Renders tuples of the data set in `directory` again, and compares them with the stored ones.
fn verify(args: &Args, directory: &Path) -> Result<(), Failure> {
    let data = Dataset::open(directory)?;
    let steps = Steps::new(Progress::new("verify", data.rows.len()));
    let backend = args.backend.open(BackendChoice::Auto)?;
    let verified = data.verify(&backend, args.tuples, &|step| steps.set(step))?;
    drop(steps);
    let Verified { tuples: total, differ, damaged, faults } = &verified;
    if args.json {
        output::json(&verified)?;
    } else {
        output::line(format!("{} of {total} tuples are the same, bit for bit", verified.same()))?;
    }
    let mut reasons = Vec::new();
    if !differ.is_empty() {
        reasons.push(format!(
            "{} of {total} tuples differ from the data set ({differ:?}): another device, driver or version made them, or the manifest \
             changed",
            differ.len()
        ));
    }
    if !damaged.is_empty() {
        reasons.push(format!(
            "files of {} of {total} tuples are missing or damaged ({}): remove the damaged ones, and run the command that made the data \
             set again",
            damaged.len(),
            listed(faults, FAULTS_SHOWN, "; ")
        ));
    }
    if reasons.is_empty() {
        return Ok(());
    }
    Err(Failure::Other(anyhow!("{}", reasons.join("; "))))
}

/// Parses the angle of `--span`, degrees.
fn span(text: &str) -> Result<f64, String> {
    let span_deg = text.parse().map_err(|_| format!("`{text}` is no number of degrees"))?;
    LookSettings { span_deg, ..LookSettings::default() }.validate().map_err(|e| e.to_string())?;
    Ok(span_deg)
}
