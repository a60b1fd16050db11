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
use sha2::{Digest, Sha256};

use super::pace::{Pace, Speed};
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

    /// How fast: max (as fast as it can), 1 (in real time), or another factor in 0.01..=1000; the frames are the same
    #[arg(long, value_name = "SPEED", default_value = "max", allow_negative_numbers = true)]
    speed: Speed,

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
pub(crate) struct FrameRange {
    start: usize,
    end: Option<usize>,
}

impl FrameRange {
    /// The frames of it that a recording of `frames` frames at `fps` has.
    pub(crate) fn within(self, frames: usize, fps: f64) -> Result<Range<usize>, Failure> {
        let end = self.end.unwrap_or(frames).min(frames);
        if self.start >= end {
            let start = self.start;
            let error = anyhow!("--frames starts at {start}, but at {fps} frames a second the recording has {frames}");
            return Err(Failure::Input(error));
        }
        Ok(self.start..end)
    }
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
    /// How far behind the wanted speed a frame was at most, s; none as fast as it can.
    #[serde(skip_serializing_if = "Option::is_none")]
    behind_s: Option<f64>,
    /// SHA-256 of image, segmentation and attenuation of all frames, in their order.
    frames_sha256: String,
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
    other_sensors: u64,
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
            other_sensors: summary.other_sensors,
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
    let Range { start, end } = args.frames.within(timeline.poses.len(), args.fps)?;
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
    let mut pace = Pace::new(args.speed, rate.fps());
    let mut hash = Sha256::new();
    let poses = &timeline.poses[start..end];
    let before = |i| pace.wait(i);
    session::render_paced(&mut renderer, poses, before, |i, frame| {
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
        hash.update(&frame.bmode);
        hash.update(&frame.segmentation);
        hash.update(bytemuck::cast_slice::<f32, u8>(&frame.attenuation));
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
        behind_s: pace.behind_s(),
        frames_sha256: hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect(),
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
    if let Some(behind_s) = report.behind_s.filter(|s| *s > 0.5 / rate.fps()) {
        output::line(format!("this machine does not keep up: frames came up to {behind_s:.2} s late"))?;
    }
    output::line(format!("\n{}\n", SideBySide(&[(&name, &times)])))?;
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
