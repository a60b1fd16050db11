//! `insonify export`: renders a recording into a tracked sequence for other programs.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Parser;
use insonify::files::Outputs;
use insonify::pipeline::replay::SequenceMap;

use super::backend::BackendArgs;
use super::progress::Progress;
use super::replay_args::{ReplayArgs, choose_quality};
use super::{Failure, input, output, session};

/// Render a recorded session into a tracked sequence (.igs.mha), as PLUS and 3D Slicer read it: post-processed images,
/// times, transforms.
///
/// A sequence cannot hold the recording's events, planes, measurements and texts.
#[derive(Debug, Parser)]
#[command(after_help = "Example:\n  \
                        insonify export assets/exams/obstetric_sweep.mcap configs/obstetric.toml --frames ..40 --out sweep.igs.mha")]
pub(crate) struct Args {
    #[command(flatten)]
    replay: ReplayArgs,

    /// Sequence to write (.igs.mha or .mha)
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

/// Pixel values of a sequence.
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
    let inputs = Outputs::apart_from(replay.station.files()).and([&args.replay.recording]);
    inputs.file("--out", &args.out, args.force)?;
    check_suffix(&args.out)?;
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
    if args.json {
        return output::json(&written);
    }
    output::text(&written)?;
    if replay.summary.events.is_empty() {
        return Ok(());
    }
    output::line(format!("left out: {}", input::NOT_IN_SEQUENCES))
}

/// Refuses a file name without the suffix of a MetaImage.
fn check_suffix(out: &Path) -> Result<(), Failure> {
    if out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("mha")) {
        return Ok(());
    }
    let out = out.display();
    Err(Failure::Input(anyhow!("--out is {out}; it must end in .igs.mha or .mha: MetaImage is what is written")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_names_of_meta_images_are_taken() {
        for right in ["a.igs.mha", "b.mha", "C.MHA"] {
            assert!(check_suffix(Path::new(right)).is_ok(), "{right}");
        }
        for wrong in ["x.csv", "exam.nrrd", "sweep.mhd", "sweep"] {
            let Err(Failure::Input(error)) = check_suffix(Path::new(wrong)) else { panic!("{wrong} is taken") };
            assert!(error.to_string().contains("must end in .igs.mha or .mha"), "{error}");
        }
    }
}
