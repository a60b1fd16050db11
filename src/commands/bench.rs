//! `insonify bench`: times of a station's frames on this machine.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::anyhow;
use clap::Parser;
use insonify::anatomy::Bvh;
use insonify::files::Outputs;
use insonify::measuring::bench::{Measured, TraceTime, Workload, measure, measure_trace};
use insonify::pose::Pose;
use insonify::recording;
use insonify::render::RenderError;
use insonify::report::time_table::WHOLE_FRAME;
use insonify::sink::frame_record::AdapterRecord;
use insonify::sink::write_json;
use insonify::station::Station;
use insonify::statistics::evenly;
use serde::Serialize;

use super::backend::BackendArgs;
use super::progress::Progress;
use super::{Failure, input, output, session};

/// Number of workloads in the table of passes: the first four, one frame at a time, at the station's size.
const PASSES_OF: usize = 4;

/// Workloads for which both implementations of the pass `trace` are measured.
const TRACED: [&str; 2] = ["LQ", "HQ"];

/// Number of poses of a recording that are measured.
const POSES: usize = 12;

/// Measure a station's frame times on this machine: low and high quality, with and without maps, with motion, in the
/// shape of NVIDIA raysim's published benchmark, with two frames in flight, and many. Tracing by lanes is timed, too.
///
/// A frame's time runs from its pose until the whole frame is in memory. On a GPU, maps and paths are computed in
/// parallel, so the passes' sum exceeds the frame's time. Run no other programs meanwhile.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify bench configs/obstetric.toml\n  \
                        insonify bench configs/obstetric.toml --replay assets/exams/obstetric_sweep.mcap --json bench.json")]
pub(crate) struct Args {
    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    /// Take twelve poses of this recording (.mcap) in turn [default: the station's pose]
    #[arg(long, value_name = "FILE")]
    replay: Option<PathBuf>,

    /// Hold the probe at x,y,z,qw,qx,qy,qz [default: the station's pose]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true, conflicts_with = "replay")]
    pose: Option<Pose>,

    /// Frames measured of each kind, after ten uncounted ones
    #[arg(long, value_name = "N", default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: u32,

    /// Also write all times as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    #[command(flatten)]
    backend: BackendArgs,
}

#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    adapter: AdapterRecord,
    /// Number of the processor's hardware threads.
    threads: usize,
    triangles: usize,
    frames: u32,
    kinds: &'a [Measured],
    /// Times of both implementations of the pass `trace`; empty if the device has only one.
    trace: &'a [TraceTime],
}

/// Table with a line for each workload: its shape, times and rate.
fn overview(kinds: &[Measured]) -> String {
    let mut text = format!(
        "{:<22} {:>6} {:>10} {:>11} {:>5} {:>8} {:>8} {:>9}\n",
        "", "paths", "samples", "image", "maps", "p50, ms", "p95, ms", "frames/s"
    );
    for kind in kinds {
        let whole = kind.stages.iter().find(|stage| stage.stage == WHOLE_FRAME);
        let (p50, p95) = whole.map_or((0.0, 0.0), |stage| (stage.p50_ms, stage.p95_ms));
        text += &format!(
            "{:<22} {:>6} {:>10} {:>11} {:>5} {p50:>8.2} {p95:>8.2} {:>9.1}\n",
            kind.name,
            kind.quality,
            kind.lines.map(|n| n.to_string()).join("x"),
            kind.image.map(|n| n.to_string()).join("x"),
            if kind.maps { "yes" } else { "no" },
            kind.frames_per_s
        );
    }
    text + "\n"
}

/// Table of the median time of each pass, ms, with a column for each workload.
fn passes(kinds: &[Measured]) -> String {
    let mut stages: Vec<&str> = Vec::new();
    for stage in kinds.iter().flat_map(|kind| &kind.stages) {
        if !stages.contains(&stage.stage) {
            stages.push(stage.stage);
        }
    }
    let mut text = format!("{:<26}", "median, ms");
    kinds.iter().for_each(|kind| text += &format!(" {:>16}", kind.name));
    for name in stages {
        text += &format!("\n{name:<26}");
        for kind in kinds {
            let found = kind.stages.iter().find(|stage| stage.stage == name);
            text += &found.map_or(format!(" {:>16}", "-"), |stage| format!(" {:>16.2}", stage.p50_ms));
        }
    }
    text + "\n"
}

/// Table of both implementations of the pass `trace`, with a line for each workload and implementation.
fn traces(times: &[TraceTime]) -> String {
    if times.is_empty() {
        return String::new();
    }
    let mut text = format!("\n{:<26} {:>16} {:>16}\n", "median, ms", "trace", "whole frame");
    let ms = |ms: Option<f64>| ms.map_or("-".to_owned(), |ms| format!("{ms:.2}"));
    for time in times {
        let name = format!("{}, by {}", time.name, time.by);
        text += &format!("{name:<26} {:>16} {:>16}\n", ms(time.trace_ms), ms(time.whole_ms));
    }
    text
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    if let Some(path) = &args.json {
        Outputs::apart_from(station.files()).replaced("--json", path)?;
    }
    let poses = match &args.replay {
        Some(path) => {
            let (recorded, _) = recording::poses(path)?;
            if recorded.is_empty() {
                return Err(Failure::Input(anyhow!("{} holds no poses", path.display())));
            }
            evenly(POSES, recorded.len()).map(|i| recorded[i].pose).collect()
        }
        None => vec![input::pose(args.pose, &station, "--pose x,y,z,qw,qx,qy,qz, --replay FILE")?],
    };
    let backend = args.backend.open(station.backend)?;
    let scene = session::load_scene(&station)?;
    let bvh = Arc::new(Bvh::build(&scene).map_err(RenderError::from)?);
    let workloads = Workload::of(&station);
    let (mut done, frames) = (0, args.frames as usize);
    let progress = Progress::new("frames", frames * workloads.len());
    let mut kinds = Vec::new();
    for workload in &workloads {
        kinds.push(measure(&backend, &scene, &bvh, workload, &poses, frames, || {
            done += 1;
            progress.set(done, frames * workloads.len());
        })?);
    }
    drop(progress);
    let mut trace = Vec::new();
    for workload in workloads.iter().filter(|workload| TRACED.contains(&workload.name)) {
        trace.extend(measure_trace(&backend, &scene, &bvh, workload, &poses, frames)?);
    }
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let (version, adapter) = (env!("CARGO_PKG_VERSION"), AdapterRecord::from(&backend));
    if let Some(path) = &args.json {
        let (triangles, frames) = (scene.triangle_count(), args.frames);
        write_json(path, &Report { version, adapter, threads, triangles, frames, kinds: &kinds, trace: &trace })?;
    }
    output::line(format_args!("{backend}, {threads} threads, {} triangles", scene.triangle_count()))?;
    output::text(overview(&kinds))?;
    output::text(passes(&kinds[..PASSES_OF]))?;
    output::text(traces(&trace))?;
    args.json.iter().try_for_each(|path| output::line(path.display()))
}
