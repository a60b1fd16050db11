//! `insonify front`: the table of errors that live sessions choose from.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::anyhow;
use clap::Parser;
use insonify::pose::Pose;
use insonify::render::{FrameQuality, Renderer};
use insonify::sink::write_text;
use insonify::station::Station;
use insonify::tradeoff::{ErrorTable, PointError, StationErrors, kind_name};

use super::super::backend::BackendArgs;
use super::super::operating_points::scene_name;
use super::super::outputs::Outputs;
use super::super::{Classify, Failure, output, session};
use super::identity;
use super::measure::Bench;
use super::poses::{Track, of_recording, of_station};
use super::reference::Reference;
use super::store::Store;

/// Rays and layers of the points.
const RAYS_LAYERS: [(u32, u32); 7] = [(1, 1), (1, 3), (2, 3), (4, 3), (8, 3), (16, 3), (32, 3)];
/// Angles of rolling compounding.
const ANGLES: [u32; 3] = [1, 3, 9];
/// Points without the aperture have at most so many paths.
const PATHS_WITHOUT_APERTURE: u32 = 3;
/// Frames before each measured one: those of the most angles.
const FRAMES_BEFORE: u32 = 8;
/// Recording by which probes move.
const MOTION: &str = "assets/exams/obstetric_sweep.mcap";
/// Time between frames of the moving probe, s.
const PERIOD_S: f64 = 1.0 / 14.0;

/// Make the table of errors that live sessions choose their operating point from.
///
/// For each station: its own poses (those of its recording, else its pose turned about the beam), to which the probe has
/// moved as a hand in the recording of --motion does; a converged reference of 9 angles with all effects; and the error of
/// live frames against it: rays x layers x angles of rolling compounding, some of them without the aperture, and the
/// station's generators on the frames that they were trained for. The table holds no times: sessions measure them.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Station files (TOML)
    #[arg(required = true)]
    stations: Vec<PathBuf>,

    /// File to write
    #[arg(long, value_name = "FILE", default_value = "out/front/front.toml")]
    out: PathBuf,

    /// Poses of each station, 1..=100
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..=100))]
    poses: u16,

    /// Recording (.mcap) by which probes move
    #[arg(long, value_name = "FILE", default_value = MOTION)]
    motion: PathBuf,

    /// Keep what was measured before with the same station, scene, models, poses and version
    #[arg(long)]
    resume: bool,

    #[command(flatten)]
    backend: BackendArgs,
}

const AFTER_HELP: &str = "\
The shipped table is assets/quality/front.toml; its first lines name the command. A build reads it, so build again after
a change.

Example:
  insonify front configs/tiers.toml configs/lung_air.toml --out out/front/front.toml --resume";

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let stations = args.stations.iter().map(|path| Ok(Station::load(path)?)).collect::<Result<Vec<_>, Failure>>()?;
    let read = stations.iter().flat_map(Station::files);
    Outputs::beside(read).and([&args.motion]).replaced("--out", &args.out)?;
    let mut table = ErrorTable::new(command(args));
    for (nth, station) in stations.iter().enumerate() {
        let started = Instant::now();
        let name = station.path.display();
        eprintln!("[{}/{}] {name}", nth + 1, stations.len());
        table.stations.push(errors(args, station)?);
        let left = (stations.len() - nth - 1) as f64 * started.elapsed().as_secs_f64();
        eprintln!("[{}/{}] {name}: done, about {} left", nth + 1, stations.len(), output::duration(left));
    }
    let text = toml::to_string(&table).map_err(|e| anyhow!("the table can't be written: {e}")).other()?;
    write_text(&args.out, &format!("# Errors of live frames, by `insonify front`. Docs: docs/commands.md.\n{text}"))?;
    output::line(args.out.display())
}

/// The command, as it is typed.
fn command(args: &Args) -> String {
    let stations: Vec<String> = args.stations.iter().map(|path| path.display().to_string()).collect();
    let motion =
        if args.motion == Path::new(MOTION) { String::new() } else { format!(" --motion {}", args.motion.display()) };
    format!("insonify front {} --poses {}{motion}", stations.join(" "), args.poses)
}

/// Errors of one station.
fn errors(args: &Args, station: &Station) -> Result<StationErrors, Failure> {
    let period = Duration::from_secs_f64(PERIOD_S);
    let hand = of_recording(&args.motion, station)?;
    let tracks: Vec<Track> =
        of_station(station, None)?.moved_like(&hand, usize::from(args.poses), FRAMES_BEFORE, period);
    let poses: Vec<Pose> = tracks.iter().map(|track| track.at).collect();
    let backend = args.backend.open(station.backend)?;
    let scene = session::load_scene(station)?;
    let renderer = Renderer::new(&backend, &scene, &station.probe, &station.settings)?;
    let mut bench = Bench::new(renderer, station, &scene)?;
    let folder = args.out.parent().unwrap_or(Path::new(".")).to_owned();
    let key = [identity::of(station, &scene), backend.to_string(), format!("{tracks:?}")];
    let store = Store::new(&folder, args.resume, &key)?;
    let (reference, _) = Reference::make(&mut bench, &store, &poses, false)?;
    eprintln!("{}", reference.check);
    let planned = planned(&bench, station.probe.kind.steers());
    let total = planned.len();
    let mut points = Vec::with_capacity(total);
    for (nth, (quality, generator)) in planned.into_iter().enumerate() {
        let key = generator.and_then(|index| bench.key(index));
        let file = format!("front {quality:?} {key:?}").replace(|c: char| !c.is_alphanumeric(), "_");
        let [first, second] = match store.read::<[f64; 2]>(&file)? {
            Some(kept) => kept,
            None => {
                let measured = bench.rolling_error(&bench.live_knobs(quality), generator, &reference, &tracks)?;
                store.write(&file, &measured)?;
                measured
            }
        };
        let rounded = |value: f64| (1e3 * value).round() / 1e3;
        let (rmse, spread) = (rounded(0.5 * (first + second)), rounded((first - second).abs()));
        let on_top = key.as_ref().map_or_else(String::new, |key| format!(" + {}", key.name));
        eprintln!("[{}/{total}] {quality}{on_top}: {rmse:.2} grey levels", nth + 1);
        points.push(PointError { quality, generator: key, rmse, spread });
    }
    Ok(StationErrors {
        name: station.path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default(),
        scene: scene_name(station),
        probe: kind_name(&station.probe.kind).to_owned(),
        frequency_mhz: station.probe.frequency_mhz,
        reference: reference.check.to_string(),
        poses: poses.len(),
        points,
    })
}

/// Qualities of rendered frames, then generators on theirs.
fn planned(bench: &Bench, steers: bool) -> Vec<(FrameQuality, Option<usize>)> {
    let angles = ANGLES.into_iter().filter(|&angles| steers || angles == 1);
    let with = angles.clone().flat_map(|angles| {
        RAYS_LAYERS.map(move |(rays, layers)| FrameQuality { angles, ..FrameQuality::new(rays, layers) })
    });
    let with: Vec<FrameQuality> = with.collect();
    let few = with.iter().filter(|quality| bench.base().aperture && quality.paths() <= PATHS_WITHOUT_APERTURE);
    let without: Vec<FrameQuality> = few.map(|quality| FrameQuality { aperture: false, ..*quality }).collect();
    let raw = with.into_iter().chain(without).map(|quality| (quality, None));
    raw.chain(bench.generated_points().into_iter().map(|(lq, index)| (lq, Some(index)))).collect()
}
