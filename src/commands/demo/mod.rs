//! `insonify demo`: plays a recorded exam of the obstetric phantom.

mod live;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use anyhow::Context;
use clap::Parser;
use insonify::anatomy::{Bvh, Scene};
use insonify::chooser::{Translation, TranslationReport};
use insonify::files::Outputs;
use insonify::names::thousands;
use insonify::pipeline::replay::{Agreement, KeyFrames, KeyScores, Stage, Timeline, key_frames, legend};
use insonify::pipeline::{Clock, Stop, Summary, SystemClock, on_ctrl_c};
use insonify::recording::{RecordingReader, RecordingReport, RecordingSummary, poses_of};
use insonify::render::{Backend, FrameQuality, RenderError, warn_of_overflows};
use insonify::report::time_table::{SideBySide, StageTime, TimeTable};
use insonify::report::{ContactSheet, OtherLoad};
use insonify::sink::frame_record::AdapterRecord;
use insonify::sink::video::halved;
use insonify::sink::{FrameRate, Video, write_json};
use insonify::station::Station;
use insonify::statistics::evenly;
use serde::Serialize;

use super::backend::BackendArgs;
use super::effects::EffectArgs;
use super::progress::Progress;
use super::{Classify, Failure, output, session};

/// Files of the station and of the recorded exam, embedded so that the demo runs from any directory.
const STATION: &str = include_str!("../../../configs/obstetric.toml");
const EXAM: &[u8] = include_bytes!("../../../assets/exams/obstetric_sweep.mcap");
const EXAM_NAME: &str = "obstetric_sweep.mcap";

/// Number of frames timed with the generator and at high quality. They are spread over the exam, because simple views
/// take less time.
const TIMED: usize = 20;
/// High quality with one steering angle. The contact sheet instead shows the quality that the generator was trained
/// for.
const HQ: FrameQuality = FrameQuality::new(32, 3);
/// Width of an image in the contact sheet, pixels.
const PANEL_WIDTH: u32 = 440;

/// Show what insonify does: a recorded exam over a fetus of 22 weeks, live, then as frames, a video and a contact sheet.
///
/// First, the whole chain runs in real time: the tracker's recorded bytes, decoder, estimator, renderer, generator, and
/// a browser page whose address is printed. Then the demo prints latency, dropped frames, the number of generated
/// frames, and why a generator ran or not. On a terminal, the exam repeats while the page is watched, until Enter is
/// pressed; else the demo ends by itself.
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

    /// Skip the live chain, and only write the files
    #[arg(long)]
    no_live: bool,

    /// End the live chain with the exam, even if the page is watched
    #[arg(long, conflicts_with = "no_live")]
    once: bool,

    /// Frames per second of the exam in files, 0.1..=1000
    #[arg(long, value_name = "FPS", default_value_t = 10.0, allow_negative_numbers = true)]
    fps: f64,

    /// Print the contents of times.json
    #[arg(long)]
    json: bool,
}

const AFTER_HELP: &str = "\
Files:
  live/                       of the live chain: stills, frames.jsonl with each frame's times, summary.json
  station/                    the live station with all it needs: insonify run DIR/station/configs/live.toml
  contact_sheet.png           key frames: LQ | translated from LQ | HQ | segmentation | attenuation
  exam.mp4                    the exam at LQ, half size; H.264, plays in a browser
  key_frames/NN_name/         each key frame at HQ with its maps, lq.png and translated.png
  times.json                  p50, p95 and max of each stage and of the generator; PSNR and SSIM of the key frames

The generator of the contact sheet is the shipped one with the least error on LQ frames. HQ is what it was trained to give,
a mean of several steering angles. Without ONNX Runtime the sheet has no translated images, and HQ is one angle.

Examples:
  insonify demo
  insonify demo --no-live --out /tmp/demo --fps 5";

