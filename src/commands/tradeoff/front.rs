//! `insonify front`: the table of errors that live sessions choose from.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::anyhow;
use clap::Parser;
use insonify::chooser::{ErrorTable, GeneratorKey, PointError, StationErrors, kind_name, scene_name};
use insonify::files::FileKind;
use insonify::pose::{BySpeed, LIMITS, Pose, ProbeSpeed};
use insonify::render::{FrameQuality, Renderer};
use insonify::sink::write_text;
use insonify::station::{Poses, Station};
use insonify::statistics::mean;

use super::super::backend::BackendArgs;
use super::super::outputs::Outputs;
use super::super::progress::Progress;
use super::super::{Classify, Failure, input, output, session};
use super::identity;
use super::measure::Bench;
use super::reference::Reference;
use super::store::Store;
use super::truth::Truth;

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
/// Poses at which the reference's convergence is checked, one at each speed; it has as many paths at the others.
const CHECKED: usize = ProbeSpeed::ALL.len();

/// Make the table of errors that live sessions choose their operating point from.
///
/// For each station: moments of its recording at which the probe is at rest, moves slowly, and moves fast (without a
/// recording its own pose, turned about the beam, to which the probe has moved as a hand in the recording of --motion
/// does); a converged reference of 9 angles with all effects at each; and the error of live frames against it, by speed:
/// rays x layers x angles of rolling compounding, some of them without the aperture, and the station's generators on the
/// frames that they were trained for. The looks of a rolling picture are those of the probe's earlier poses at the
/// station's frame rate. The table holds no times: sessions measure them.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Station files (TOML)
    #[arg(required = true)]
    stations: Vec<PathBuf>,

    /// File to write
    #[arg(long, value_name = "FILE", default_value = "out/front/front.toml")]
    out: PathBuf,

    /// Poses of each station, a third of them at each speed, 3..=99
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u16).range(3..=99))]
    poses: u16,

    /// Only points with these rays x layers, such as 1x1,8x3 [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = rays_layers)]
    points: Vec<(u32, u32)>,

    /// Only points with these numbers of angles, such as 1,9 [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    angles: Vec<u32>,

    /// Recording (.mcap) by which probes without one move
    #[arg(long, value_name = "FILE", default_value = MOTION)]
    motion: PathBuf,

    /// Table whose other stations are kept
    #[arg(long, value_name = "FILE")]
    merge: Option<PathBuf>,

    /// Stop after about so many minutes; the same command with --resume goes on
    #[arg(long, value_name = "N")]
    minutes: Option<u16>,

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
  insonify front configs/tiers.toml configs/lung_air.toml --minutes 10 --resume";

/// Rays and layers from text such as `8x3`.
fn rays_layers(text: &str) -> Result<(u32, u32), String> {
    let parsed = text.split_once('x').and_then(|(rays, layers)| Some((rays.parse().ok()?, layers.parse().ok()?)));
    let all = RAYS_LAYERS.map(|(rays, layers)| format!("{rays}x{layers}")).join(", ");
    parsed.filter(|found| RAYS_LAYERS.contains(found)).ok_or_else(|| format!("points are {all}"))
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if let Some(angles) = args.angles.iter().find(|angles| !ANGLES.contains(angles)) {
        return Err(Failure::Input(anyhow!("--angles {angles}: angles are 1, 3 and 9")));
    }
    let stations = args.stations.iter().map(|path| Ok(Station::load(path)?)).collect::<Result<Vec<_>, Failure>>()?;
    let read = stations.iter().flat_map(Station::files);
    // The merged table is read before it is replaced.
    Outputs::beside(read).and([&args.motion]).replaced("--out", &args.out)?;
    let merged = match &args.merge {
        Some(path) => Some(ErrorTable::parse(&input::text(path, FileKind::Stored, "the table")?).input_of(path)?),
        None => None,
    };
    let ends = args.minutes.map(|minutes| Instant::now() + Duration::from_secs(60 * u64::from(minutes)));
    let mut measured = Vec::new();
    for (nth, station) in stations.iter().enumerate() {
        eprintln!("[{}/{}] {}", nth + 1, stations.len(), station.path.display());
        let Some(errors) = errors(args, station, ends)? else {
            eprintln!("stopped after {} minutes: the same command with --resume goes on", args.minutes.unwrap_or(0));
            return Ok(());
        };
        measured.push(errors);
    }
    let table = table(command(args), measured, merged);
    let text = toml::to_string(&table).map_err(|e| anyhow!("the table can't be written: {e}")).other()?;
    write_text(&args.out, &format!("# Errors of live frames, by `insonify front`. Docs: docs/commands.md.\n{text}"))?;
    output::line(args.out.display())
}

