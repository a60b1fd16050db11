//! `insonify demo`: a recorded exam over the obstetric phantom, to look at.

mod live;
mod stills;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use clap::Parser;
use insonify::anatomy::{Bvh, Scene};
use insonify::pipeline::{Clock, Stop, Summary, SystemClock, on_ctrl_c};
use insonify::pose::Pose;
use insonify::render::{Backend, Frame, Quality, RenderError, RenderSettings, Renderer};
use insonify::report::contact_sheet::{Map, Panel};
use insonify::report::time_table::{SideBySide, StageTime};
use insonify::report::{ContactSheet, TimeTable};
use insonify::sink::frame_record::AdapterRecord;
use insonify::sink::video::halved;
use insonify::sink::{FrameFiles, FrameRate, FrameRecord, Video, png, write_json};
use insonify::station::Station;
use insonify::tracker::recording::{Event, RecordingReader, poses_of};
use serde::Serialize;

use super::backend::BackendArgs;
use super::effects::EffectArgs;
use super::output::thousands;
use super::outputs::Outputs;
use super::progress::Progress;
use super::replay::RecordingReport;
use super::run_table::SummaryTable;
use super::timeline::Timeline;
use super::{Classify, Failure, output, session};

/// Station and exam are embedded, so that the demo runs from any directory.
const STATION: &str = include_str!("../../../configs/obstetric.toml");
const EXAM: &[u8] = include_bytes!("../../../assets/exams/obstetric_sweep.mcap");
const EXAM_NAME: &str = "obstetric_sweep.mcap";

/// Most rows of the contact sheet.
const KEY_FRAMES_MAX: usize = 6;
/// Least number of frames timed at HQ.
const HQ_FRAMES: usize = 20;
/// Width of an image in the contact sheet, pixels.
const PANEL_WIDTH: u32 = 520;

/// Show what insonify does: a recorded exam over a fetus of 22 weeks, live, then as frames, a video and a contact sheet.
///
/// It opens with the whole chain in real time: the tracker's recorded bytes, decoder, estimator, renderer, generator, and
/// a page for the browser, whose address is printed; then says how long each pose took to be seen, what was dropped and
/// how much was enhanced. On a terminal the exam goes on while the page is watched, until Enter; else the demo ends by
/// itself.
///
/// The first run builds the phantom of 675 000 triangles, which takes some minutes; later runs find it in the cache.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Directory to write to; made if missing
    #[arg(long, value_name = "DIR", default_value = "out/demo")]
    out: PathBuf,

    #[command(flatten)]
    effects: EffectArgs,

    #[command(flatten)]
    backend: BackendArgs,

    /// Leave the live chain out: files only
    #[arg(long)]
    no_live: bool,

    /// End the live chain with the exam, also where the page is watched
    #[arg(long, conflicts_with = "no_live")]
    once: bool,

    /// Frames per second of the exam in files, 0.1..=1000
    #[arg(long, value_name = "FPS", default_value_t = 10.0, allow_negative_numbers = true)]
    fps: f64,

    /// Print what times.json holds
    #[arg(long)]
    json: bool,
}

const AFTER_HELP: &str = "\
Files:
  live/                       of the live chain: stills, frames.jsonl with each frame's times, summary.json
  station/                    the live station with all it needs: insonify run DIR/station/configs/live.toml
  contact_sheet.png           key frames: LQ | HQ | segmentation | attenuation
  exam.mp4                    the exam at LQ, half size; H.264, plays in a browser
  key_frames/NN_name/         each key frame at HQ with its maps, and lq.png
  times.json                  p50, p95 and max of each stage, LQ and HQ

Examples:
  insonify demo
  insonify demo --no-live --out /tmp/demo --fps 5";

/// A frame of the exam that the contact sheet shows.
struct KeyFrame {
    name: String,
    time_s: f64,
    /// Time of the scene, s.
    scene_s: f64,
    pose: Pose,
}

