//! `insonify run`: runs a live session.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, anyhow};
use clap::Parser;
use insonify::files::Outputs;
use insonify::pipeline::{
    Limits, LiveStation, LocalRendererFactory, PoseSource, RecordedSlot, StandingPose, Summary, TrackedPoses, on_ctrl_c,
};
use insonify::pose::Pose;
use insonify::recording::{Recorded, stream_of};
#[cfg(feature = "window")]
use insonify::settings::Control;
use insonify::sink::frame_record::AdapterRecord;
#[cfg(feature = "window")]
use insonify::sink::window::run_on_main_thread;
use insonify::sink::{FrameLog, LiveSinkKind, SinkError};
use insonify::station::{Station, missing_calibration};
use serde::Serialize;

use super::backend::BackendArgs;
use super::effects::EffectArgs;
use super::{Classify, Failure, input, live, output, session, terminal};

/// Run a station: poses become frames, live, until Ctrl-C.
///
/// The first Ctrl-C ends the session in order and prints a summary; the second ends it at once. A closed terminal or a
/// lost connection (SIGHUP) also ends it in order, except after `nohup`.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    /// Play this recording (.mcap) instead of the station's tracker, in real time, through the same decoder,
    /// calibration and filter; the session ends with it. Settings changed in the recorded session (gain, depth, freeze
    /// ...) are ignored; `insonify replay` applies them
    #[arg(long, value_name = "FILE", conflicts_with = "pose")]
    replay: Option<PathBuf>,

    /// Hold the probe at x,y,z,qw,qx,qy,qz [default: the station's pose]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<Pose>,

    #[command(flatten)]
    effects: EffectArgs,

    #[command(flatten)]
    backend: BackendArgs,

    /// End after this many seconds, up to 31 days
    #[arg(long, value_name = "S", value_parser = input::seconds, allow_negative_numbers = true)]
    duration: Option<Duration>,

    /// End after this many frames
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    frames: Option<u64>,

    /// Sink of frames: null, png, video, browser, window, openigtlink; may be repeated [default: the station's]
    #[arg(long = "sink", value_name = "NAME")]
    sinks: Vec<LiveSinkKind>,

    /// Directory for files; made if missing
    #[arg(long, value_name = "DIR", default_value = "out/run")]
    out: PathBuf,

    /// Write a line of JSON for every presented frame to this file, and one with the summary
    #[arg(long, value_name = "FILE")]
    metrics: Option<PathBuf>,

    /// Record the tracker's bytes, poses, settings and events in this file (.mcap)
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,

    /// Replace the files of --metrics and --record if they are there
    #[arg(long)]
    force: bool,

    /// Show rendered frames, and ignore the station's generators
    #[arg(long)]
    no_generator: bool,

    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

const AFTER_HELP: &str = "\
Latencies of the summary end when a picture is handed to the displays. They begin with the first byte here of
  pose to present     the newest measurement when the frame's pose was taken
  motion to present   every measurement: also its wait for the next tick
  jump to present     a measurement out of a hand's reach: also the wait for the second one, which confirms it
They leave out the tracker before that byte, the lag of the filter, and what follows the handover: network, browser,
screen. Held poses count in none but the last. docs/metrics.md explains the fields of --metrics.

Files, by sink:
  png     png/000000.png ... and png/index.jsonl with each frame's times, pose and state
  video   video.mp4 (H.264)

Examples:
  insonify run configs/sphere.toml --duration 10 --metrics out/run/frames.jsonl
  insonify run configs/live.toml                             recorded tracker, generator, page
  insonify run configs/obstetric.toml --replay assets/exams/obstetric_sweep.mcap --sink video";

