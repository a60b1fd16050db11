//! `insonify tradeoff`: what accuracy costs in time.

mod measure;
mod poses;
mod reference;
mod store;

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::anyhow;
use clap::Parser;
use insonify::render::Quality;
use insonify::sink::{SinkError, create_dir, png, write_json, write_with};
use insonify::station::Station;
use insonify::tradeoff::{self, Knobs, Planned, Point};
use serde::Serialize;

use self::measure::Bench;
use self::reference::Reference;
use self::store::Store;
use super::{Classify, Failure, output, session};

/// Measure what accuracy costs in time: sweep the quality knobs, and compare every point with a converged reference.
///
/// Renders some poses of the station with so many rays that doubling them changes little, which is checked and told, and
/// with the 3 layers of HQ unless more change the levels: every other number of layers is other speckle. Then
/// turns rays and layers in a small grid, and every other knob alone about 8 x 3; a station's generators run on top of LQ.
/// For each point: time (with maps, from the call until the frame lies in memory) and error within the sector.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    /// Folder to write to; made if missing
    #[arg(long, value_name = "DIR", default_value = "out/tradeoff")]
    out: PathBuf,

    /// Poses, spread over the recording, 1..=100 [default: 3, or as many as take 8 minutes]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=100))]
    poses: Option<u16>,

    /// Recording (.mcap) whose poses are taken [default: the station's; without one, [pose] turned about the beam]
    #[arg(long, value_name = "FILE")]
    recording: Option<PathBuf>,

    /// Fewer points, one pose, and a reference of fewer rays
    #[arg(long)]
    quick: bool,

    /// Keep what the folder holds of an earlier run of the same station, poses, device and version
    #[arg(long)]
    resume: bool,
}

const AFTER_HELP: &str = "\
Files:
  tradeoff.csv    a line a point: knobs, times, errors, passes
  tradeoff.json   all of it, with tissues and the reference
  tradeoff.svg    the figure, and as tradeoff.png
  tradeoff.md     a table
  points/         points as they were done, for --resume

A difference is called noise where repeats of one point differ as much: in time by the distance of the quartiles, in
error by what another seed makes.

Examples:
  insonify tradeoff configs/live.toml --out out/tradeoff
  insonify tradeoff configs/vessel_needle.toml --quick";

/// Time that a run without --poses shall take, s.
const TIME_S: f64 = 480.0;
/// Poses of such a run.
const POSES: usize = 3;

#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    station: &'a Path,
    device: String,
    threads: usize,
    poses: usize,
    reference: &'a reference::Check,
    points: &'a [Point],
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    let all = poses::of_station(&station, args.recording.as_deref())?;
    let gpu = session::open_gpu()?;
    session::warn_of_budget(&station);
    let scene = session::load_scene(&station)?;
    let planned = tradeoff::plan(Knobs::of(&station.probe, &station.settings), args.quick);
    let renderer = session::renderer(&gpu, &scene, &station, &station.settings)?;
    let mut bench = Bench::new(renderer, &station, &scene)?;
    let estimate = estimate(&mut bench, &planned, &all.spread(1))?;
    let most = if args.quick { 1 } else { POSES };
    let count = args.poses.map_or_else(|| ((TIME_S / estimate.pose_s) as usize).clamp(1, most), usize::from);
    let poses = all.spread(count);
    let device = format!("{} ({})", gpu.adapter_name(), gpu.driver());
    eprintln!(
        "{}, {}, on {device}: about {}",
        counted(poses.len()),
        all.what,
        minutes(estimate.pose_s * poses.len() as f64)
    );

    create_dir(&args.out)?;
    let store =
        Store::new(&args.out, args.resume, &[&identity(&station)?, &device, &format!("{poses:?} {}", args.quick)])?;
    let clock = Eta { started: Instant::now(), total_s: estimate.pose_s * poses.len() as f64 };
    let reference = Reference::make(&mut bench, &store, &poses, args.quick)?;
    eprintln!("{}", reference.check);
    let mut points: Vec<Point> = Vec::new();
    let generators = bench.generators();
    let total = planned.len() + generators.len();
    for planned in &planned {
        let point = match store.load(&planned.name)? {
            Some(point) => point,
            None => store.keep(bench.point(planned, &reference, &poses)?)?,
        };
        say(&point, points.len() + 1, total, &clock);
        points.push(point);
    }
    for (index, name) in generators.into_iter().enumerate() {
        let point = match store.load(&measure::enhanced(&name))? {
            Some(point) => point,
            None => store.keep(bench.generated(index, &reference, &poses)?)?,
        };
        say(&point, points.len() + 1, total, &clock);
        points.push(point);
    }
    tradeoff::mark_front(&mut points);
    tradeoff::mark_noise(&mut points);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        station: &args.station,
        device,
        threads,
        poses: poses.len(),
        reference: &reference.check,
        points: &points,
    };
    write(&args.out, &report)
}

