//! `insonify front`: makes the table of errors from which live sessions choose an operating point.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::anyhow;
use clap::Parser;
use insonify::files::{FileKind, Outputs};
use insonify::measuring::{ANGLES, ErrorSettings, ErrorTable, RAYS_LAYERS, StationErrors, measure_errors};
use insonify::sink::write_text;
use insonify::station::Station;

use super::backend::BackendArgs;
use super::sweep_bar::{SweepBar, of_options};
use super::{Classify, Failure, input, output, session};

/// Recording whose motion is used for stations without one.
const MOTION: &str = "assets/exams/obstetric_sweep.mcap";
/// Make the table of errors from which live sessions choose their operating point.
///
/// For each station, poses are chosen from its recording: at rest, in slow and in fast motion. A station without a
/// recording has its own pose, turned about the beam, with the motion of --motion. At each pose, live frames are
/// compared with a converged reference of 9 angles with all effects: by the error that an eye sees, with its parts of
/// levels and texture, and pixel by pixel. Operating points are rays x layers x angles of rolling compounding, some of
/// them with coarse samples or without the effect aperture, and the station's generators on the frames that they were
/// trained for. A rolling picture compounds frames at the probe's earlier poses, at the station's frame rate. The table
/// holds errors by speed, but no times: sessions measure those.
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

    /// Recording (.mcap) whose motion is used for stations without a recording
    #[arg(long, value_name = "FILE", default_value = MOTION)]
    motion: PathBuf,

    /// Table to update: its other stations are kept
    #[arg(long, value_name = "FILE")]
    merge: Option<PathBuf>,

    /// Stop after about this many minutes; the same command with --resume continues
    #[arg(long, value_name = "N")]
    minutes: Option<u16>,

    /// Reuse results measured before with the same station, scene, models, poses and version
    #[arg(long)]
    resume: bool,

    #[command(flatten)]
    backend: BackendArgs,
}

const AFTER_HELP: &str = "\
The shipped table is assets/quality/front.toml; its first lines name the command. A build reads it, so build again after
a change.

Example:
  insonify front configs/generators.toml configs/lung_air.toml --minutes 10 --resume";

/// Rays and layers from text such as `8x3`.
fn rays_layers(text: &str) -> Result<(u32, u32), String> {
    let all = RAYS_LAYERS.map(|(rays, layers)| format!("{rays}x{layers}")).join(", ");
    input::product(text).filter(|found| RAYS_LAYERS.contains(found)).ok_or_else(|| format!("points are {all}"))
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if let Some(angles) = args.angles.iter().find(|angles| !ANGLES.contains(angles)) {
        return Err(Failure::Input(anyhow!("--angles {angles}: angles are 1, 3 and 9")));
    }
    let stations = args.stations.iter().map(|path| Ok(Station::load(path)?)).collect::<Result<Vec<_>, Failure>>()?;
    let read = stations.iter().flat_map(Station::files);
    // The file to merge is read before it is replaced, so both may be the same.
    Outputs::apart_from(read).and([&args.motion]).replaced("--out", &args.out)?;
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
    write_text(&args.out, &ErrorTable::merged(command(args), measured, merged).to_toml()?)?;
    output::line(args.out.display())
}

/// The command line, with all options that change the result.
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

/// Errors of one station; `None` if the time limit passed before all were measured.
fn errors(args: &Args, station: &Station, ends: Option<Instant>) -> Result<Option<StationErrors>, Failure> {
    let settings = ErrorSettings {
        motion: args.motion.clone(),
        poses: usize::from(args.poses),
        points: args.points.clone(),
        angles: args.angles.clone(),
        folder: args.out.parent().unwrap_or(Path::new(".")).to_owned(),
        resume: args.resume,
        ends,
    };
    // Checked before the scene, which may have to be built first.
    settings.check(station)?;
    let backend = args.backend.open(station.backend)?;
    let scene = session::load_scene(station)?;
    let bar = SweepBar::default();
    measure_errors(&backend, station, &scene, &settings, &|step| bar.say(step)).map_err(of_options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_named_by_rays_and_layers() {
        assert_eq!(rays_layers("8x3"), Ok((8, 3)));
        assert!(["8", "8x", "7x3", "x"].iter().all(|text| rays_layers(text).unwrap_err().contains("1x1, 1x3")));
    }
}