/// Output of `--json`, and the summary of `--metrics`.
#[derive(Serialize)]
struct RunSummary<'a> {
    version: &'static str,
    station: &'a Path,
    adapter: AdapterRecord,
    #[serde(flatten)]
    summary: &'a Summary,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let mut station = station(args)?;
    check_outputs(args, &station)?;
    let (poses, tracked) = pose_source(args, &station)?;
    // Refuses a recording that can't be played before anything is opened. If the session doesn't play it, it may be
    // missing.
    let stream = match &tracked {
        Some(_) => Some(stream_of(&station.tracker)?),
        None => None,
    };
    if args.record.is_some() && stream.is_none() {
        return Err(Failure::Input(anyhow!("--record keeps a tracker's bytes, and this session has no tracker")));
    }
    if tracked.is_some() {
        missing_calibration(&station.tracker, &station.calibration).iter().for_each(live::warn_of_setup);
    }
    let backend = args.backend.open(station.backend)?;
    let scene = Arc::new(session::load_scene(&station)?);
    session::warn_of_effects(&scene, &station.probe, &station.settings);
    let factory = LocalRendererFactory::new(backend.clone(), scene.clone())?;
    let mut live = LiveStation::new(&mut station, factory, poses, args.pose, !args.no_generator)?;
    live::say(&mut live);
    on_ctrl_c(&live.parts.stop, || std::process::exit(130)).context("cannot handle Ctrl-C").other()?;
    let adapter = AdapterRecord::from(&backend);
    live.open_sinks(&sinks(args, &station), &station, &scene, &args.out)?;
    live::say(&mut live);
    live.parts.log = args.metrics.as_deref().map(FrameLog::create).transpose()?;
    let log_end = args.metrics.as_deref().map(LogEnd::open).transpose()?;
    let recorded = match (&args.record, stream) {
        (Some(path), Some(stream)) => Some((path, live.record(path, &station, stream, &adapter.name)?)),
        _ => None,
    };
    if let Some(tracked) = &tracked {
        live.track(tracked, &station.tracker)?;
    }
    let limits = Limits { duration: args.duration, frames: args.frames };
    let summary = session(&station, limits, live)?;
    let report = RunSummary { version: env!("CARGO_PKG_VERSION"), station: &args.station, adapter, summary: &summary };
    let printed = print(args.json, &report);
    // A log that can't be written is reported only after the summary is printed.
    let logged = log_end.map_or(Ok(()), |end| end.write(&report));
    printed?;
    if let Some(tracked) = &tracked {
        live::say_left_out("tracker", &tracked.counters());
        tracked.needle_counters().iter().for_each(|counters| live::say_left_out("needle", counters));
    }
    let unrecorded = recorded.and_then(|(path, slot)| say_recorded(path, &slot));
    let unlogged = logged.err().map(|error| error.to_string());
    let failures: Vec<String> = [unrecorded, summary.failure(), unlogged].into_iter().flatten().collect();
    if failures.is_empty() { Ok(()) } else { Err(Failure::Other(anyhow!("{}", failures.join("; ")))) }
}

/// Prints what was recorded. Returns the reason if the recording is incomplete; otherwise `None`.
fn say_recorded(path: &Path, slot: &RecordedSlot) -> Option<String> {
    let path = path.display();
    let recorded = slot.lock().ok().and_then(|mut recorded| recorded.take());
    match recorded {
        Some(Recorded { failure: Some(failure), .. }) => Some(failure.to_string()),
        Some(done) => {
            let (bytes, frames) = (done.bytes, done.poses);
            terminal::say(&format!("recorded {bytes} bytes and the poses of {frames} frames in {path}"));
            None
        }
        None => Some(format!("{path} was not finished in time")),
    }
}

/// Refuses output files that the session reads, and existing ones without `--force`.
fn check_outputs(args: &Args, station: &Station) -> Result<(), Failure> {
    let mut outputs = Outputs::apart_from(station.files());
    if let Some(path) = &args.record {
        outputs = outputs.file("--record", path, args.force)?;
        output::recording("--record", path)?;
    }
    if let Some(path) = &args.metrics {
        outputs = outputs.log("--metrics", path, args.force)?;
    }
    let names: Vec<&str> = sinks(args, station).into_iter().flat_map(|kind| kind.files()).copied().collect();
    if !names.is_empty() {
        outputs.within("--out", &args.out, &names)?;
    }
    Ok(())
}

