//! `insonify replay`: a recording becomes frames and a video.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Instant;

use anyhow::anyhow;
use clap::Parser;
use insonify::render::Quality;
use insonify::sink::frame_files::tissue_numbers;
use insonify::sink::frame_record::{AdapterRecord, PoseRecord, ProbeRecord, QualityRecord};
use insonify::sink::png::{self, Effort};
use insonify::sink::time_table::{SideBySide, StageTime};
use insonify::sink::{FrameRate, TimeTable, Video, npy, remove, write_json};
use insonify::station::Station;
use insonify::tracker::recording::{self, RecordingSummary};
use serde::Serialize;

use super::progress::Progress;
use super::quality::{self, RaysLayers};
use super::timeline::{Timeline, check_length};
use super::{Failure, output, session};

/// Replay a recorded session over a station's scene: a PNG a frame, and a video.
///
/// The raw tracker bytes of the recording run through the decoder of a live session. The same recording, station and seed
/// give the same frames. A truncated or damaged recording is used as far as it is whole, and what is missing is said.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Recording (.mcap)
    recording: PathBuf,

    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    /// Directory to write to; made if missing
    #[arg(long, value_name = "DIR", default_value = "out/replay")]
    out: PathBuf,

    /// lq (1x1), hq (32x3), or rays x layers: 1..=256 x 1..=33 [default: the station's own]
    #[arg(long, value_name = "QUALITY")]
    quality: Option<RaysLayers>,

    /// Seed of every random choice, 0..=4294967295 [default: the station's own]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<u32>,

    /// Frames per second of the recording, 0.1..=1000
    #[arg(long, value_name = "FPS", default_value_t = 20.0, allow_negative_numbers = true)]
    fps: f64,

    /// Only these frames: a..b (b not included), a.. or ..b
    #[arg(long, value_name = "RANGE", default_value = "..")]
    frames: FrameRange,

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
  video.mp4 or video.y4m      MP4 where ffmpeg is on the PATH, else uncompressed
  segmentation/, attenuation/ with --maps
  mask.png, tissues.json      what all frames share
  replay.json                 counts, times, and each frame's time and pose

Example:
  insonify replay assets/exams/obstetric_sweep.mcap configs/obstetric.toml --fps 10 --frames 20..60 --out out/sweep";

/// Frames `start..end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct FrameRange {
    start: usize,
    end: Option<usize>,
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |part: &str, absent| if part.is_empty() { Some(absent) } else { part.parse().ok().map(Some) };
        let parts = text.split_once("..").and_then(|(a, b)| Some((number(a, Some(0))?, number(b, None)?)));
        match parts {
            Some((start, end)) if end.is_none_or(|end| end > start.unwrap_or(0)) => {
                Ok(Self { start: start.unwrap_or(0), end })
            }
            _ => Err("expected a..b with a < b, a.. or ..b".to_owned()),
        }
    }
}

/// What a replay did.
#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    recording: RecordingReport<'a>,
    station: &'a PathBuf,
    adapter: AdapterRecord,
    probe: ProbeRecord,
    quality: QualityRecord,
    fps: f64,
    /// Frames written.
    rendered: usize,
    /// Of these, frames in gaps of the recording, which hold the last pose.
    held: usize,
    /// Frames with crossings that did not fit the buffers.
    overflowed: usize,
    /// Whole command from the first submitted frame to the last written one, s.
    wall_s: f64,
    times: Vec<StageTime>,
    video: PathBuf,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    frames: Vec<FrameEntry>,
}

/// What a recording held.
#[derive(Serialize)]
pub(crate) struct RecordingReport<'a> {
    path: String,
    device: &'a str,
    scene: &'a str,
    records: u64,
    duration_s: f64,
    /// Whether everything in the file was used.
    clean: bool,
    truncated: Option<&'a str>,
    damaged_parts: u64,
    decode_errors: u64,
    missing_records: u64,
    sequence_reversals: u64,
    time_reversals: u64,
}

#[derive(Serialize)]
struct FrameEntry {
    index: usize,
    time_s: f64,
    pose: PoseRecord,
}

