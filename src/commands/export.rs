//! `insonify export`: a recording becomes a tracked sequence for other programs.

use std::path::PathBuf;

use clap::Parser;
use insonify::render::Quality;
use insonify::sink::FrameRate;
use insonify::sink::meta_image::{ImageTracking, MetaImageWriter};
use insonify::station::Station;
use insonify::tracker::recording;
use serde::Serialize;

use super::progress::Progress;
use super::quality::RaysLayers;
use super::replay::FrameRange;
use super::timeline::{Timeline, check_length};
use super::{Failure, output, session};

/// Render a recorded session into a tracked sequence (.igs.mha), as PLUS and 3D Slicer read it: images, times, transforms.
#[derive(Debug, Parser)]
#[command(after_help = "Example:\n  \
                        insonify export assets/exams/obstetric_sweep.mcap configs/obstetric.toml --frames ..40 --out sweep.igs.mha")]
pub(crate) struct Args {
    /// Recording (.mcap)
    recording: PathBuf,

    /// Station file (TOML)
    station: PathBuf,

    /// Sequence to write (.igs.mha)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// What the pixels are
    #[arg(long, value_enum, default_value_t)]
    map: Map,

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

    /// Compress the pixels (zlib)
    #[arg(long)]
    compress: bool,

    /// Print what was written as JSON
    #[arg(long)]
    json: bool,
}

/// What the pixels of a sequence are.
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
    let rate = FrameRate::new(args.fps)?;
    let station = Station::load(&args.station)?;
    let (poses, summary) = recording::poses(&args.recording)?;
    if !summary.is_clean() {
        eprintln!("warning: {}: {summary}", args.recording.display());
    }
    check_length(&poses, rate)?;
    let timeline = Timeline::new(&poses, rate);
    let frames = args.frames.within(timeline.poses.len(), args.fps)?;
    let mut settings = station.settings;
    let seed = args.seed.unwrap_or(settings.quality.seed);
    settings.quality = args.quality.map_or(Quality { seed, ..settings.quality }, |q| q.with_seed(seed));

    let gpu = session::open_gpu()?;
    let scene = session::load_scene(&station)?;
    let mut renderer = session::renderer(&gpu, &scene, &station, &settings)?;
    let sector = *renderer.sector();
    let tracking = |index: usize| ImageTracking {
        time_s: timeline.seconds(index),
        pose: timeline.poses[index],
        tracked: !timeline.is_held(index),
    };
    let images: Vec<_> = frames.clone().map(tracking).collect();
    let mut writer = MetaImageWriter::create(&args.out, &sector, &images, args.compress)?;
    let progress = Progress::new("export", images.len());
    session::render_all(&mut renderer, &timeline.poses[frames], |i, frame| {
        writer.push(match args.map {
            Map::Bmode => &frame.bmode,
            Map::Segmentation => &frame.segmentation,
        })?;
        progress.set(i + 1, images.len());
        Ok(())
    })?;
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