/// Sinks named on the command line, else those of the station.
fn sinks(args: &Args, station: &Station) -> Vec<LiveSinkKind> {
    if args.sinks.is_empty() { station.live_sinks() } else { LiveSinkKind::each_once(args.sinks.clone()) }
}

/// Source of the poses, and the tracker's poses if a tracker is used.
type Source = (Box<dyn PoseSource>, Option<TrackedPoses>);

/// Makes the source of the poses.
fn pose_source(args: &Args, station: &Station) -> Result<Source, Failure> {
    if args.pose.is_none()
        && let Some(tracked) = TrackedPoses::of_station(station)?
    {
        return Ok((Box::new(tracked.clone()), Some(tracked)));
    }
    let pose = input::pose(args.pose, station, "--replay FILE, --pose x,y,z,qw,qx,qy,qz, or a [tracker]")?;
    Ok((Box::new(StandingPose(pose)), None))
}

/// Loads the station. `--replay` replaces its tracker with a recording.
fn station(args: &Args) -> Result<Station, Failure> {
    let mut station = Station::load(&args.station)?;
    args.effects.apply(&mut station.settings);
    if let Some(path) = &args.replay {
        station.play(path);
    }
    Ok(station)
}

/// Runs the session. A window occupies the main thread meanwhile.
fn session(station: &Station, limits: Limits, live: LiveStation) -> Result<Summary, Failure> {
    // The sender must live until the end: the channel has to stay open even if no sink sends input.
    let (parts, control) = (live.parts, live.control);
    let run = move || live::run(station, limits, parts, |_| {});
    #[cfg(feature = "window")]
    if let Some(slot) = live.window {
        let window = station.window.unwrap_or_default();
        return std::thread::scope(|scope| {
            let session = scope.spawn(run);
            let shown = run_on_main_thread(slot, &window, control.clone());
            if shown.is_err() {
                // The session must not continue without its window.
                let _ = control.try_send(Control::Quit);
            }
            let summary = session.join().map_err(|_| Failure::Other(anyhow!("the session's thread panicked")))?;
            shown?;
            summary
        });
    }
    let summary = run();
    drop(control);
    summary
}

/// Prints the summary.
fn print(json: bool, report: &RunSummary<'_>) -> Result<(), Failure> {
    if json {
        return output::json(report);
    }
    output::line(format!("device             {} ({})", report.adapter.name, report.adapter.driver))?;
    output::line(report.summary)
}

/// The end of the `--metrics` log. The file is opened early, so the last line is written even if the log is renamed
/// meanwhile.
struct LogEnd<'a> {
    file: File,
    path: &'a Path,
}

/// Last line of the log: the session's summary.
#[derive(Serialize)]
struct LastLine<'a> {
    summary: &'a RunSummary<'a>,
}

impl<'a> LogEnd<'a> {
    /// Opens an existing log for appending.
    fn open(path: &'a Path) -> Result<Self, SinkError> {
        let file = File::options().append(true).open(path).map_err(SinkError::io(path))?;
        Ok(Self { file, path })
    }

    /// Appends the summary, and warns if the log is no longer at its path.
    fn write(mut self, report: &RunSummary<'_>) -> Result<(), SinkError> {
        let path = self.path;
        let json = |source| SinkError::Json { path: path.to_owned(), source };
        let mut line = serde_json::to_vec(&LastLine { summary: report }).map_err(json)?;
        line.push(b'\n');
        self.file.write_all(&line).map_err(SinkError::io(path))?;
        if !path.exists() {
            tracing::warn!("{} was renamed or deleted while the session ran", path.display());
        }
        Ok(())
    }
}