impl<'a> RecordingReport<'a> {
    /// What `summary` says of the recording at `path`.
    pub(crate) fn new(path: &Path, summary: &'a RecordingSummary) -> Self {
        Self {
            path: path.display().to_string(),
            device: &summary.info.device,
            scene: &summary.info.scene,
            records: summary.records,
            duration_s: summary.duration.as_secs_f64(),
            clean: summary.is_clean(),
            truncated: summary.damage.truncated.as_deref(),
            damaged_parts: summary.damage.damaged,
            decode_errors: summary.decode_errors,
            missing_records: summary.missing_records,
            sequence_reversals: summary.sequence_reversals,
            time_reversals: summary.time_reversals,
        }
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let rate = FrameRate::new(args.fps)?;
    let station = Station::load(&args.station)?;
    let (poses, summary) = recording::poses(&args.recording)?;
    if !summary.is_clean() {
        eprintln!("warning: {}: {summary}", args.recording.display());
    }
    check_length(&poses, rate)?;
    let timeline = Timeline::new(&poses, rate);
    let frames = timeline.poses.len();
    let end = args.frames.end.unwrap_or(frames).min(frames);
    let start = args.frames.start;
    if start >= end {
        let error =
            anyhow!("--frames starts at {start}, but at {} frames a second the recording has {frames}", args.fps);
        return Err(Failure::Input(error));
    }
    let mut settings = station.settings;
    let seed = args.seed.unwrap_or(settings.quality.seed);
    settings.quality = args.quality.map_or(Quality { seed, ..settings.quality }, |q| q.with_seed(seed));

    let gpu = session::open_gpu()?;
    let scene = session::load_scene(&station)?;
    let mut renderer = session::renderer(&gpu, &scene, &station, &settings)?;

    let (width, height) = (renderer.sector().width, renderer.sector().height);
    // What an earlier replay left must not be taken for this one's.
    remove(&args.out.join("replay.json"))?;
    let left = earlier_frames(&args.out, start..end);
    if left > 0 {
        let out = args.out.display();
        eprintln!("warning: {out} holds {left} frames of an earlier replay that this one does not replace");
    }
    let mut video = Video::create(&args.out.join("video"), width, height, rate)?;
    let mut times = TimeTable::default();
    let mut overflowed = 0;
    let progress = Progress::new("replay", end - start);
    let started = Instant::now();
    session::render_all(&mut renderer, &timeline.poses[start..end], |i, frame| {
        let name = |map: &str, extension| args.out.join(map).join(format!("{:05}.{extension}", start + i));
        let (w, h) = (frame.width, frame.height);
        png::write_grey(&name("bmode", "png"), w, h, &frame.bmode, Effort::Fast)?;
        video.push(&frame.bmode)?;
        if args.maps {
            png::write_grey(&name("segmentation", "png"), w, h, &frame.segmentation, Effort::Fast)?;
            npy::write_f32(&name("attenuation", "npy"), [h as usize, w as usize], &frame.attenuation)?;
        }
        if i == 0 {
            png::write_grey(&args.out.join("mask.png"), w, h, &frame.mask, Effort::Small)?;
        }
        times.push(&frame.times);
        overflowed += usize::from(frame.overflows > 0);
        progress.set(i + 1, end - start);
        Ok(())
    })?;
    drop(progress);
    let video = video.finish()?;
    let wall_s = started.elapsed().as_secs_f64();
    write_json(&args.out.join("tissues.json"), &tissue_numbers(&scene.tissues))?;
    if overflowed > 0 {
        tracing::warn!(
            "in {overflowed} frames a few paths met more interfaces than are kept, and go on in the last medium"
        );
    }
    let entry = |index: usize| FrameEntry {
        index,
        time_s: timeline.seconds(index),
        pose: PoseRecord::from(&timeline.poses[index]),
    };
    let mut report = Report {
        version: env!("CARGO_PKG_VERSION"),
        recording: RecordingReport::new(&args.recording, &summary),
        station: &args.station,
        adapter: session::adapter(&gpu),
        probe: ProbeRecord::from(&station.probe),
        quality: QualityRecord::from(&settings),
        fps: rate.fps(),
        rendered: end - start,
        held: timeline.held_in(start..end),
        overflowed,
        wall_s,
        times: times.stages(),
        video,
        frames: (start..end).map(entry).collect(),
    };
    write_json(&args.out.join("replay.json"), &report)?;
    if args.json {
        report.frames.clear();
        return output::json(&report);
    }
    let name = quality::name(&settings.quality);
    output::line(format!("{}: {summary}", args.recording.display()))?;
    output::line(format!("{} frames at {name} in {wall_s:.1} s on {}", report.rendered, report.adapter.name))?;
    if report.held > 0 {
        output::line(format!("{} of them in gaps of the recording: they hold the last pose", report.held))?;
    }
    output::line(format!("\n{}\n", SideBySide(&[(&name, &times)])))?;
    output::line(format!("video    {}", report.video.display()))?;
    output::line(format!("frames   {}", args.out.join("bmode").display()))
}

/// Frames below `out` that `frames` will not overwrite.
fn earlier_frames(out: &Path, frames: Range<usize>) -> usize {
    let files = ["bmode", "segmentation", "attenuation"].iter().filter_map(|map| std::fs::read_dir(out.join(map)).ok());
    let numbers = files.flatten().flatten().filter_map(|file| file.path().file_stem()?.to_str()?.parse().ok());
    numbers.filter(|number| !frames.contains(number)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_understood() {
        let range = |text: &str| text.parse::<FrameRange>().map(|r| (r.start, r.end));
        assert_eq!(range("3..7"), Ok((3, Some(7))));
        assert_eq!(range("3.."), Ok((3, None)));
        assert_eq!(range("..7"), Ok((0, Some(7))));
        assert_eq!(range(".."), Ok((0, None)));
        for wrong in ["", "3", "7..3", "3..3", "..0", "a..b", "-1..3", "1...3"] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
    }
}
