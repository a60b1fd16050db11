//! `insonify dataset`: paired frames to train generators on.

mod store;
mod targets;
mod tuple_renderer;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::anyhow;
use clap::Parser;
use insonify::anatomy::planes::file_beside;
use insonify::dataset::{
    ATTENUATION_POWER, CompoundingRow, Exam, ExamRow, FORMAT, HEADER_FILE, Header, Moment, PLANES, Plan, PoseRow,
    RollingRow, Row, SettingsRow, Shard, Source, Split, Wishes,
};
use insonify::render::FrameQuality;
use insonify::settings::{ANGLES_MAX, LookSettings, SettingsGroup};
use insonify::station::{PlaneScene, SceneSource, Station};
use serde::Serialize;

use super::backend::BackendArgs;
use super::output::thousands;
use super::outputs::Outputs;
use super::progress::Progress;
use super::quality::RaysLayers;
use super::{Failure, output};
use store::{Store, kept_station};
use targets::Targets;
pub(super) use tuple_renderer::{TupleRenderer, station_of};

/// Render paired frames of low and high quality with their maps, to train and judge generators.
///
/// Phantoms, sessions of simulated hands over them, and settings are drawn from the seed; key frames of a session lie far
/// apart. No session, and no phantom, is in both training and test. Each tuple can be rendered again from its row in the
/// manifest, bit for bit on the same device: --verify does so. A run that was stopped goes on where it was.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Station files (TOML): probe, image, tissues and scene; frames are shared out evenly
    #[arg(required_unless_present = "verify", conflicts_with = "verify")]
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

    /// Do part i of n, from 1/n to n/n: one job of an array; all may write to the same directory
    #[arg(long, value_name = "I/N", default_value = "1/1")]
    shard: Shard,

    /// Phantoms to draw for a station whose scene is the obstetric one; 0: its own as it is [default: one in 40 frames, 4 at least]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(..=1_000_000))]
    phantoms: Option<u32>,

    /// Tuples of a session
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=1000))]
    frames_per_exam: u32,

    /// Share of the test, above 0 and below 1: whole phantoms, else whole sessions
    #[arg(long, value_name = "X", default_value_t = 0.1)]
    test_share: f64,

    /// Rays x layers of the low quality, or a preset; of several, with commas between, tuples take one each in turn
    #[arg(long, value_name = "QUALITY", default_value = "lq", value_delimiter = ',')]
    lq: Vec<RaysLayers>,

    /// Rays x layers of the high quality, or a preset
    #[arg(long, value_name = "QUALITY", default_value = "hq")]
    hq: RaysLayers,

    /// Steering angles of the high quality: the mean of so many looks; even numbers are rounded down
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(ANGLES_MAX)))]
    angles: u32,

    /// Steering angles of the low quality: a live session's picture, the mean of its last frames with an angle each, while
    /// the hand moves, at 10 to 30 frames a second
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=i64::from(ANGLES_MAX)))]
    lq_angles: u32,

    /// Angle between the outermost directions of compounding, degrees [default: the first station's `[look] span_deg`]
    #[arg(long, value_name = "DEG", value_parser = span)]
    span: Option<f64>,

    /// Take the high quality from this data set of the same plan, for another low quality
    #[arg(long, value_name = "DIR", conflicts_with = "verify")]
    hq_from: Option<PathBuf>,

    /// Render tuples of an existing data set again, and compare them with what it holds
    #[arg(long, value_name = "DIR", conflicts_with_all = ["out", "shard"])]
    verify: Option<PathBuf>,

    /// Number of tuples to render again, spread over the data set; 0: all
    #[arg(long, value_name = "N", default_value_t = 4, requires = "verify")]
    tuples: usize,

    #[command(flatten)]
    backend: BackendArgs,

    /// Say what would be made, and make nothing
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

#[derive(Serialize)]
struct Report<'a> {
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
        (Some(directory), _) => tuple_renderer::verify(directory, &args.backend, args.tuples, args.json),
        (None, Some(out)) => make(args, out),
        (None, None) => Err(Failure::Input(anyhow!("--out is missing: the directory to write to"))),
    }
}