/// Summary of the demo, for JSON.
#[derive(Serialize)]
struct DemoSummary<'a> {
    version: &'static str,
    adapter: AdapterRecord,
    triangles: usize,
    surfaces: usize,
    exam: RecordingReport<'a>,
    fps: f64,
    frames_lq: usize,
    frames_hq: usize,
    /// Frame quality shown in the column HQ of the contact sheet.
    target: FrameQuality,
    /// Generator of the contact sheet; `None` if the generator is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    generator: Option<TranslationReport>,
    key_frames: &'a [KeyScores],
    overflowed: usize,
    /// Times of frames at low quality, with the generator's runs.
    times_lq: Vec<StageTime>,
    /// Times of frames at high quality with one steering angle.
    times_hq: Vec<StageTime>,
    /// Times of the key frames at the quality `target`.
    times_target: Vec<StageTime>,
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
    let live = if args.no_live { None } else { Some(live_chain(args, &backend, &scene, &summary, &interrupt)?) };
    let bvh = Arc::new(Bvh::build(&scene).map_err(RenderError::from)?);
    let mut lq = Stage::new(&backend, &scene, &bvh, &station, FrameQuality::LQ)?;
    let mut hq = Stage::new(&backend, &scene, &bvh, &station, HQ)?;
    let sector = *lq.renderer.sector();
    let refused = |reason: &_| tracing::warn!("the contact sheet has no translated images: {reason}");
    let mut translation = Translation::load(&station, scene.tissues.names(), &sector).inspect_err(refused).ok();

    // Halving the size keeps the video small.
    let mut video = Video::create(&args.out.join("exam"), sector.width / 4 * 2, sector.height / 4 * 2, rate)?;
    let timed: Vec<usize> = evenly(TIMED, timeline.poses.len()).collect();
    let load = OtherLoad::begin();
    film(&mut lq, translation.as_mut(), &timeline, &timed, &mut video, &going_on)?;
    let video = video.finish()?;
    time_frames(&mut hq, &timeline, &timed, &going_on)?;
    load.warn();
    let times_hq = std::mem::take(&mut hq.times);

    let target = translation.as_ref().map_or(HQ, |translation| translation.target);
    hq.reconfigure(&station, target)?;
    let triangles = thousands(scene.triangle_count());
    let mut sheet = ContactSheet {
        title: format!("insonify {}   obstetric phantom, {triangles} triangles", env!("CARGO_PKG_VERSION")),
        notes: legend(target, translation.as_ref().map(Translation::name)),
        rows: Vec::new(),
        sector: &sector,
        depth_mm: station.probe.depth_mm,
        tissues: &scene.tissues,
        panel_width: PANEL_WIDTH,
    };
    let mut rows = KeyFrames { lq, hq, translation, station: &station, backend: &backend };
    let mut scores = Vec::with_capacity(keys.len());
    let progress = Progress::new("key frames", keys.len());
    for (i, key) in keys.iter().enumerate() {
        going_on()?;
        let directory = args.out.join("key_frames").join(format!("{:02}_{}", i + 1, key.file_name()));
        let (row, score) = rows.render(key, &directory, &sheet)?;
        sheet.rows.push(row);
        scores.push(score);
        progress.set(i + 1, keys.len());
    }
    drop(progress);
    let KeyFrames { lq, hq, translation, .. } = rows;
    let contact_sheet = args.out.join("contact_sheet.png");
    sheet.write(&contact_sheet)?;

    let report = DemoSummary {
        version: env!("CARGO_PKG_VERSION"),
        adapter: AdapterRecord::from(&backend),
        triangles: scene.triangle_count(),
        surfaces: scene.surfaces.len(),
        exam: RecordingReport::new(exam_path, &summary),
        fps: rate.fps(),
        frames_lq: lq.times.frames(),
        frames_hq: times_hq.frames(),
        target,
        generator: translation.as_ref().map(Translation::report),
        key_frames: &scores,
        overflowed: lq.overflowed + hq.overflowed,
        times_lq: lq.times.stages(),
        times_hq: times_hq.stages(),
        times_target: hq.times.stages(),
        wall_s: started.elapsed().as_secs_f64(),
        video,
        contact_sheet,
        live: live.as_ref(),
    };
    let times = args.out.join("times.json");
    write_json(&times, &report)?;
    warn_of_overflows(report.overflowed);
    if args.json {
        return output::json(&report);
    }
    let columns = [&lq.times, &times_hq, &hq.times];
    print(&report, &summary, columns, translation.as_ref().map(Translation::name))?;
    output::line(format!("key frames     {}", args.out.join("key_frames").display()))?;
    output::line(format!("times          {}", times.display()))
}

