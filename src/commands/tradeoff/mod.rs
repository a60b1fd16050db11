//! `insonify tradeoff`: frame time against image error.

mod effects;
mod eta;
pub(super) mod front;
mod identity;
mod measure;
pub(super) mod reference;
mod store;
mod truth;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::anyhow;
use clap::Parser;
use insonify::pose::Pose;
use insonify::render::{Renderer, processor_name};
use insonify::settings::ANGLES_MAX;
use insonify::sink::{create_dir, png, write_json, write_text};
use insonify::station::{Poses, Station};
use insonify::tradeoff::plot::Figure;
use insonify::tradeoff::{self, EffectTruth, Knobs, Point};
use serde::Serialize;

use self::eta::{Estimate, Eta};
use self::measure::Bench;
use self::reference::Reference;
use self::store::Store;
use super::backend::BackendArgs;
use super::outputs::Outputs;
use super::{Classify, Failure, input, output, session};

/// Measure what accuracy costs in time: sweep the quality knobs, and compare every point with a converged reference.
///
/// First renders a reference of some poses: all effects, 9 angles, the 3 layers of HQ unless more change the levels, and so many
/// rays that doubling them changes little. That change is measured and printed. Then turns rays and
/// layers in a small grid; some of its points also compounded, compounded while the probe moves as in the recording (one
/// angle a frame, as in a live session), without the aperture, and with all effects that the scene does not call for; and
/// every other knob alone about 8 x 3. A station's generators run on top of the frames that they were trained for. The
/// receiver's noise is left out: it is no error of the picture.
/// For each point: time (with maps, from the call until the frame lies in memory) and error within the sector. The front
/// goes by the error of pixels: the reference has little speckle.
///
/// A second panel compares frames of small scenes with wave theory (diffraction sums, a full-wave simulation), with and
/// without each effect that theory speaks of, and says what the effect costs in the station's scene at 1 x 1. It does the
/// same for the steps of a look: what they leave of speckle, noise and the width of a point.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    /// Folder to write to; made if missing
    #[arg(long, value_name = "DIR", default_value = "out/tradeoff")]
    out: PathBuf,

    /// Poses, spread over the recording, 1..=100 [default: 3, or as many as take about 5 minutes]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=100))]
    poses: Option<u16>,

    /// Recording (.mcap) whose poses are taken [default: the station's; without one, [pose] turned about the beam]
    #[arg(long, value_name = "FILE")]
    recording: Option<PathBuf>,

    /// Fewer points, one pose, and a reference of fewer rays
    #[arg(long)]
    quick: bool,

    #[command(flatten)]
    backend: BackendArgs,

    /// Keep what the folder holds of an earlier run of the same station, scene, models, poses, machine and version
    #[arg(long)]
    resume: bool,
}

const AFTER_HELP: &str = "\
Files:
  tradeoff.csv    a line a point: knobs, times, errors, passes
  tradeoff.json   all of it, with tissues and the reference
  tradeoff.svg    the figure, and as tradeoff.png
  tradeoff.md     tables
  effects.csv     a line an effect: errors against wave theory with and without it, cost
  looks.csv       the same for steps of a look
  points/         points as they were done, for --resume

A difference is called noise where repeats of one point differ as much: in time by the distance of the quartiles, in
error by what another seed makes.

Examples:
  insonify tradeoff configs/live.toml --out out/tradeoff
  insonify tradeoff configs/vessel_needle.toml --quick";

/// Files of a run, as in the help.
const FILES: [&str; 8] = [
    "tradeoff.csv",
    "tradeoff.json",
    "tradeoff.svg",
    "tradeoff.png",
    "tradeoff.md",
    "effects.csv",
    "looks.csv",
    "points/*",
];

/// Target duration of a run without `--poses`, s; a slowly converging reference may double it.
const TIME_S: f64 = 270.0;
/// Most poses of such a run.
const POSES: usize = 3;

