//! `insonify replay`: renders a recording into frames and a video.

use std::path::PathBuf;

use clap::Parser;
use insonify::files::Outputs;
use insonify::pipeline::replay::{Pace, REPLAY_FILES, ReplaySpeed};

use super::backend::BackendArgs;
use super::progress::Progress;
use super::replay_args::{ReplayArgs, choose_quality};
use super::{Failure, output, session};

/// Replay a recorded session over a station's scene: one PNG per frame, and a video.
///
/// The recording's raw tracker bytes pass through the decoder, calibration and filter of a live session, without
/// display latency. Settings changed in the session change again at the same time. Frames have the station's
/// post-processing: compounding of one angle per frame, persistence, filters, grey map. At another frame rate than the
/// live session's, compounding and persistence span a different time. Frames depend only on recording, station and
/// seed, not on the speed. No generator runs. Of a truncated or damaged recording, the intact part is used.
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

    /// Print the contents of replay.json, without its list of frames
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

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let mut replay = args.replay.read()?;
    Outputs::apart_from(replay.station.files()).and([&args.replay.recording]).within(
        "--out",
        &args.out,
        &REPLAY_FILES,
    )?;
    let backend = args.backend.open(replay.station.backend)?;
    let scene = session::load_scene(&replay.station)?;
    choose_quality(&mut replay, &backend, &scene)?;
    let total = replay.frames.len();
    let progress = Progress::new("replay", total);
    let pace = Pace::new(args.speed, replay.rate.fps());
    let mut written = replay.write(&backend, &scene, &args.out, args.maps, pace, &|done| progress.set(done, total))?;
    drop(progress);
    if args.json {
        written.frames.clear();
        return output::json(&written);
    }
    output::text(&written)
}
