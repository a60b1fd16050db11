//! `insonify replay`: renders a recording into frames and a video.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Parser;
use insonify::files::Outputs;
use insonify::pipeline::replay::{Pace, Replay, ReplaySpeed, Stretch};
use insonify::recording::{RecordingReport, RecordingSummary};
use insonify::report::TimeTable;
use insonify::report::time_table::{SideBySide, StageTime};
use insonify::settings::{ImageSettings, LookSettings, Probe, RenderSettings};
use insonify::sink::frame_files::tissue_numbers;
use insonify::sink::frame_record::{AdapterRecord, PoseRecord};
use insonify::sink::png::{self, Effort};
use insonify::sink::{Video, npy, remove, write_json};
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::backend::BackendArgs;
use super::progress::Progress;
use super::replay_args::{ReplayArgs, choose_quality};
use super::{Failure, output, session};

/// Replay a recorded session over a station's scene: a PNG a frame, and a video.
///
/// The raw tracker bytes of the recording run through decoder, calibration and filter of a live session, each frame as if
/// it were shown at once, and what was set while it was recorded is set again at its time. Frames have the station's
/// look: compounding one angle a frame, persistence, filters, grey map. At another frame rate than the live session's,
/// compounding and persistence span another time. The same recording, station and
/// seed give the same frames, at any speed. No generator runs. A truncated or damaged recording is used as far as it is whole, and what is missing is said.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    replay: ReplayArgs,

    #[command(flatten)]
    backend: BackendArgs,

    /// Directory to write to; made if missing
    #[arg(long, value_name = "DIR", default_value = "out/replay")]
    out: PathBuf,

    /// Speed: max (no pacing), 1 (real time), or another factor in 0.01..=1000; the frames are the same
    #[arg(long, value_name = "SPEED", default_value = "max", allow_negative_numbers = true)]
    speed: ReplaySpeed,

    /// Also write each frame's segmentation (PNG) and attenuation (NPY)
    #[arg(long)]
    maps: bool,

    /// Print what replay.json holds, less its list of frames
    #[arg(long)]
    json: bool,
}

const AFTER_HELP: &str = "\
Files:
  bmode/00000.png ...         8-bit grey levels
  video.mp4                   H.264, plays in a browser
  segmentation/, attenuation/ with --maps
  mask.png, tissues.json      what all frames share; mask_00123.png where the depth changes at frame 123
  replay.json                 counts, times, the settings of each stretch of frames, and each frame's time and pose

Example:
  insonify replay assets/exams/obstetric_sweep.mcap configs/obstetric.toml --fps 10 --frames 20..60 --out out/sweep";

/// Files of a replay, as in the help.
const FILES: [&str; 9] = [
    "bmode/*.png",
    "video.mp4",
    "video.part.mp4",
    "segmentation/*.png",
    "attenuation/*.npy",
    "mask.png",
    "mask_*.png",
    "tissues.json",
    "replay.json",
];

/// Summary of a replay.
#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    recording: RecordingReport<'a>,
    station: &'a PathBuf,
    adapter: AdapterRecord,
    probe: Probe,
    quality: RenderSettings,
    fps: f64,
    /// Frames written.
    rendered: usize,
    /// Rendered frames in or just after gaps of the recording, whose poses are not exactly of their time.
    held: usize,
    /// Changes of settings by the recorded session among these frames.
    changes: usize,
    /// Stretches of frames with the same settings, in their order.
    parts: Vec<PartEntry>,
    /// Frames with crossings that did not fit the buffers.
    overflowed: usize,
    /// Whole command from the first submitted frame to the last written one, s.
    wall_s: f64,
    /// Greatest delay of a frame at the requested speed, s; `None` at full speed.
    #[serde(skip_serializing_if = "Option::is_none")]
    behind_s: Option<f64>,
    /// SHA-256 of image, segmentation and attenuation of all frames, in their order.
    frames_sha256: String,
    times: Vec<StageTime>,
    video: PathBuf,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    frames: Vec<FrameEntry>,
}

/// Frames that were rendered with the same settings.
#[derive(Serialize)]
struct PartEntry {
    /// Index of the first.
    first: usize,
    /// Number of frames.
    frames: usize,
    probe: Probe,
    quality: RenderSettings,
    look: LookSettings,
    #[serde(flatten)]
    image: ImageSettings,
}

impl From<&Stretch> for PartEntry {
    fn from(&Stretch { ref frames, probe, settings }: &Stretch) -> Self {
        Self {
            first: frames.start,
            frames: frames.len(),
            probe,
            quality: settings,
            look: settings.look,
            image: settings.image,
        }
    }
}

#[derive(Serialize)]
struct FrameEntry {
    index: usize,
    time_s: f64,
    pose: PoseRecord,
    held: bool,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let mut replay = args.replay.read()?;
    Outputs::beside(replay.station.files()).and([&args.replay.recording]).within("--out", &args.out, &FILES)?;
    let backend = args.backend.open(replay.station.backend)?;
    let scene = session::load_scene(&replay.station)?;
    choose_quality(&mut replay, &backend, &scene)?;
    let (Replay { rate, summary, timeline, .. }, Range { start, end }) = (&replay, replay.frames.clone());
    let Stretch { probe, settings, .. } = replay.first()?;

