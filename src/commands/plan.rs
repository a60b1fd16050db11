//! `insonify plan`: shows the effects that a scene needs, and their costs.

use std::path::PathBuf;

use clap::Parser;
use insonify::measuring::{PlanCosts, PlanTable, TimedFrame};
use insonify::pose::Pose;
use insonify::render::{Decision, EffectPlan, FrameQuality};
use insonify::station::Station;
use serde::Serialize;

use super::backend::BackendArgs;
use super::effects::EffectArgs;
use super::sweep_bar::SweepBar;
use super::{Failure, output, quality, session};

/// List the effects that a scene needs, with the reason, the error of a frame without each effect, and its cost in ms.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    #[command(flatten)]
    effects: EffectArgs,

    #[arg(long, value_name = "QUALITY", help = quality::help("the station's own"))]
    quality: Option<FrameQuality>,

    /// Measure at x,y,z,qw,qx,qy,qz [default: the station's pose]; the plan holds for every pose
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<Pose>,

    #[command(flatten)]
    backend: BackendArgs,

    /// Only decide: open no device and render no frame
    #[arg(long)]
    no_measure: bool,

    /// Print the plan as JSON
    #[arg(long)]
    json: bool,
}

const AFTER_HELP: &str = "\
An effect is left out where a bound on what it changes holds for every pose: exactly nothing, at most half a grey level
(but for nulls of the speckle), or edges aside by less than half a pixel or a quarter of the beam's σ. [effects] in a station file and --effect say
otherwise by name: `refraction = \"off\"`, `--effect refraction=off`.

Costs are measured on this machine: a few frames with and without each effect, in turns; medians. Effects without a cost
are numbers in a table: leaving them out saves no time. The look's steps are measured as in a live session: with
compounding one angle a frame; a still takes all of them. Maps are planned for a live session (`insonify run`); render,
replay and demo write them in any case.

Examples:
  insonify plan configs/obstetric.toml
  insonify plan configs/vessel_needle.toml --no-measure --json
  insonify plan configs/sphere.toml --effect refraction=off";

#[derive(Serialize)]
struct Report<'a> {
    station: &'a PathBuf,
    quality: String,
    effects: &'a [Decision],
    /// Measured costs of the effects; `None` with `--no-measure` or without a pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    measured: Option<PlanCosts>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    let mut settings = station.settings;
    args.effects.apply(&mut settings);
    if let Some(quality) = args.quality {
        settings.quality = quality.with_seed(settings.quality.seed);
    } else {
        session::warn_of_budget(&station);
    }
    settings.maps = station.reads_maps();
    let scene = session::load_scene(&station)?;
    let plan = EffectPlan::new(&scene, &station.probe, &settings);
    session::warn_of_effects(&scene, &station.probe, &settings);
    let pose = args.pose.or(station.default_pose).filter(|_| !args.no_measure);
    let measured = match pose {
        None => None,
        Some(pose) => {
            let backend = args.backend.open(station.backend)?;
            let frame = TimedFrame { backend: &backend, scene: &scene, probe: station.probe, settings, pose };
            let bar = SweepBar::default();
            Some(PlanCosts::measure(&frame, &plan, &|step| bar.say(step))?)
        }
    };
    if args.json {
        let quality = settings.quality.name();
        return output::json(&Report { station: &args.station, quality, effects: plan.decisions(), measured });
    }
    output::text(PlanTable { plan: &plan, measured: measured.as_ref() })?;
    if measured.is_none() && !args.no_measure {
        output::line("\nnot measured: no pose; give --pose, or a [pose] in the station file")?;
    }
    Ok(())
}