/// The command, as it is typed.
fn command(args: &Args) -> String {
    let stations: Vec<String> = args.stations.iter().map(|path| path.display().to_string()).collect();
    let mut text = format!("insonify front {} --poses {}", stations.join(" "), args.poses);
    if !args.points.is_empty() {
        let points = args.points.iter().map(|(rays, layers)| format!("{rays}x{layers}")).collect::<Vec<_>>();
        text += &format!(" --points {}", points.join(","));
    }
    if !args.angles.is_empty() {
        text += &format!(" --angles {}", args.angles.iter().map(u32::to_string).collect::<Vec<_>>().join(","));
    }
    if args.motion != Path::new(MOTION) {
        text += &format!(" --motion {}", args.motion.display());
    }
    text
}

/// The table of what was measured, and of the other stations of `merged`, in their order.
fn table(command: String, measured: Vec<StationErrors>, merged: Option<ErrorTable>) -> ErrorTable {
    let mut table = ErrorTable::new(command);
    if let Some(merged) = merged {
        table.command += &format!("; other stations: {}", merged.command);
        table.stations = merged.stations;
    }
    for station in measured {
        match table.stations.iter_mut().find(|known| known.name == station.name) {
            Some(known) => *known = station,
            None => table.stations.push(station),
        }
    }
    table
}

/// Errors of one station; none if the time was over before all were measured.
fn errors(args: &Args, station: &Station, ends: Option<Instant>) -> Result<Option<StationErrors>, Failure> {
    let frame_rate_hz = station.pipeline.frame_rate_hz;
    let hand = Poses::of_recording(&args.motion, station)?;
    let each = usize::from(args.poses).div_ceil(ProbeSpeed::ALL.len());
    let period = Duration::from_secs_f64(1.0 / frame_rate_hz);
    let own = Poses::of_station(station, None)?;
    let source = if own.moves() { &station.path } else { &args.motion };
    let tracks = own.at_speeds(&hand, each, FRAMES_BEFORE, period);
    let [slow, fast] = LIMITS;
    let tracks = tracks.map_err(|speed| {
        let name = speed.name();
        Failure::Input(anyhow!(
            "{}: at no moment is the probe {name} (slow: from {} mm/s or {} degrees/s; fast: from {} mm/s or {} degrees/s)",
            source.display(),
            slow.mm_s,
            slow.deg_s,
            fast.mm_s,
            fast.deg_s
        ))
    })?;
    let backend = args.backend.open(station.backend)?;
    let scene = session::load_scene(station)?;
    let renderer = Renderer::new(&backend, &scene, &station.probe, &station.settings)?;
    let mut bench = Bench::new(renderer, station, &scene)?;
    let planned = planned(args, &bench, station.probe.kind.steers());
    let is_over = || ends.is_some_and(|ends| Instant::now() >= ends);
    let folder = args.out.parent().unwrap_or(Path::new(".")).to_owned();
    let identity = [identity::of(station, &scene), backend.to_string()];
    let store = |key: String| Store::new(&folder, args.resume, &[&identity[..], &[key]].concat());

    // One pose of each speed, then the others.
    let mut order: Vec<usize> = (0..tracks.len()).collect();
    order.sort_by_key(|&index| index % each);
    let mut first: Vec<Pose> = Vec::new();
    for at in order.iter().map(|&index| tracks[index].1.at) {
        if first.len() < CHECKED && !first.contains(&at) {
            first.push(at);
        }
    }
    let (reference, _) = Reference::make(&mut bench, &store(format!("{first:?}"))?, &first, false)?;
    eprintln!("{}", reference.check);
    let check = reference.check;
    let mut truths: Vec<(Pose, Truth)> = first.into_iter().zip(reference.truths).collect();
    let mut found: Vec<(ProbeSpeed, Vec<[f64; 2]>)> = Vec::new();
    let progress = Progress::new("front", tracks.len() * planned.len());
    for (nth, &index) in order.iter().enumerate() {
        let (speed, track) = &tracks[index];
        let known = match truths.iter().position(|(pose, _)| *pose == track.at) {
            Some(known) => known,
            None if is_over() => return Ok(None),
            None => {
                let truth = Reference::of_pose(&mut bench, &store(format!("{:?}", track.at))?, track.at, &check)?;
                truths.push((track.at, truth));
                truths.len() - 1
            }
        };
        let store = store(format!("{track:?}"))?;
        let mut errors = Vec::with_capacity(planned.len());
        for (number, &(quality, generator)) in planned.iter().enumerate() {
            progress.set(nth * planned.len() + number, tracks.len() * planned.len());
            let key = generator.and_then(|index| bench.key(index));
            let file = format!("front {quality:?} {key:?}").replace(|c: char| !c.is_alphanumeric(), "_");
            let error = match store.read::<[f64; 2]>(&file)? {
                Some(kept) => kept,
                None if is_over() => return Ok(None),
                None => {
                    let measured = bench.live_error(quality, generator, &truths[known].1, track)?;
                    store.write(&file, &measured)?;
                    measured
                }
            };
            errors.push(error);
        }
        found.push((*speed, errors));
    }
    drop(progress);
    let points = planned.iter().enumerate();
    let points = points.map(|(number, &(quality, generator))| {
        let key = generator.and_then(|index| bench.key(index));
        point(quality, key, &found.iter().map(|(speed, errors)| (*speed, errors[number])).collect::<Vec<_>>())
    });
    Ok(Some(StationErrors {
        points: points.collect(),
        name: station.path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default(),
        scene: scene_name(station),
        probe: kind_name(&station.probe.kind).to_owned(),
        frequency_mhz: station.probe.frequency_mhz,
        reference: check.to_string(),
        poses: tracks.len(),
        frame_rate_hz: Some(frame_rate_hz),
    }))
}