/// Summary of the demo, for JSON.
#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    adapter: AdapterRecord,
    triangles: usize,
    surfaces: usize,
    exam: RecordingReport<'a>,
    fps: f64,
    frames_lq: usize,
    frames_hq: usize,
    key_frames: Vec<String>,
    overflowed: usize,
    times_lq: Vec<StageTime>,
    times_hq: Vec<StageTime>,
    wall_s: f64,
    video: PathBuf,
    contact_sheet: PathBuf,
    /// Summary of the live chain; `None` with `--no-live`.
    #[serde(skip_serializing_if = "Option::is_none")]
    live: Option<&'a Summary>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let started = Instant::now();
    let rate = FrameRate::new(args.fps)?;
    Outputs::default().within("--out", &args.out, &[])?;
    let mut station = Station::parse(STATION, Path::new("configs"))?;
    args.effects.apply(&mut station.settings);
    let exam_path = Path::new(EXAM_NAME);
    let (poses, summary) = poses_of(RecordingReader::from_source(EXAM, exam_path)?, exam_path)?;
    let timeline = Timeline::new(&poses, rate)?.since(summary.info.start_time_ns);
    let keys = key_frames(&summary.events, &timeline);

    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let interrupt = Stop::new(&clock);
    on_ctrl_c(&interrupt, || std::process::exit(130)).context("cannot handle Ctrl-C").other()?;
    let going_on = || if interrupt.is_requested() { Err(Failure::Interrupted) } else { Ok(()) };

    let backend = args.backend.open(station.backend)?;
    let scene = Arc::new(session::load_scene(&station)?);
    session::warn_of_effects(&scene, &station.probe, &station.settings);
    going_on()?;
    let live = if args.no_live {
        None
    } else {
        let live = live::run(args, &backend, &scene, summary.duration, &interrupt)?;
        if !args.json {
            output::line(SummaryTable(&live))?;
            output::line(format!("files              {}\n", args.out.join("live").display()))?;
        }
        eprintln!("now the exam as files");
        Some(live)
    };
    let bvh = Arc::new(Bvh::build(&scene).map_err(RenderError::from)?);
    let mut lq = Stage::new(&backend, &scene, &bvh, &station, Quality::LQ)?;
    let mut hq = Stage::new(&backend, &scene, &bvh, &station, Quality::HQ)?;
    let sector = *lq.renderer.sector();

    // Half the size keeps the video small.
    let mut video = Video::create(&args.out.join("exam"), sector.width / 4 * 2, sector.height / 4 * 2, rate)?;
    let frames = timeline.poses.len();
    let progress = Progress::new("exam at LQ", frames);
    for (i, pose) in timeline.poses.iter().enumerate() {
        going_on()?;
        let frame = lq.render(pose, timeline.scene_s(i))?;
        video.push(&halved(&frame.bmode, frame.width, frame.height).0)?;
        progress.set(i + 1, frames);
    }
    drop(progress);
    let video = video.finish()?;

    let mut sheet = ContactSheet {
        title: format!(
            "insonify {}   obstetric phantom, {} triangles   LQ: 1 ray x 1 layer   HQ: 32 rays x 3 layers",
            env!("CARGO_PKG_VERSION"),
            thousands(scene.triangle_count())
        ),
        rows: Vec::new(),
        sector: &sector,
        depth_mm: station.probe.depth_mm,
        tissues: &scene.tissues,
        panel_width: PANEL_WIDTH,
    };
    let total = HQ_FRAMES.max(keys.len());
    let progress = Progress::new("key frames", total);
    for (i, key) in keys.iter().enumerate() {
        going_on()?;
        let directory = args.out.join("key_frames").join(format!("{:02}_{}", i + 1, file_name(&key.name)));
        let row = key_frame(key, &directory, &mut lq, &mut hq, &sheet, &station, &backend)?;
        sheet.rows.push(row);
        progress.set(i + 1, total);
    }
    // Spread over the exam, so that the times are not those of a few good views.
    for (i, frame) in session::evenly(total - keys.len(), frames).enumerate() {
        going_on()?;
        hq.render(&timeline.poses[frame], timeline.scene_s(frame))?;
        progress.set(keys.len() + i + 1, total);
    }
    drop(progress);
    let contact_sheet = args.out.join("contact_sheet.png");
    sheet.write(&contact_sheet)?;

    let report = Report {
        version: env!("CARGO_PKG_VERSION"),
        adapter: session::adapter(&backend),
        triangles: scene.triangle_count(),
        surfaces: scene.surfaces.len(),
        exam: RecordingReport::new(exam_path, &summary),
        fps: rate.fps(),
        frames_lq: lq.times.frames(),
        frames_hq: hq.times.frames(),
        key_frames: keys.iter().map(|k| k.name.clone()).collect(),
        overflowed: lq.overflowed + hq.overflowed,
        times_lq: lq.times.stages(),
        times_hq: hq.times.stages(),
        wall_s: started.elapsed().as_secs_f64(),
        video,
        contact_sheet,
        live: live.as_ref(),
    };
    let times = args.out.join("times.json");
    write_json(&times, &report)?;
    session::warn_of_overflows(report.overflowed);
    if args.json {
        return output::json(&report);
    }
    let triangles = thousands(report.triangles);
    output::line(format!("device         {} ({})", report.adapter.name, report.adapter.driver))?;
    output::line(format!("scene          obstetric phantom: {triangles} triangles in {} surfaces", report.surfaces))?;
    output::line(format!("exam           {EXAM_NAME}: {summary}"))?;
    output::line(format!("rendered       {} frames at LQ, {} at HQ", report.frames_lq, report.frames_hq))?;
    output::line(format!("\n{}\n", SideBySide(&[("LQ", &lq.times), ("HQ", &hq.times)])))?;
    output::line(format!("look here      {}", report.contact_sheet.display()))?;
    output::line(format!("video          {}", report.video.display()))?;
    output::line(format!("key frames     {}", args.out.join("key_frames").display()))?;
    output::line(format!("times          {}", times.display()))
}

