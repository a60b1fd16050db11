//! `insonify export`: renders a recording into a tracked sequence for other programs.

use std::path::PathBuf;

use clap::Parser;
use insonify::files::Outputs;
use insonify::pipeline::replay::SequenceMap;

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

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let mut replay = args.replay.read()?;
    let inputs = Outputs::beside(replay.station.files()).and([&args.replay.recording]);
    inputs.file("--out", &args.out, args.force)?;
    replay.check_depth()?;
    let backend = args.backend.open(replay.station.backend)?;
    let scene = session::load_scene(&replay.station)?;
    choose_quality(&mut replay, &backend, &scene)?;
    let map = match args.map {
        Map::Bmode => SequenceMap::Bmode,
        Map::Segmentation => SequenceMap::Segmentation,
    };
    let total = replay.frames.len();
    let progress = Progress::new("export", total);
    let show = |done| progress.set(done, total);
    let written = replay.write_sequence(&backend, &scene, &args.out, (map, args.compress), &show)?;
    drop(progress);
    if args.json { output::json(&written) } else { output::text(&written) }
}