fn make(args: &Args, out: &PathBuf) -> Result<(), Failure> {
    let stations = args.stations.iter().map(|path| Ok(Station::load(path)?)).collect::<Result<Vec<_>, Failure>>()?;
    // A data set to take targets from must be another one.
    let read = stations.iter().flat_map(Station::files).chain(args.hq_from.iter().map(|from| from.join(HEADER_FILE)));
    Outputs::beside(read).within("--out", out, &[HEADER_FILE, "manifest*"])?;
    let is_phantom = |station: &Station| matches!(station.scene, SceneSource::ObstetricPhantom(_));
    let frames = args.frames as usize;
    let share = frames / stations.len().max(1);
    let wishes = Wishes {
        frames,
        seed: args.seed,
        phantoms: args.phantoms.map_or((share / 40).max(4), |n| n as usize),
        frames_per_exam: args.frames_per_exam as usize,
        test_share: args.test_share,
        stations: stations.iter().map(is_phantom).collect(),
    };
    let plan = Plan::new(&wishes)?;
    let exams = args.shard.of(&plan.exams);
    let classes = classes(&stations)?;
    let pair = |quality: RaysLayers| [quality.with_seed(0).rays, quality.with_seed(0).layers];
    let mut lq = args.lq.iter().copied().map(pair);
    let look = stations.first().map(|station| station.settings.look).unwrap_or_default();
    let odd = |angles| LookSettings { angles, ..LookSettings::default() }.odd_angles();
    let look = CompoundingRow {
        lq_angles: odd(args.lq_angles),
        hq_angles: odd(args.angles),
        span_deg: args.span.unwrap_or(look.span_deg),
        reach_mm: look.reach_mm,
        registration: look.registration,
    };
    let header = Header {
        format: FORMAT,
        insonify: env!("CARGO_PKG_VERSION").to_owned(),
        seed: args.seed,
        frames,
        classes,
        planes: PLANES.map(str::to_owned).to_vec(),
        attenuation_power: ATTENUATION_POWER,
        lq: lq.next().unwrap_or([1, 1]),
        lq_more: lq.collect(),
        hq: pair(args.hq),
        look,
        phantoms: wishes.phantoms,
        frames_per_exam: wishes.frames_per_exam,
        test_share: args.test_share,
        stations: stations.iter().map(kept_station).collect::<Result<_, _>>()?,
    };
    let targets = args.hq_from.as_deref().map(|from| Targets::open(from, &header)).transpose()?;
    say(args, &stations, exams, &header);
    if args.dry_run {
        return Ok(());
    }
    // The exams of a shard, and so their tuples, are consecutive.
    let ours = exams.first().zip(exams.last()).map_or(0..0, |(first, last)| first.tuples.start..last.tuples.end);
    let total = ours.len();
    let mut store = Store::open(out, &header, &stations, args.shard, ours)?;
    let started = Instant::now();
    let kept = store.done();
    let progress = Progress::new("dataset", total);
    progress.set(kept, total);
    let mut made = 0;
    if kept < total {
        let backend = args.backend.open(stations.first().map(|station| station.backend).unwrap_or_default())?;
        let mut renderer = TupleRenderer::new(&backend, header.classes.clone());
        if let Some(row) = &store.last {
            as_before(&mut renderer, out, &header, row)?;
        }
        for exam in exams {
            if exam.tuples.clone().all(|index| store.has(index)) {
                continue;
            }
            made += render_exam(&mut renderer, &mut store, exam, &stations, &header, targets.as_ref(), &mut |done| {
                progress.set(kept + made + done, total)
            })?;
        }
    }
    drop(progress);
    let (train, test) = store.splits;
    let report = Report {
        out,
        shard: args.shard.to_string(),
        made,
        kept,
        train,
        test,
        bytes: store.bytes,
        seconds: started.elapsed().as_secs_f64(),
    };
    if args.json {
        return output::json(&report);
    }
    output::line(format!(
        "{made} tuples made in {:.0} s, {kept} were there; {train} to train, {test} to test, {}",
        report.seconds,
        megabytes(report.bytes)
    ))?;
    output::line(store.path.display())
}

/// Refuses to continue a data set that this machine renders differently, checked on one tuple.
fn as_before(renderer: &mut TupleRenderer, directory: &Path, header: &Header, row: &Row) -> Result<(), Failure> {
    if renderer.agrees(directory, header, row)? {
        return Ok(());
    }
    Err(Failure::Input(anyhow!(
        "{}: tuple {} is another frame here: another version, driver or device made this data set. Give another --out, or remove it",
        directory.display(),
        row.index
    )))
}

/// Renders the missing tuples of an exam. Returns their number.
fn render_exam(
    renderer: &mut TupleRenderer,
    store: &mut Store,
    exam: &Exam,
    stations: &[Station],
    header: &Header,
    targets: Option<&Targets>,
    done: &mut dyn FnMut(usize),
) -> Result<usize, Failure> {
    let Some(station) = stations.get(exam.station) else { return Ok(0) };
    let station = with_phantom(station, exam);
    let frames_before = header.look.lq_angles - 1;
    let moments = moments(renderer, exam, &station, frames_before)?;
    let phantom = match &station.scene {
        SceneSource::ObstetricPhantom(options) => Some(*options),
        SceneSource::File(_) => None,
    };
    let settings = SettingsRow::draw(exam.seed, &station.probe, &station.settings);
    let about_planes = station_has_planes(&station);
    let mut made = 0;
    for Moment { index, time_s, pose, seed, frame_rate_hz, before } in moments {
        if store.has(index) {
            continue;
        }
        let mut row = Row {
            index,
            split: exam.split,
            station: header.stations.get(exam.station).map(|s| s.file.clone()).unwrap_or_default(),
            phantom,
            exam: ExamRow {
                number: exam.number,
                seed: exam.seed,
                skill: about_planes.then(|| exam.skill.name().to_owned()),
            },
            time_s,
            pose: (&pose).into(),
            rolling: (frames_before > 0)
                .then(|| RollingRow { frame_rate_hz, poses: before.iter().map(PoseRow::from).collect() }),
            settings,
            seed,
            lq: header.lq_of(index),
            hq: header.hq,
            look: header.look,
            size: [station.settings.image.width, station.settings.image.height],
            file: format!("tuples/{index:07}.npy"),
            mask: String::new(),
            sha256: String::new(),
        };
        let target = targets.map(|targets| targets.of(&row)).transpose()?;
        let tuple = renderer.tuple(&station, &row, target)?;
        store.keep(&mut row, &tuple)?;
        made += 1;
        done(made);
    }
    Ok(made)
}