    let (width, height) = (settings.image.width, settings.image.height);
    // Output of an earlier replay must not pass for this one's.
    remove(&args.out.join("replay.json"))?;
    let left = earlier_frames(&args.out, start..end);
    if left > 0 {
        let out = args.out.display();
        tracing::warn!("{out} holds {left} frames of an earlier replay that this one does not replace");
    }
    let mut video = Video::create(&args.out.join("video"), width, height, *rate)?;
    let mut times = TimeTable::default();
    let mut overflowed = 0;
    let progress = Progress::new("replay", end - start);
    let started = Instant::now();
    let mut pace = Pace::new(args.speed, rate.fps());
    let mut hash = Sha256::new();
    let mut mask: Vec<u8> = Vec::new();
    replay.render(
        &backend,
        &scene,
        |i| pace.wait(i),
        |i, frame| {
            let name = |map: &str, extension| args.out.join(map).join(format!("{:05}.{extension}", start + i));
            let (w, h) = (frame.width, frame.height);
            png::write_grey(&name("bmode", "png"), w, h, &frame.bmode, Effort::Fast)?;
            video.push(&frame.bmode)?;
            if args.maps {
                png::write_grey(&name("segmentation", "png"), w, h, &frame.segmentation, Effort::Fast)?;
                npy::write_f32(&name("attenuation", "npy"), [h as usize, w as usize], &frame.attenuation)?;
            }
            if mask != frame.mask {
                // The sector changes with the depth.
                let name = if i == 0 { "mask.png".to_owned() } else { format!("mask_{:05}.png", start + i) };
                png::write_grey(&args.out.join(name), w, h, &frame.mask, Effort::Small)?;
                mask.clone_from(&frame.mask);
            }
            hash.update(&frame.bmode);
            hash.update(&frame.segmentation);
            hash.update(bytemuck::cast_slice::<f32, u8>(&frame.attenuation));
            times.push(&frame.times);
            overflowed += usize::from(frame.overflows > 0);
            progress.set(i + 1, end - start);
            Ok::<(), Failure>(())
        },
    )?;
    drop(progress);
    let video = video.finish()?;
    let wall_s = started.elapsed().as_secs_f64();
    write_json(&args.out.join("tissues.json"), &tissue_numbers(&scene.tissues))?;
    session::warn_of_overflows(overflowed);
    let entry = |index: usize| FrameEntry {
        index,
        time_s: timeline.seconds(index),
        pose: PoseRecord::from(&timeline.poses[index]),
        held: timeline.is_held(index),
    };
    let mut report = Report {
        version: env!("CARGO_PKG_VERSION"),
        recording: RecordingReport::new(&args.replay.recording, summary),
        station: &args.replay.station,
        adapter: AdapterRecord::from(&backend),
        probe: *probe,
        quality: *settings,
        fps: rate.fps(),
        rendered: end - start,
        held: timeline.held_in(start..end),
        changes: replay.changes(),
        parts: replay.stretches.iter().map(PartEntry::from).collect(),
        overflowed,
        wall_s,
        behind_s: pace.behind_s(),
        frames_sha256: insonify::files::hex(&hash.finalize()),
        times: times.stages(),
        video,
        frames: (start..end).map(entry).collect(),
    };
    write_json(&args.out.join("replay.json"), &report)?;
    if args.json {
        report.frames.clear();
        return output::json(&report);
    }
    print(args, &report, summary, &settings.quality.name(), &times)
}

/// Prints what was made.
fn print(
    args: &Args,
    report: &Report<'_>,
    summary: &RecordingSummary,
    name: &str,
    times: &TimeTable,
) -> Result<(), Failure> {
    output::line(format!("{}: {summary}", args.replay.recording.display()))?;
    output::line(format!("{} frames at {name} in {:.1} s on {}", report.rendered, report.wall_s, report.adapter.name))?;
    if report.held > 0 {
        output::line(format!("{} of them in gaps of the recording or just behind: they hold a pose", report.held))?;
    }
    if report.changes > 0 {
        output::line(format!("the settings change {} times, as they did in the recorded session", report.changes))?;
    }
    if let Some(behind_s) = report.behind_s.filter(|s| *s > 0.5 / report.fps) {
        output::line(format!("this machine does not keep up: frames came up to {behind_s:.2} s late"))?;
    }
    output::line(format!("\n{}\n", SideBySide(&[(name, times)])))?;
    output::line(format!("sha256   {} (of all frames)", report.frames_sha256))?;
    output::line(format!("video    {}", report.video.display()))?;
    output::line(format!("frames   {}", args.out.join("bmode").display()))
}

/// Frames below `out` that `frames` will not overwrite.
fn earlier_frames(out: &Path, frames: Range<usize>) -> usize {
    let files = ["bmode", "segmentation", "attenuation"].iter().filter_map(|map| std::fs::read_dir(out.join(map)).ok());
    let numbers = files.flatten().flatten().filter_map(|file| file.path().file_stem()?.to_str()?.parse().ok());
    numbers.filter(|number| !frames.contains(number)).count()
}