/// A renderer with its frame and times.
struct Stage {
    renderer: Renderer,
    settings: RenderSettings,
    frame: Frame,
    times: TimeTable,
    overflowed: usize,
}

impl Stage {
    fn new(
        backend: &Backend,
        scene: &Scene,
        bvh: &Arc<Bvh>,
        station: &Station,
        quality: Quality,
    ) -> Result<Self, Failure> {
        let quality = Quality { seed: station.settings.quality.seed, ..quality };
        let settings = RenderSettings { quality, ..station.settings };
        let renderer = Renderer::with_bvh(backend, scene, bvh.clone(), &station.probe, &settings)?;
        Ok(Self { renderer, settings, frame: Frame::default(), times: TimeTable::default(), overflowed: 0 })
    }

    /// Renders the scene at `time_s`.
    fn render(&mut self, pose: &Pose, time_s: f64) -> Result<&Frame, Failure> {
        self.renderer.set_time_s(time_s);
        self.renderer.render(pose, &mut self.frame)?;
        self.times.push(&self.frame.times);
        self.overflowed += usize::from(self.frame.overflows > 0);
        Ok(&self.frame)
    }
}

/// Renders a key frame at both qualities, writes its files and returns its row of the sheet.
fn key_frame(
    key: &KeyFrame,
    directory: &Path,
    lq: &mut Stage,
    hq: &mut Stage,
    sheet: &ContactSheet<'_>,
    station: &Station,
    backend: &Backend,
) -> Result<Vec<Panel>, Failure> {
    let bmode = Map::BMode { dynamic_range_db: station.settings.image.dynamic_range_db };
    let low = lq.render(&key.pose, key.scene_s)?;
    let lq_panel = sheet.panel(caption(&format!("{:.1} s  {}  LQ", key.time_s, key.name), low), low, bmode)?;
    png::write_grey(&directory.join("lq.png"), low.width, low.height, &low.bmode, png::Effort::Small)?;
    let high = hq.render(&key.pose, key.scene_s)?;
    let row = vec![
        lq_panel,
        sheet.panel(caption("HQ", high), high, bmode)?,
        sheet.panel("segmentation", high, Map::Segmentation)?,
        sheet.panel(format!("attenuation, 1 = {:.3}", high.attenuation_p98), high, Map::Attenuation)?,
    ];
    let (adapter, sector) = (session::adapter(backend), hq.renderer.sector());
    let plan = hq.renderer.plan();
    let record = FrameRecord::new(&hq.frame, &key.pose, &station.probe, &hq.settings, plan, sector, adapter);
    FrameFiles { frame: &hq.frame, tissues: sheet.tissues, record: &record }.write(directory)?;
    Ok(row)
}

fn caption(text: &str, frame: &Frame) -> String {
    format!("{text}  {:.0} ms", frame.times.total_ms)
}

/// The exam's events, each with the pose of its nearest frame; without events, frames spread over the exam.
fn key_frames(events: &[Event], timeline: &Timeline) -> Vec<KeyFrame> {
    let key = |name: String, frame: usize| {
        let pose = *timeline.poses.get(frame)?;
        Some(KeyFrame { name, time_s: timeline.seconds(frame), scene_s: timeline.scene_s(frame), pose })
    };
    if events.is_empty() {
        let frames = session::evenly(4, timeline.poses.len());
        return (1..).zip(frames).filter_map(|(number, frame)| key(format!("view {number}"), frame)).collect();
    }
    let named = events.iter().take(KEY_FRAMES_MAX);
    named.filter_map(|event| key(event.name.clone(), timeline.nearest(event.host_time_ns))).collect()
}

/// A name as part of a path: letters, digits and `_`.
fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '_' }).collect()
}
