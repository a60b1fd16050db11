//! `insonify exam`: records sessions in which simulated hands move the probe, or do an exercise with a needle.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Parser;
use insonify::exam::needle::Exercises;
use insonify::exam::needle::hand::Plan;
use insonify::exam::session::PLANE_S;
use insonify::exam::{Batch, ExamError, Skills, WrittenExam, sweep, write_all, write_sweep};
use insonify::files::Outputs;
use insonify::sink::{create_dir, write_json};
use insonify::station::{PlaneScene, SceneIdentity, Station};

use super::progress::Progress;
use super::{Failure, input, output, session};

/// Record sessions of simulated hands that look for standard planes or use a needle, as raw tracker bytes.
///
/// For each plane, the hand travels to it, searches by tilting, rocking, rotating and sliding, holds the plane, places
/// its calipers, and leaves. It trembles, drifts, and varies its pressure. The recording names its planes for `insonify
/// score`, and the hand's intention in events `truth.plane`. Poses are as measured by the station's calibrated tracker.
///
/// At a station with an exercise, the hands do it with probe and needle, unless --planes names planes. Both tools are in
/// the recording, and the hand's intention in events `truth.needle`.
///
/// Without a station: the demo's short sweep, with its key views as events. Equal options give equal files.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify exam configs/obstetric.toml --planes head,abdomen,femur --skill novice --seed 7 --out exam.mcap\n  \
                        insonify exam configs/obstetric.toml --sessions 1000 --skill mixed --shuffle --out out/exams\n  \
                        insonify exam configs/needle_cyst.toml --skill novice --out exercise.mcap\n  \
                        insonify exam --out assets/exams/obstetric_sweep.mcap       the recording that the demo plays\n\n\
                        insonify score EXAM STATION says how well a session did; insonify planes STATION lists planes.")]
pub(crate) struct Args {
    /// Station file (TOML) with an exercise, or whose scene has standard planes
    station: Option<PathBuf>,

    /// File to write (.mcap); with --sessions, the directory
    #[arg(long, value_name = "PATH")]
    out: PathBuf,

    /// Replace the file if it is there; sessions in a directory are always replaced
    #[arg(long, conflicts_with = "sessions")]
    force: bool,

    /// Planes to look for, in this order, or `all` [default: the station's exercise, else all planes]
    #[arg(long, value_name = "A,B,...", value_delimiter = ',', value_parser = input::plane, requires = "station")]
    planes: Vec<String>,

    /// Seed of every random choice, 0..=18446744073709551615
    #[arg(long, value_name = "N", default_value_t = sweep::SEED, allow_negative_numbers = true)]
    seed: u64,

    /// Length of a session that looks for planes, s, up to 3600 [default: 15 a plane]
    #[arg(long, value_name = "S", requires = "station", allow_negative_numbers = true)]
    duration: Option<f64>,

    /// Skill of the hand: novice, trained, expert, or mixed (by the seed)
    #[arg(long, value_name = "SKILL", default_value = "expert", requires = "station")]
    skill: Skills,

    /// Look for the planes in an order that depends on the seed
    #[arg(long, requires = "station")]
    shuffle: bool,

    /// Number of sessions, 1..=1000000, with consecutive seeds from --seed on; sessions.json lists them
    #[arg(long, value_name = "N", requires = "station", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    sessions: Option<u32>,

    /// Print what was recorded as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let Some(station) = &args.station else {
        Outputs::default().file("--out", &args.out, args.force)?;
        output::make_parent(&args.out)?;
        let written = write_sweep(&args.out, args.seed)?;
        return if args.json { output::json(&written) } else { output::text(&written) };
    };
    let station = Station::load(station)?;
    let inputs = Outputs::apart_from(station.files());
    match args.sessions {
        Some(_) => inputs.within("--out", &args.out, &["session_*.mcap", "sessions.json"])?,
        None => inputs.file("--out", &args.out, args.force)?,
    };
    if args.planes.is_empty() && station.exercise.is_some() {
        return exercise(args, &station);
    }
    let scene = PlaneScene::open(&station)?;
    let planes = input::chosen(&args.planes, &scene.planes)?;
    let duration_s = args.duration.unwrap_or(PLANE_S * planes.len() as f64);
    if !(duration_s > 0.0 && duration_s <= 3600.0) {
        return Err(Failure::Input(anyhow!("--duration is {duration_s}; it must be above 0 and at most 3600 s")));
    }
    let (shuffle, skills) = (args.shuffle, args.skill);
    let (skin, calibration) = (&scene.skin, station.pose_settings()?.calibration);
    let scene = SceneIdentity::of(&station).with_depth(station.probe.depth_mm).to_string();
    let batch = Batch { scene, skin, planes, shuffle, duration_s, skills, calibration };
    write(args, &|seed, path| batch.write(seed, path), &format!(" of {duration_s} s"))
}

/// Records sessions of the station's exercise.
fn exercise(args: &Args, station: &Station) -> Result<(), Failure> {
    for (given, option) in [(args.duration.is_some(), "--duration"), (args.shuffle, "--shuffle")] {
        if given {
            let text = "is only for sessions that look for planes; --planes all makes one";
            return Err(Failure::Input(anyhow!("{option} {text}")));
        }
    }
    let Some((exercise, start)) = station.exercise.as_ref().zip(station.default_pose) else {
        let text = "`[pose]` is missing: the simulated hands hold the probe near it";
        return Err(Failure::Input(anyhow!("{}: {text}", station.path.display())));
    };
    let Some(needle) = station.needle_settings()? else {
        let text = "`[needle]` is missing: the exercise needs one";
        return Err(Failure::Input(anyhow!("{}: {text}", station.path.display())));
    };
    let scene = session::load_scene(station)?;
    let plan = Plan::of(exercise, &scene, &station.probe, &start).map_err(ExamError::from)?;
    let exercises = Exercises {
        scene: SceneIdentity::of(station).with_depth(station.probe.depth_mm).to_string(),
        plan,
        skills: args.skill,
        probe: station.pose_settings()?.calibration,
        needle: needle.settings.calibration,
    };
    write(args, &|seed, path| exercises.write(seed, path), &format!(" of `{}`", exercise.name))
}

/// Writes the session, or as many as --sessions demands, by `session`, and prints what was written.
fn write(
    args: &Args,
    session: &(dyn Fn(u64, &Path) -> Result<WrittenExam, ExamError> + Sync),
    about: &str,
) -> Result<(), Failure> {
    let Some(count) = args.sessions else {
        output::make_parent(&args.out)?;
        let written = session(args.seed, &args.out)?;
        return if args.json { output::json(&written) } else { output::text(&written) };
    };
    if args.seed.checked_add(u64::from(count) - 1).is_none() {
        return Err(Failure::Input(anyhow!("--seed {} and --sessions {count} pass the greatest seed", args.seed)));
    }
    create_dir(&args.out)?;
    let progress = Progress::new("exam", count as usize);
    let set = |done| progress.set(done, count as usize);
    let written = write_all(args.seed, count, &args.out, session, &set)?;
    drop(progress);
    write_json(&args.out.join("sessions.json"), &written)?;
    if args.json {
        return output::json(&written);
    }
    output::line(format!("{count} sessions{about}, seeds from {}", args.seed))?;
    output::line(args.out.join("sessions.json").display())
}