/// A point of the table from its errors with two seeds at each pose, grey levels.
fn point(quality: FrameQuality, generator: Option<GeneratorKey>, errors: &[(ProbeSpeed, [f64; 2])]) -> PointError {
    let rounded = |value: f64| (1e3 * value).round() / 1e3;
    let by_seed = |of: Option<ProbeSpeed>| {
        let some = || errors.iter().filter(|(speed, _)| of.is_none_or(|of| of == *speed));
        [0, 1].map(|seed| mean(some().map(|(_, errors)| errors[seed])).unwrap_or(f64::NAN))
    };
    let middle = |[first, second]: [f64; 2]| rounded(0.5 * (first + second));
    let by_speed = BySpeed::new(ProbeSpeed::ALL.map(|speed| middle(by_seed(Some(speed)))));
    let [first, second] = by_seed(None);
    let on_top = generator.as_ref().map_or_else(String::new, |key| format!(" + {}", key.name));
    let BySpeed { at_rest, slow, fast } = by_speed;
    eprintln!("{quality}{on_top}: {at_rest:.1} grey levels at rest, {slow:.1} slow, {fast:.1} fast");
    let (rmse, spread) = (middle([first, second]), rounded((first - second).abs()));
    PointError { quality, generator, rmse, spread, by_speed: Some(by_speed) }
}

/// Qualities of rendered frames, then generators on theirs.
fn planned(args: &Args, bench: &Bench, steers: bool) -> Vec<(FrameQuality, Option<usize>)> {
    let wanted = |quality: &FrameQuality| {
        let points = args.points.is_empty() || args.points.contains(&(quality.rays, quality.layers));
        points && (args.angles.is_empty() || args.angles.contains(&quality.angles))
    };
    let angles = ANGLES.into_iter().filter(|&angles| steers || angles == 1);
    let with = angles.clone().flat_map(|angles| {
        RAYS_LAYERS.map(move |(rays, layers)| FrameQuality { angles, ..FrameQuality::new(rays, layers) })
    });
    let with: Vec<FrameQuality> = with.filter(wanted).collect();
    let few = with.iter().filter(|quality| bench.base().aperture && quality.paths() <= PATHS_WITHOUT_APERTURE);
    let without: Vec<FrameQuality> = few.map(|quality| FrameQuality { aperture: false, ..*quality }).collect();
    let raw = with.into_iter().chain(without).map(|quality| (quality, None));
    let generated = bench.generated_points().into_iter().filter(|(lq, _)| wanted(lq));
    raw.chain(generated.map(|(lq, index)| (lq, Some(index)))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_named_by_rays_and_layers() {
        assert_eq!(rays_layers("8x3"), Ok((8, 3)));
        assert!(["8", "8x", "7x3", "x"].iter().all(|text| rays_layers(text).unwrap_err().contains("1x1, 1x3")));
    }

    #[test]
    fn a_point_has_the_mean_of_each_speed_and_of_all() {
        use ProbeSpeed::{AtRest, Fast, Slow};
        let errors = [(AtRest, [10.0, 12.0]), (AtRest, [14.0, 16.0]), (Slow, [20.0, 21.0]), (Fast, [30.0, 30.0])];
        let found = point(FrameQuality::LQ, None, &errors);
        assert_eq!(found.by_speed, Some(BySpeed::new([13.0, 20.5, 30.0])));
        assert_eq!((found.rmse, found.spread), (19.125, 1.25));
    }

    #[test]
    fn other_stations_of_a_merged_table_stay() {
        let station = |name: &str, poses| StationErrors {
            name: name.into(),
            scene: String::new(),
            probe: "convex".into(),
            frequency_mhz: 8.0,
            reference: String::new(),
            poses,
            frame_rate_hz: None,
            points: Vec::new(),
        };
        let old = ErrorTable { stations: vec![station("a", 3), station("b", 3)], ..ErrorTable::new("old".into()) };
        let new = table("new".into(), vec![station("b", 12), station("c", 12)], Some(old));
        let poses: Vec<(&str, usize)> = new.stations.iter().map(|s| (s.name.as_str(), s.poses)).collect();
        assert_eq!(poses, [("a", 3), ("b", 12), ("c", 12)]);
        assert_eq!(new.command, "new; other stations: old");
    }
}
