//! `insonify tradeoff`: measures frame time against image error.

use std::path::PathBuf;

use clap::Parser;
use insonify::files::Outputs;
use insonify::measuring::{SWEEP_FILES, Sweep, SweepSettings};
use insonify::names::counted;
use insonify::sink::create_dir;
use insonify::station::{Poses, Station};

use super::backend::BackendArgs;
use super::sweep_bar::{SweepBar, of_options};
use super::{Failure, input, output, session};

/// Measure what accuracy costs in time: sweep the quality knobs, and compare every point with a converged reference.
///
/// First renders a reference at some poses: all effects, 9 angles, the 3 layers of HQ unless more change the levels,
/// and enough rays that doubling them changes little. That change is printed. Then varies rays and layers in a small
/// grid. Some grid points have variants: compounded; compounded as in a live session (one angle per frame of a moving
/// probe); without the effect aperture; with all effects. Every other knob is varied alone, around 8 x 3. A station's
/// generators run on the frames that they were trained for. The receiver's noise is omitted, because it is no error of
/// the picture. Each point gets a time (with maps, from the call until the frame is in memory) and an error within the
/// sector. The Pareto front uses the seen error: differences of local levels and of the strength of texture.
///
/// A second panel compares frames of small scenes with wave theory (diffraction sums, a full-wave simulation), with and
/// without each effect that the theory covers. It states the effect's cost in the station's scene at 1 x 1. Steps of
/// the look (post-processing) are compared likewise, by the remaining speckle and noise, and the width of a point.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    /// Folder to write to; made if missing
    #[arg(long, value_name = "DIR", default_value = "out/tradeoff")]
    out: PathBuf,

    /// Poses, spread over the recording, 1..=100 [default: 3, or as many as take about 5 minutes]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=100))]
    poses: Option<u16>,

    /// Recording (.mcap) whose poses are taken [default: the station's; without one, [pose] turned about the beam]
    #[arg(long, value_name = "FILE")]
    recording: Option<PathBuf>,

    /// Fewer points, one pose, and a reference of fewer rays
    #[arg(long)]
    quick: bool,

    #[command(flatten)]
    backend: BackendArgs,

    /// Reuse results in the folder from an earlier run with the same station, scene, models, poses, machine and version
    #[arg(long)]
    resume: bool,
}

const AFTER_HELP: &str = "\
Files:
  tradeoff.csv    a line a point: knobs, times, errors, passes
  tradeoff.json   all of it, with tissues and the reference
  tradeoff.svg    the figure, and as tradeoff.png
  tradeoff.md     tables
  effects.csv     a line an effect: errors against wave theory with and without it, cost
  looks.csv       the same for steps of a look
  points/         points as they were done, for --resume

A difference is called noise where repeats of one point differ as much: in time by the distance of the quartiles, in
error by what another seed makes.

Examples:
  insonify tradeoff configs/live.toml --out out/tradeoff
  insonify tradeoff configs/vessel_needle.toml --quick";

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    Outputs::apart_from(station.files()).and(&args.recording).within("--out", &args.out, &SWEEP_FILES)?;
    if args.recording.as_deref().or(station.recording()).is_none() {
        input::pose(None, &station, "--recording FILE, a recorded tracker")?;
    }
    // Checked before the scene, which may have to be built first.
    Poses::of_station(&station, args.recording.as_deref())?;
    let backend = args.backend.open(station.backend)?;
    session::warn_of_budget(&station);
    let scene = session::load_scene(&station)?;
    create_dir(&args.out)?;
    let settings = SweepSettings {
        recording: args.recording.clone(),
        poses: args.poses.map(usize::from),
        quick: args.quick,
        resume: args.resume,
    };
    let sweep = Sweep::prepare(&backend, &station, &scene, &args.out, &settings).map_err(of_options)?;
    eprintln!(
        "{}, {}, on {}: about {}",
        counted(sweep.poses(), "pose"),
        sweep.source(),
        sweep.device(),
        output::duration(sweep.estimated_s())
    );
    let bar = SweepBar::default();
    let report = sweep.run(&|step| bar.say(step)).map_err(of_options)?;
    drop(bar);
    // Files are written first, because a closed output must not lose a long sweep.
    let files = report.write(&args.out)?;
    output::line(report.tables())?;
    output::line(&report.reference)?;
    for path in files {
        output::line(path.display())?;
    }
    Ok(())
}