/// The station with the exam's phantom.
fn with_phantom(station: &Station, exam: &Exam) -> Station {
    let mut station = station.clone();
    if let (SceneSource::ObstetricPhantom(options), Some(parameters)) = (&mut station.scene, exam.phantom) {
        options.parameters = parameters;
    }
    station
}

/// Whether the scene has standard planes; those of a scene file are in a file beside it.
fn station_has_planes(station: &Station) -> bool {
    station.scene_file().is_none_or(|path| file_beside(path).exists())
}

fn moments(
    renderer: &mut TupleRenderer,
    exam: &Exam,
    station: &Station,
    frames_before: u32,
) -> Result<Vec<Moment>, Failure> {
    if station_has_planes(station) {
        let scene = match station.scene_file() {
            Some(_) => PlaneScene::of(station, renderer.scene(station)?)?,
            None => PlaneScene::open(station)?,
        };
        return Ok(exam.moments(&Source::Planes(&scene.planes, &scene.skin), frames_before)?);
    }
    let pose = station.default_pose.ok_or_else(|| {
        Failure::Input(anyhow!(
            "{}: the scene has no standard planes, and the station no [pose] to wander about",
            station.path.display()
        ))
    })?;
    Ok(exam.moments(&Source::About(pose), frames_before)?)
}

/// `outside`, then every tissue of the stations, once.
fn classes(stations: &[Station]) -> Result<Vec<String>, Failure> {
    let mut classes = vec!["outside".to_owned()];
    for name in stations.iter().flat_map(|station| station.tissues.names()) {
        if !classes.contains(name) {
            classes.push(name.clone());
        }
    }
    match classes.len() {
        0..=256 => Ok(classes),
        count => Err(Failure::Input(anyhow!("the stations have {count} tissues; a data set holds 255"))),
    }
}

/// Prints the number of tuples and their size on disk.
fn say(args: &Args, stations: &[Station], exams: &[Exam], header: &Header) {
    let count = |split| exams.iter().filter(|e| e.split == split).map(|e| e.tuples.len()).sum::<usize>();
    let bytes: u64 = exams
        .iter()
        .map(|exam| {
            let image = stations.get(exam.station).map(|s| s.settings.image).unwrap_or_default();
            (exam.tuples.len() * PLANES.len()) as u64 * u64::from(image.width) * u64::from(image.height)
        })
        .sum();
    let phantoms: BTreeSet<u64> = exams.iter().filter_map(|e| e.phantom.map(|p| p.seed)).collect();
    let shard = if args.shard.of > 1 { format!(" (shard {})", args.shard) } else { String::new() };
    let (train, test) = (count(Split::Train), count(Split::Test));
    let of = if phantoms.is_empty() { String::new() } else { format!(" over {} phantoms", phantoms.len()) };
    let quality = |[rays, layers]: [u32; 2], angles| FrameQuality { angles, ..FrameQuality::new(rays, layers) };
    let lq = std::iter::once(&header.lq).chain(&header.lq_more);
    let lq = lq.map(|&lq| quality(lq, header.look.lq_angles).to_string());
    eprintln!(
        "dataset: {} tuples{shard} of {} sessions{of}: {train} to train, {test} to test; {} against {} rays x layers; {} on disk",
        thousands(train + test),
        exams.len(),
        lq.collect::<Vec<_>>().join(", "),
        quality(header.hq, header.look.hq_angles),
        megabytes(bytes)
    );
}

/// Parses `--span`.
fn span(text: &str) -> Result<f64, String> {
    let span_deg = text.parse().map_err(|_| format!("`{text}` is no number of degrees"))?;
    LookSettings { span_deg, ..LookSettings::default() }.validate().map_err(|e| e.to_string())?;
    Ok(span_deg)
}

fn megabytes(bytes: u64) -> String {
    match bytes as f64 * 1e-6 {
        mb if mb < 2000.0 => format!("{mb:.0} MB"),
        mb => format!("{:.1} GB", mb * 1e-3),
    }
}
