//! `insonify exam`: sessions of a simulated hand.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::anyhow;
use clap::Parser;
use insonify::anatomy::Skin;
use insonify::anatomy::planes::StandardPlane;
use insonify::exam::hand::Skill;
use insonify::exam::session::{self, PLANE_S, Settings, TRUTH_EVENT};
use insonify::exam::{START_TIME_NS, sweep};
use insonify::sink::{create_dir, write_json};
use insonify::station::{PlaneScene, Station};
use rayon::prelude::*;
use serde::Serialize;

use super::outputs::Outputs;
use super::progress::Progress;
use super::session::scene_name;
use super::{Failure, output};

/// Record sessions of a simulated hand that looks for standard planes, as raw tracker bytes.
///
/// For each plane the hand travels there, searches by tilting, rocking, rotating and sliding, holds the plane, places its
/// calipers, and leaves; it trembles, drifts, and changes its pressure. Events `truth.plane` in the recording say what it
/// meant to do. The same station, planes, seed, duration and skill give the same file, byte for byte.
///
/// Without a station: the short sweep over the phantom that the demo plays; its key views are events.
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

    /// Planes to look for, in this order [default: all of the scene]
    #[arg(long, value_name = "A,B,...", value_delimiter = ',', requires = "station")]
    planes: Vec<String>,

    /// Seed of every random choice, 0..=18446744073709551615
    #[arg(long, value_name = "N", default_value_t = sweep::SEED, allow_negative_numbers = true)]
    seed: u64,

    /// Length of a session, s, up to 3600 [default: 15 a plane]
    #[arg(long, value_name = "S", requires = "station", allow_negative_numbers = true)]
    duration: Option<f64>,

    /// Whose hand: novice, trained, expert, or mixed (by the seed)
    #[arg(long, value_name = "SKILL", default_value = "expert", requires = "station")]
    skill: Whose,

    /// Look for the planes in an order that depends on the seed
    #[arg(long, requires = "station")]
    shuffle: bool,

    /// Sessions to make, 1..=1000000, with seeds from --seed up, and sessions.json that lists them
    #[arg(long, value_name = "N", requires = "station", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    sessions: Option<u32>,

    /// Print what was recorded as JSON
    #[arg(long)]
    json: bool,
}

/// A skill, or each in turn.
#[derive(Debug, Clone, Copy)]
enum Whose {
    One(Skill),
    Mixed,
}

impl FromStr for Whose {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "mixed" { Ok(Self::Mixed) } else { text.parse().map(Self::One).map_err(|e| format!("{e}, mixed")) }
    }
}

impl Whose {
    fn of(self, seed: u64) -> Skill {
        match self {
            Self::One(skill) => skill,
            Self::Mixed => Skill::ALL[(seed % Skill::ALL.len() as u64) as usize],
        }
    }
}

#[derive(Serialize)]
struct Report {
    path: PathBuf,
    seed: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    skill: Option<&'static str>,
    duration_s: f64,
    rate_hz: u32,
    key_frames: Vec<KeyFrame>,
}

#[derive(Serialize)]
struct KeyFrame {
    name: String,
    time_s: f64,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let Some(station) = &args.station else { return sweep(args) };
    let station = Station::load(station)?;
    let inputs = Outputs::beside_station(&station);
    match args.sessions {
        Some(_) => inputs.within("--out", &args.out, &["session_*.mcap", "sessions.json"])?,
        None => inputs.file("--out", &args.out, args.force)?,
    };
    let scene = PlaneScene::open(&station)?;
    let planes = scene.planes.chosen(&args.planes)?;
    let duration_s = args.duration.unwrap_or(PLANE_S * planes.len() as f64);
    if !(duration_s > 0.0 && duration_s <= 3600.0) {
        return Err(Failure::Input(anyhow!("--duration is {duration_s}; it must be above 0 and at most 3600 s")));
    }
    let task = Task { args, scene: scene_name(&station), skin: &scene.skin, planes, duration_s };
    let Some(count) = args.sessions else {
        output::make_parent(&args.out)?;
        let report = task.make(args.seed, &args.out)?;
        return if args.json { output::json(&report) } else { print(&report) };
    };
    if args.seed.checked_add(u64::from(count) - 1).is_none() {
        return Err(Failure::Input(anyhow!("--seed {} and --sessions {count} pass the greatest seed", args.seed)));
    }
    create_dir(&args.out)?;
    let total = count as usize;
    let progress = Progress::new("exam", total);
    let done = AtomicUsize::new(0);
    let reports = (0..u64::from(count)).into_par_iter().map(|i| {
        let seed = args.seed + i;
        let report = task.make(seed, &args.out.join(format!("session_{seed:06}.mcap")))?;
        progress.set(done.fetch_add(1, Ordering::Relaxed) + 1, total);
        Ok(report)
    });
    let reports: Vec<Report> = reports.collect::<Result<_, Failure>>()?;
    drop(progress);
    write_json(&args.out.join("sessions.json"), &reports)?;
    if args.json {
        return output::json(&reports);
    }
    output::line(format!("{count} sessions of {duration_s} s, seeds from {}", args.seed))?;
    output::line(args.out.join("sessions.json").display())
}

/// Data shared by all sessions.
struct Task<'a> {
    args: &'a Args,
    scene: String,
    skin: &'a Skin,
    planes: Vec<&'a StandardPlane>,
    duration_s: f64,
}

impl Task<'_> {
    fn make(&self, seed: u64, path: &Path) -> Result<Report, Failure> {
        let skill = self.args.skill.of(seed);
        let mut planes = self.planes.clone();
        if self.args.shuffle {
            session::shuffle(&mut planes, seed);
        }
        let made = session::make(&planes, self.skin, &Settings { seed, duration_s: self.duration_s, skill })?;
        made.write(path, &self.scene)?;
        let holds = made.events.iter().filter(|event| event.name == TRUTH_EVENT);
        let key_frames = holds.filter_map(|event| {
            let value = event.value.as_ref().filter(|value| value["phase"] == "hold")?;
            let time_s = (event.host_time_ns - START_TIME_NS) as f64 * 1e-9;
            Some(KeyFrame { name: value["plane"].as_str()?.to_owned(), time_s })
        });
        Ok(Report {
            path: path.to_owned(),
            seed,
            skill: Some(skill.name()),
            duration_s: self.duration_s,
            rate_hz: session::RATE_HZ,
            key_frames: key_frames.collect(),
        })
    }
}

/// The sweep of `assets/exams`.
fn sweep(args: &Args) -> Result<(), Failure> {
    Outputs::default().file("--out", &args.out, args.force)?;
    output::make_parent(&args.out)?;
    sweep::write(&args.out, args.seed)?;
    let key_frames = sweep::KEY_FRAMES.map(|(name, time_s)| KeyFrame { name: name.to_owned(), time_s });
    let report = Report {
        path: args.out.clone(),
        seed: args.seed,
        skill: None,
        duration_s: f64::from(sweep::DURATION_S),
        rate_hz: sweep::RATE_HZ,
        key_frames: key_frames.into(),
    };
    if args.json { output::json(&report) } else { print(&report) }
}

fn print(report: &Report) -> Result<(), Failure> {
    let hand = report.skill.map_or_else(String::new, |skill| format!(", hand: {skill}"));
    output::line(format!("{} s at {} poses a second, seed {}{hand}", report.duration_s, report.rate_hz, report.seed))?;
    report.key_frames.iter().try_for_each(|k| output::line(format!("{:6.1} s  {}", k.time_s, k.name)))?;
    output::line(report.path.display())
}