fn write(out: &Path, report: &Report) -> Result<(), Failure> {
    let text = |name: &str, text: String| -> Result<(), Failure> {
        let path = out.join(name);
        let failed = |source| SinkError::Io { path: path.clone(), source };
        Ok(write_with(&path, |file| std::io::Write::write_all(file, text.as_bytes()).map_err(failed))?)
    };
    let Report { station, device, threads, poses, points, .. } = report;
    let title = format!("{}, {}, on {device}, {threads} threads", station.display(), counted(*poses));
    text("tradeoff.csv", tradeoff::csv(points))?;
    text("tradeoff.md", format!("{title}. {}\n\n{}", report.reference, tradeoff::markdown(points)))?;
    write_json(&out.join("tradeoff.json"), report)?;
    let figure = |e: String| anyhow!("the figure can't be drawn: {e}");
    text("tradeoff.svg", tradeoff::plot::svg(points, &title).map_err(figure).other()?)?;
    let (width, height, rgb) = tradeoff::plot::rgb(points, &title).map_err(figure).other()?;
    png::write_rgb(&out.join("tradeoff.png"), width, height, &rgb)?;
    output::line(tradeoff::markdown(points))?;
    for name in ["csv", "json", "svg", "png", "md"] {
        output::line(out.join(format!("tradeoff.{name}")).display())?;
    }
    Ok(())
}

/// What a run will take.
struct Estimate {
    /// For each pose, s.
    pose_s: f64,
}

/// From one frame of LQ, one of 8 × 3 and one comparison.
fn estimate(bench: &mut Bench, planned: &[Planned], pose: &[insonify::pose::Pose]) -> Result<Estimate, Failure> {
    let (lq_s, middle_s) =
        (bench.frame_s(Quality::LQ, pose)?, bench.frame_s(Quality { rays: 8, layers: 3, seed: 0 }, pose)?);
    let path_s = ((middle_s - lq_s) / 23.0).max(0.0);
    let frame_s = |paths: u32| lq_s + path_s * f64::from(paths - 1);
    let compare_s = bench.comparison_s(pose)?;
    let points: f64 =
        planned.iter().map(|p| measure::FRAMES as f64 * frame_s(p.knobs.rays * p.knobs.layers) + compare_s).sum();
    let reference: f64 = reference::USUAL.iter().map(|&(rays, layers)| frame_s(rays * layers)).sum();
    Ok(Estimate { pose_s: points + reference })
}

/// All that a station's frames depend on but for knobs and poses; the scene by its file's size and time.
fn identity(station: &Station) -> Result<String, Failure> {
    let file = station.scene_file().map(std::fs::metadata).transpose().input()?;
    let file = file.map(|m| (m.len(), m.modified().ok()));
    let Station { scene, background, motion, probe, settings, generator, tissues, .. } = station;
    Ok(format!("{scene:?} {file:?} {background} {motion} {probe:?} {settings:?} {generator:?} {tissues:?}"))
}

struct Eta {
    started: Instant,
    total_s: f64,
}

fn say(point: &Point, done: usize, total: usize, clock: &Eta) {
    // Work goes with paths more than with points; the estimate knows, what was kept does not count.
    let left_s = (clock.total_s - clock.started.elapsed().as_secs_f64()).max(0.0);
    let left = if done < total { format!(", about {} left", minutes(left_s)) } else { String::new() };
    eprintln!(
        "[{done}/{total}] {}: {:.1} ms, PSNR {:.2} dB{left}",
        point.name, point.time.median_ms, point.error.psnr_db
    );
}

fn counted(poses: usize) -> String {
    if poses == 1 { "1 pose".to_owned() } else { format!("{poses} poses") }
}

fn minutes(seconds: f64) -> String {
    if seconds < 90.0 { format!("{seconds:.0} s") } else { format!("{:.0} minutes", seconds / 60.0) }
}
