//! `insonify run`: a live session.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, anyhow};
use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use insonify::pipeline::{
    CONTROLS_WAITING, Clock, GpuFactory, Limits, Parts, Pipeline, PoseSource, RecordedPoses, StandingPose, Status,
    Stop, Summary, SystemClock, on_ctrl_c,
};
use insonify::pose::Pose;
use insonify::render::GpuOptions;
use insonify::sink::frame_line::{source_name, tracking_name};
use insonify::sink::frame_record::AdapterRecord;
use insonify::sink::live::LiveSink;
use insonify::sink::{FrameLog, FrameRate, LiveSinkKind, LiveVideo, NullSink, PngSequence};
use insonify::station::Station;
use insonify::tracker::recording;
use serde::Serialize;

use super::run_table::SummaryTable;
use super::{Classify, Failure, output, session};

/// Time between two status lines where there is no terminal.
const LINE_INTERVAL_S: f64 = 5.0;

/// Run a station: poses become frames, live, until Ctrl-C.
///
/// The first Ctrl-C ends the session in order and prints what it did; the second ends it at once.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    /// Take the poses of this recording (.mcap), in real time; the session ends with it
    #[arg(long, value_name = "FILE", conflicts_with = "pose")]
    replay: Option<PathBuf>,

    /// Hold the probe at x,y,z,qw,qx,qy,qz [default: the station's pose]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<Pose>,

    /// End after this many seconds, up to 31 days
    #[arg(long, value_name = "S", value_parser = seconds, allow_negative_numbers = true)]
    duration: Option<Duration>,

    /// End after this many frames
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    frames: Option<u64>,

    /// Where frames go: null, png, video; may be given again [default: the station's]
    #[arg(long = "sink", value_name = "NAME")]
    sinks: Vec<LiveSinkKind>,

    /// Directory for files; made if missing
    #[arg(long, value_name = "DIR", default_value = "out/run")]
    out: PathBuf,

    /// Write a line of JSON a frame to this file, and one with the summary
    #[arg(long, value_name = "FILE")]
    metrics: Option<PathBuf>,

    /// Print the summary as JSON
    #[arg(long)]
    json: bool,
}

const AFTER_HELP: &str = "\
Files, by sink:
  png     png/000000.png ... and png/index.jsonl with each frame's times, pose and state
  video   video.mp4 where ffmpeg is on the PATH, else video.y4m

Examples:
  insonify run configs/sphere.toml --duration 10 --metrics out/run/frames.jsonl
  insonify run configs/obstetric.toml --replay assets/exams/obstetric_sweep.mcap --sink video";

/// What `--json` prints.
#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    station: &'a Path,
    adapter: AdapterRecord,
    #[serde(flatten)]
    summary: &'a Summary,
}

/// The last line of a metrics file.
#[derive(Serialize)]
struct SummaryLine<'a> {
    summary: &'a Summary,
}

fn seconds(text: &str) -> Result<Duration, String> {
    let in_range = |s: &f64| *s > 0.0 && *s <= 31.0 * 86_400.0;
    let seconds = text.parse().ok().filter(in_range).ok_or("expected seconds, above 0 and at most 2678400")?;
    Ok(Duration::from_secs_f64(seconds))
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    let (poses, length) = pose_source(args, &station)?;
    let gpu = session::open_gpu()?;
    let scene = Arc::new(session::load_scene(&station)?);
    let factory = GpuFactory::new(GpuOptions::default(), scene)?;
    let renderer = factory.build_on(&gpu, &station.probe, &station.settings)?;

    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let stop = Stop::new(&clock);
    on_ctrl_c(&stop, || std::process::exit(130)).context("cannot handle Ctrl-C").other()?;
    // The sender lives as long as the session: sinks that take input from people get clones of it.
    let (_sender, controls) = tokio::sync::mpsc::channel(CONTROLS_WAITING);
    let duration = [args.duration, length].into_iter().flatten().min();
    let parts = Parts {
        clock,
        stop,
        poses,
        renderer: Box::new(renderer),
        factory: Box::new(factory),
        probe: station.probe,
        render: station.settings,
        enhancer: None,
        sinks: sinks(args, &station)?,
        controls,
        observer: None,
        before: Vec::new(),
        after: Vec::new(),
    };
    let limits = Limits { duration, frames: args.frames };
    let mut status = StatusLine::new();
    let summary = Pipeline::run(&station.pipeline, limits, parts, |now| status.set(now)).other()?;
    status.clear();
    report(args, &summary, session::adapter(&gpu))?;
    let failed: Vec<&str> = summary.sinks.iter().filter_map(|sink| sink.error.as_deref()).collect();
    if !failed.is_empty() {
        return Err(Failure::Other(anyhow!("{}", failed.join("; "))));
    }
    match &summary.stuck[..] {
        [] => Ok(()),
        stuck => Err(Failure::Other(anyhow!("did not end in time: {}", stuck.join(", ")))),
    }
}

