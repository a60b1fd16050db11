//! `insonify export`: renders a recording into a tracked sequence for other programs.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Parser;
use insonify::files::Outputs;
use insonify::pipeline::replay::Stretch;
use insonify::sink::meta_image::{ImageTracking, MetaImageWriter};
use insonify::transducer::Sector;
use serde::Serialize;

use super::backend::BackendArgs;
use super::progress::Progress;
use super::replay_args::{ReplayArgs, choose_quality};
use super::{Failure, output, session};

/// Render a recorded session into a tracked sequence (.igs.mha), as PLUS and 3D Slicer read it: images with the station's
/// look, times, transforms.
#[derive(Debug, Parser)]
#[command(after_help = "Example:\n  \
                        insonify export assets/exams/obstetric_sweep.mcap configs/obstetric.toml --frames ..40 --out sweep.igs.mha")]
pub(crate) struct Args {
    #[command(flatten)]
    replay: ReplayArgs,

    /// Sequence to write (.igs.mha)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Replace FILE if it is there
    #[arg(long)]
    force: bool,

    #[command(flatten)]
    backend: BackendArgs,

    /// Map to export as pixels
    #[arg(long, value_enum, default_value_t)]
    map: Map,

    /// Compress the pixels (zlib)
    #[arg(long)]
    compress: bool,

    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// Pixels of a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Default, clap::ValueEnum)]
enum Map {
    /// Grey levels.
    #[default]
    Bmode,
    /// Tissue numbers.
    Segmentation,
}

#[derive(Serialize)]
struct Report<'a> {
    path: &'a PathBuf,
    images: usize,
    /// Images in gaps of the recording, whose transforms are marked invalid.
    invalid: usize,
    width: u32,
    height: u32,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let mut replay = args.replay.read()?;
    let inputs = Outputs::beside(replay.station.files()).and([&args.replay.recording]);
    inputs.file("--out", &args.out, args.force)?;
    let probe = &replay.first()?.probe;
    if let Some(part) = replay.stretches.iter().find(|part| part.probe.depth_mm != probe.depth_mm) {
        let at = part.frames.start;
        return Err(Failure::Input(anyhow!(
            "the recorded session changes the depth at frame {at}, and a sequence has one size of its pixels; export parts with --frames ..{at} and {at}.., or use --ignore-controls"
        )));
    }
    let backend = args.backend.open(replay.station.backend)?;
    let scene = session::load_scene(&replay.station)?;
    choose_quality(&mut replay, &backend, &scene)?;
    let (timeline, frames) = (&replay.timeline, replay.frames.clone());
    let Stretch { probe, settings, .. } = replay.first()?;
    let sector = Sector::fit(probe, settings.image.width, settings.image.height);
    let tracking = |index: usize| ImageTracking {
        time_s: timeline.seconds(index),
        pose: timeline.poses[index],
        tracked: !timeline.is_held(index),
    };
    let images: Vec<_> = frames.clone().map(tracking).collect();
    let mut writer = MetaImageWriter::create(&args.out, &sector, &images, args.compress)?;
    let progress = Progress::new("export", images.len());
    replay.render(
        &backend,
        &scene,
        |_| {},
        |i, frame| {
            writer.push(match args.map {
                Map::Bmode => &frame.bmode,
                Map::Segmentation => &frame.segmentation,
            })?;
            progress.set(i + 1, images.len());
            Ok::<(), Failure>(())
        },
    )?;
    drop(progress);
    writer.finish()?;
    let invalid = images.iter().filter(|image| !image.tracked).count();
    let (width, height) = (sector.width, sector.height);
    if args.json {
        return output::json(&Report { path: &args.out, images: images.len(), invalid, width, height });
    }
    output::line(format!("{} images of {width} x {height}", images.len()))?;
    if invalid > 0 {
        output::line(format!("{invalid} of them in gaps of the recording: their transforms are marked INVALID"))?;
    }
    output::line(args.out.display())
}