#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    station: &'a Path,
    device: String,
    processor: String,
    threads: usize,
    poses: usize,
    reference: &'a reference::Check,
    points: &'a [Point],
    effects: &'a [EffectTruth],
    looks: &'a [EffectTruth],
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    Outputs::beside_station(&station).and(&args.recording).within("--out", &args.out, &FILES)?;
    let all = poses_of(&station, args.recording.as_deref())?;
    let backend = args.backend.open(station.backend)?;
    session::warn_of_budget(&station);
    let scene = session::load_scene(&station)?;
    let compounds = station.probe.kind.steers();
    let planned = tradeoff::plan(Knobs::of(&station.probe, &station.settings), compounds, all.moves(), args.quick);
    let renderer = Renderer::new(&backend, &scene, &station.probe, &station.settings)?;
    let mut bench = Bench::new(renderer, &station, &scene)?;
    let estimate = Estimate::measure(&mut bench, &planned, &all.spread(1))?;
    let device = backend.to_string();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let processor = processor_name();

    create_dir(&args.out)?;
    let mut key = vec![identity::of(&station, &scene), bench.models(), device.clone(), processor.clone()];
    key.push(format!("{threads} {} {:?}", args.quick, args.recording));
    let count = match args.poses {
        Some(count) => usize::from(count),
        None => poses_in_time(&Store::new(&args.out, args.resume, &key)?, &estimate, args.quick)?,
    };
    let period = Duration::from_secs_f64(1.0 / station.pipeline.frame_rate_hz);
    let tracks = all.tracks(count, ANGLES_MAX, period);
    let poses: Vec<Pose> = tracks.iter().map(|track| track.at).collect();
    let total_s = estimate.pose_s() * poses.len() as f64;
    eprintln!(
        "{}, {}, on {device}: about {}",
        output::counted(poses.len(), "pose"),
        all.what,
        output::duration(total_s)
    );
    key.push(format!("{tracks:?}"));
    let store = Store::new(&args.out, args.resume, &key)?;
    let mut eta = Eta::new(total_s);
    let part_s = |part_s: f64| part_s * poses.len() as f64;
    let started = Instant::now();
    let (reference, kept) = Reference::make(&mut bench, &store, &poses, args.quick)?;
    eta.done(part_s(estimate.reference_s), (!kept).then(|| started.elapsed().as_secs_f64()));
    eprintln!("{}", reference.check);
    let mut points: Vec<Point> = Vec::new();
    let generators = bench.generators();
    let generated = bench.generated_points();
    let total = planned.len() + generated.len();
    for (index, estimate_s) in estimate.points_s.iter().enumerate() {
        let generator = index.checked_sub(planned.len());
        // By number: names of generators may differ only in characters that file names lack.
        let file = generator.map_or_else(|| planned[index].name.clone(), |number| format!("generator {number}"));
        let started = Instant::now();
        let (point, taken_s) = match store.read(&file)? {
            Some(point) => (point, None),
            None => {
                let point = match generator {
                    Some(number) => {
                        let name = generators[generated[number].1].clone();
                        bench.generated(generated[number], name, &reference.truths, &tracks)?
                    }
                    None => bench.point(&planned[index], &reference.truths, &tracks)?,
                };
                store.write(&file, &point)?;
                (point, Some(started.elapsed().as_secs_f64()))
            }
        };
        eta.done(part_s(*estimate_s), taken_s);
        points.push(point);
        say(&points, total, &eta);
    }
    tradeoff::mark_front(&mut points);
    tradeoff::mark_noise(&mut points);
    let effects = effects::measure(&backend, &station, &scene, &store, &poses)?;
    let looks = effects::measure_looks(&backend, &station, &scene, &store, &poses)?;
    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        station: &args.station,
        device,
        processor,
        threads,
        poses: poses.len(),
        reference: &reference.check,
        points: &points,
        effects: &effects,
        looks: &looks,
    };
    write(&args.out, &report)
}

/// Number of poses that fit into [`TIME_S`]. A resumed run keeps its number, because estimates vary.
fn poses_in_time(store: &Store, estimate: &Estimate, quick: bool) -> Result<usize, Failure> {
    if let Some(count) = store.read::<usize>("poses")? {
        return Ok(count.clamp(1, POSES));
    }
    let most = if quick { 1 } else { POSES };
    let count = ((TIME_S / estimate.pose_s()) as usize).clamp(1, most);
    store.write("poses", &count)?;
    Ok(count)
}

fn write(out: &Path, report: &Report) -> Result<(), Failure> {
    let Report { station, device, processor, threads, poses, points, effects, looks, reference, .. } = report;
    let converged = reference.converged;
    let not = if converged { "" } else { " (reference not converged)" };
    let title =
        format!("{}{not}, {}, on {device}, {threads} threads", station.display(), output::counted(*poses, "pose"));
    write_text(&out.join("tradeoff.csv"), &tradeoff::csv(points))?;
    write_text(&out.join("effects.csv"), &tradeoff::effects_csv(effects))?;
    write_text(&out.join("looks.csv"), &tradeoff::effects_csv(looks))?;
    let both = [*effects, *looks].concat();
    let table = format!("{}\n{}", tradeoff::markdown(points), tradeoff::effects_markdown(&both));
    write_text(&out.join("tradeoff.md"), &format!("{title} of {processor}. {reference}\n\n{table}"))?;
    write_json(&out.join("tradeoff.json"), report)?;
    let failed = |e: String| anyhow!("the figure can't be drawn: {e}");
    let figure = Figure { points, effects: &both, title: &title, converged };
    let svg = tradeoff::plot::svg(&figure).map_err(failed).other()?;
    write_text(&out.join("tradeoff.svg"), &svg)?;
    let (width, height, rgb) = tradeoff::plot::rgb(&figure).map_err(failed).other()?;
    png::write_rgb(&out.join("tradeoff.png"), width, height, &rgb)?;
    output::line(table)?;
    output::line(reference)?;
    for name in ["csv", "json", "svg", "png", "md"] {
        output::line(out.join(format!("tradeoff.{name}")).display())?;
    }
    for name in ["effects.csv", "looks.csv"] {
        output::line(out.join(name).display())?;
    }
    Ok(())
}

fn say(points: &[Point], total: usize, eta: &Eta) {
    let Some(point) = points.last() else { return };
    let left =
        if points.len() < total { format!(", about {} left", output::duration(eta.left_s())) } else { String::new() };
    eprintln!(
        "[{}/{total}] {}: {:.1} ms, error {:.2}{left}",
        points.len(),
        point.name,
        point.time.median_ms,
        point.error.rmse
    );
}

/// Poses of `recording`, else of the station; an error names the option.
fn poses_of(station: &Station, recording: Option<&Path>) -> Result<Poses, Failure> {
    if recording.or(station.recording()).is_none() {
        input::pose(None, station, "--recording FILE, a recorded tracker")?;
    }
    Ok(Poses::of_station(station, recording)?)
}