/// Where the poses come from, and how long they go on.
fn pose_source(args: &Args, station: &Station) -> Result<(Box<dyn PoseSource>, Option<Duration>), Failure> {
    if let Some(path) = &args.replay {
        let (poses, summary) = recording::poses(path)?;
        if !summary.is_clean() {
            eprintln!("warning: {}: {summary}", path.display());
        }
        return Ok((Box::new(RecordedPoses::new(poses)), Some(summary.duration)));
    }
    let pose = args.pose.or(station.default_pose).ok_or_else(|| {
        let station = args.station.display();
        anyhow!("no pose: give --replay FILE, --pose x,y,z,qw,qx,qy,qz, or a [pose] with position_mm and quaternion in {station}")
    });
    Ok((Box::new(StandingPose(pose.input()?)), None))
}

/// The sinks asked for, else the station's.
fn sinks(args: &Args, station: &Station) -> Result<Vec<Box<dyn LiveSink>>, Failure> {
    let mut kinds: Vec<LiveSinkKind> = Vec::new();
    for kind in if args.sinks.is_empty() { &station.sinks } else { &args.sinks } {
        if !kinds.contains(kind) {
            kinds.push(*kind);
        }
    }
    let mut sinks: Vec<Box<dyn LiveSink>> = Vec::new();
    for kind in kinds {
        sinks.push(match kind {
            LiveSinkKind::Null => Box::new(NullSink),
            LiveSinkKind::Png => Box::new(PngSequence::create(&args.out.join("png"))?),
            LiveSinkKind::Video => {
                Box::new(LiveVideo::new(&args.out.join("video"), FrameRate::new(station.pipeline.frame_rate_hz)?))
            }
        });
    }
    if let Some(path) = &args.metrics {
        sinks.push(Box::new(FrameLog::create(path)?));
    }
    Ok(sinks)
}

/// Says what the session did.
fn report(args: &Args, summary: &Summary, adapter: AdapterRecord) -> Result<(), Failure> {
    if let Some(path) = &args.metrics {
        let file = std::fs::OpenOptions::new().append(true).open(path);
        let line = serde_json::to_string(&SummaryLine { summary }).other()?;
        let written = file.and_then(|mut file| writeln!(file, "{line}"));
        written.with_context(|| format!("cannot write {}", path.display())).other()?;
    }
    if args.json {
        return output::json(&Report { version: env!("CARGO_PKG_VERSION"), station: &args.station, adapter, summary });
    }
    output::line(format!("device             {} ({})", adapter.name, adapter.driver))?;
    output::line(SummaryTable(summary))
}

/// How the session goes: a line that is overwritten on a terminal, else a line now and then.
struct StatusLine {
    bar: Option<ProgressBar>,
    next_line_s: f64,
}

impl StatusLine {
    fn new() -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new_spinner();
            if let Ok(style) = ProgressStyle::with_template("{msg}") {
                bar.set_style(style);
            }
            bar
        });
        Self { bar, next_line_s: LINE_INTERVAL_S }
    }

    fn set(&mut self, status: &Status) {
        let latency = status.latency_ms.map_or_else(|| "-".to_owned(), |ms| format!("{ms:.0} ms"));
        let frozen = if status.frozen { "  frozen" } else { "" };
        let line = format!(
            "{:7.1} s  {:5.1} frames/s  latency {latency}  pose {}  {}{frozen}  {} presented, {} dropped",
            status.elapsed_s,
            status.frames_per_s,
            tracking_name(status.tracking),
            source_name(status.source),
            status.presented,
            status.dropped,
        );
        match &self.bar {
            Some(bar) => bar.set_message(line),
            None if status.elapsed_s >= self.next_line_s => {
                self.next_line_s = status.elapsed_s + LINE_INTERVAL_S;
                eprintln!("{line}");
            }
            None => {}
        }
    }

    fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_positive_and_finite() {
        assert_eq!(seconds("1.5"), Ok(Duration::from_millis(1500)));
        for wrong in ["0", "-1", "NaN", "inf", "1e9", "ten"] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
    }
}
