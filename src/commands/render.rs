//! `insonify render`: renders one frame with its maps.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Parser;
use insonify::chooser::{StillFrame, StillPoses, render_still};
use insonify::files::Outputs;
use insonify::pose::Pose;
use insonify::render::{FrameQuality, Quality};
use insonify::sink::{FrameFiles, FrameRecord};
use insonify::station::Station;
use serde::Serialize;

use super::backend::BackendArgs;
use super::effects::EffectArgs;
use super::quality;
use super::{Failure, input, output, session};

/// Render one frame: bmode.png, segmentation.png with tissues.json, attenuation.npy, mask.png, lines.npy, frame.json.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    /// Pose of the probe in the scene: x,y,z,qw,qx,qy,qz [default: the station's own]
    ///
    /// x, y, z: centre of the probe's face in mm, within ±100000. qw, qx, qy, qz: a unit quaternion (norm 1 ± 0.001)
    /// that turns probe axes into scene axes. The probe's z axis points into the body, x is lateral, y elevational.
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<Pose>,

    #[arg(long, value_name = "QUALITY", help = quality::help("the station's own"))]
    quality: Option<FrameQuality>,

    #[arg(long, value_name = "N", allow_negative_numbers = true, help = quality::seed_help())]
    seed: Option<u32>,

    /// Time of the scene's motion (heartbeat, breathing), s; at 0 everything is at rest
    #[arg(long, value_name = "S", default_value_t = 0.0, allow_negative_numbers = true)]
    time: f64,

    #[command(flatten)]
    effects: EffectArgs,

    #[command(flatten)]
    backend: BackendArgs,

    /// Directory to write to; made if missing
    #[arg(long, value_name = "DIR", default_value = "out/render")]
    out: PathBuf,

    /// Print the contents of frame.json, and the files, as JSON
    #[arg(long)]
    json: bool,
}

const AFTER_HELP: &str = "\
Files:
  bmode.png         8-bit grey levels, 0 outside the sector
  segmentation.png  8-bit tissue numbers; tissues.json says number -> name, 0 is outside the sector
  attenuation.npy   float32 [height, width]: one-way attenuation over its 98th percentile, 0..1
  mask.png          255 inside the sector
  lines.npy         complex64 [scanlines, samples]: baseband before TGC and compression
  frame.json        pose, settings, pixel size, times, adapter

Examples:
  insonify render configs/sphere.toml --out out/sphere
  insonify render configs/obstetric.toml --pose 0,-40,80,0,1,0,0 --quality hq --seed 7 --out out/head";

#[derive(Serialize)]
struct RenderedFrame<'a> {
    #[serde(flatten)]
    record: &'a FrameRecord,
    files: Vec<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    Outputs::apart_from(station.files()).within("--out", &args.out, &FrameFiles::NAMES)?;
    let pose = input::pose(args.pose, &station, "--pose x,y,z,qw,qx,qy,qz")?;
    let mut settings = station.settings;
    settings.lines = true;
    args.effects.apply(&mut settings);
    let seed = args.seed.unwrap_or(settings.quality.seed);
    settings.quality = match args.quality {
        Some(quality) => quality.with_seed(seed),
        None => Quality { seed, ..settings.quality },
    };
    if !(0.0..=1e6).contains(&args.time) {
        return Err(Failure::Input(anyhow!(
            "--time is {}; it must be a number of seconds from 0 to 1000000",
            args.time
        )));
    }
    let backend = args.backend.open(station.backend)?;
    let scene = session::load_scene(&station)?;
    session::warn_of_effects(&scene, &station.probe, &settings);
    let budget_ms = station.frame_budget_ms.filter(|_| args.quality.is_none());
    let at = StillPoses { probe: pose, needle: station.standing_needle(), time_s: args.time };
    let StillFrame { frame, record, chosen } = render_still(&backend, &scene, &station, settings, at, budget_ms)?;
    chosen.iter().for_each(quality::say_chosen);
    if let Some(misplaced) = record.contact.and_then(|contact| contact.misplaced) {
        tracing::warn!("pose: {misplaced}");
    }
    let files = FrameFiles { frame: &frame, tissues: &scene.tissues, record: &record }.write(&args.out)?;
    if args.json {
        return output::json(&RenderedFrame { record: &record, files });
    }
    output::line(&record)?;
    files.iter().try_for_each(|file| output::line(file.display()))
}
