//! `insonify exam`: records sessions in which a simulated hand moves the probe.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Parser;
use insonify::exam::session::PLANE_S;
use insonify::exam::{Batch, Skills, sweep, write_sweep};
use insonify::files::Outputs;
use insonify::sink::{create_dir, write_json};
use insonify::station::{PlaneScene, SceneIdentity, Station};

use super::progress::Progress;
use super::{Failure, input, output};

/// Record sessions of a simulated hand that looks for standard planes, as raw tracker bytes.
///
/// For each plane, the hand travels to it, searches by tilting, rocking, rotating and sliding, holds the plane, places
/// its calipers, and leaves. It trembles, drifts, and varies its pressure. The recording names its planes for `insonify
/// score`, and the hand's intention in events `truth.plane`. Poses are as measured by the station's calibrated tracker.
///
/// Without a station: the demo's short sweep, with its key views as events. Equal options give equal files.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify exam configs/obstetric.toml --planes head,abdomen,femur --skill novice --seed 7 --out exam.mcap\n  \
                        insonify exam configs/obstetric.toml --sessions 1000 --skill mixed --shuffle --out out/exams\n  \
                        insonify exam --out assets/exams/obstetric_sweep.mcap       the recording that the demo plays\n\n\
                        insonify score EXAM STATION says how well a session did; insonify planes STATION lists planes.")]
pub(crate) struct Args {
    /// Station file (TOML) whose scene has standard planes
    station: Option<PathBuf>,

    /// File to write (.mcap); with --sessions, the directory
    #[arg(long, value_name = "PATH")]
    out: PathBuf,

    /// Replace the file if it is there; sessions in a directory are always replaced
    #[arg(long, conflicts_with = "sessions")]
    force: bool,

    /// Planes to look for, in this order, or `all` [default: all of the scene]
    #[arg(long, value_name = "A,B,...", value_delimiter = ',', value_parser = input::plane, requires = "station")]
    planes: Vec<String>,

    /// Seed of every random choice, 0..=18446744073709551615
    #[arg(long, value_name = "N", default_value_t = sweep::SEED, allow_negative_numbers = true)]
    seed: u64,

    /// Length of a session, s, up to 3600 [default: 15 a plane]
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
    let Some(count) = args.sessions else {
        output::make_parent(&args.out)?;
        let written = batch.write(args.seed, &args.out)?;
        return if args.json { output::json(&written) } else { output::text(&written) };
    };
    if args.seed.checked_add(u64::from(count) - 1).is_none() {
        return Err(Failure::Input(anyhow!("--seed {} and --sessions {count} pass the greatest seed", args.seed)));
    }
    create_dir(&args.out)?;
    let progress = Progress::new("exam", count as usize);
    let written = batch.write_all(args.seed, count, &args.out, &|done| progress.set(done, count as usize))?;
    drop(progress);
    write_json(&args.out.join("sessions.json"), &written)?;
    if args.json {
        return output::json(&written);
    }
    output::line(format!("{count} sessions of {duration_s} s, seeds from {}", args.seed))?;
    output::line(args.out.join("sessions.json").display())
}