/// Renders the exam as a video at low quality. The generator also translates the frames whose indices are in `timed`.
fn film(
    lq: &mut Stage,
    mut translation: Option<&mut Translation>,
    timeline: &Timeline,
    timed: &[usize],
    video: &mut Video,
    going_on: &dyn Fn() -> Result<(), Failure>,
) -> Result<(), Failure> {
    let frames = timeline.poses.len();
    let progress = Progress::new("exam at LQ", frames);
    for (i, pose) in timeline.poses.iter().enumerate() {
        going_on()?;
        let frame = lq.render(pose, timeline.scene_s(i))?;
        video.push(&halved(&frame.bmode, frame.width, frame.height).0)?;
        if let Some(translation) = translation.as_mut().filter(|_| timed.contains(&i)) {
            let ms = translation.run(frame)?;
            lq.times.push_generator(ms);
        }
        progress.set(i + 1, frames);
    }
    Ok(())
}

/// Renders the frames with indices in `timed` at high quality, to measure their times.
fn time_frames(
    hq: &mut Stage,
    timeline: &Timeline,
    timed: &[usize],
    going_on: &dyn Fn() -> Result<(), Failure>,
) -> Result<(), Failure> {
    let progress = Progress::new("exam at HQ", timed.len());
    for (done, &frame) in timed.iter().enumerate() {
        going_on()?;
        hq.render(&timeline.poses[frame], timeline.scene_s(frame))?;
        progress.set(done + 1, timed.len());
    }
    Ok(())
}

/// Runs the live chain and prints its summary.
fn live_chain(
    args: &Args,
    backend: &Backend,
    scene: &Arc<Scene>,
    summary: &RecordingSummary,
    interrupt: &Stop,
) -> Result<Summary, Failure> {
    let live = live::run(args, backend, scene, summary.duration, interrupt)?;
    if !args.json {
        output::line(&live)?;
        output::line(format!("files              {}\n", args.out.join("live").display()))?;
    }
    eprintln!("now the exam as files");
    Ok(live)
}

/// Prints a summary of the files. Columns show the times at low quality, at high quality and at the quality `target`.
fn print(
    report: &DemoSummary<'_>,
    summary: &RecordingSummary,
    [lq, hq, target]: [&TimeTable; 3],
    generator: Option<&str>,
) -> Result<(), Failure> {
    let triangles = thousands(report.triangles);
    output::line(format!("device         {} ({})", report.adapter.name, report.adapter.driver))?;
    output::line(format!("scene          obstetric phantom: {triangles} triangles in {} surfaces", report.surfaces))?;
    output::line(format!("exam           {EXAM_NAME}: {summary}"))?;
    let key_frames = format!("{} key frames at {}", target.frames(), report.target);
    let (frames_lq, frames_hq) = (report.frames_lq, report.frames_hq);
    output::line(format!("rendered       {frames_lq} frames at LQ (1x1), {frames_hq} at HQ ({HQ}), {key_frames}"))?;
    let compounded = format!("HQ of {}", report.target.angles);
    let columns = [("LQ", lq), ("HQ", hq), (compounded.as_str(), target)];
    // Without a generator, `target` is the high quality and needs no column.
    let shown = if report.target == HQ { &columns[..2] } else { &columns[..] };
    output::line(format!("\n{}\n", SideBySide(shown)))?;
    if let Some(name) = generator {
        output::line(format!(
            "translation    LQ by {name}, against {}: {}",
            report.target,
            Agreement(report.key_frames)
        ))?;
    }
    output::line(format!("look here      {}", report.contact_sheet.display()))?;
    output::line(format!("video          {}", report.video.display()))
}
