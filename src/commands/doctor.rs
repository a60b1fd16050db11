//! `insonify doctor`: finds faults of a scene and names their remedies.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Parser;
use insonify::anatomy::TissueTable;
use insonify::anatomy::doctor::aberration::Summary;
use insonify::anatomy::doctor::{Finding, Report, Settings, Severity, examine};
use insonify::anatomy::import;
use insonify::pose::Pose;
use insonify::station::{SceneFile, Station};
use insonify::transducer::{Probe, aberration};
use serde::Serialize;

use super::output::counted;
use super::progress::Progress;
use super::session;
use super::{Classify, Failure, input, output};

/// Say what is wrong with a scene, where, and what to do about it in the modelling program.
///
/// A scene alone is examined with the built-in tissues; a station file also tells its own tissues and where the probe
/// starts. At a pose, the station's or `--pose`, it tells how the tissue before the probe aberrates. Findings are errors (refused, or simulated wrongly), warnings (mended while loading, or wrong in places) and
/// notes. Exit code 1 where there is an error, 0 without one, 2 where the file cannot be read at all.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify doctor belly.glb\n  \
                        insonify doctor configs/gallbladder_stones.toml --json\n  \
                        insonify doctor belly.glb --pose 0,0,83.5,0,1,0,0")]
pub(crate) struct Args {
    /// Scene (.glb, .gltf) or station file (.toml)
    scene: PathBuf,

    /// Pose of a probe whose aberration is told, as x,y,z,qw,qx,qy,qz in mm; the station's if left out
    #[arg(long, allow_hyphen_values = true)]
    pose: Option<Pose>,

    /// Print the findings as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Printed<'a> {
    path: &'a Path,
    #[serde(flatten)]
    report: &'a Report,
    aberration: &'a [Summary],
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let builtin = TissueTable::builtin().other()?;
    let (file, station) = if input::is_station(&args.scene) {
        let station = Station::load(&args.scene)?;
        (session::scene_file(&station)?, Some(station))
    } else {
        (SceneFile::Given(args.scene.clone()), None)
    };
    let path = file.path();
    let tissues = station.as_ref().map_or(&builtin, |station| &station.tissues);
    let own = tissues.names().iter().filter(|name| builtin.index_of(name).is_none());
    // The background counts as used, although no surface has it.
    let own_tissues: Vec<String> =
        own.filter(|name| station.as_ref().is_none_or(|s| s.background != **name)).cloned().collect();
    let probe = station.as_ref().map_or_else(Probe::default, |s| s.probe);
    let pose = args.pose.or(station.as_ref().and_then(|s| s.default_pose));
    let start = pose.map(|pose| (pose, probe.depth_mm));
    let progress = Progress::new("doctor", 0);
    let background = station.as_ref().and_then(|s| tissues.index_of(&s.background));
    let settings = Settings { tissues, own_tissues: &own_tissues, background, start };
    let report = examine(path, &settings, &|done, total| progress.set(done, total))?;
    drop(progress);
    let errors = report.count(Severity::Error);
    let aberration = match pose {
        Some(pose) if errors == 0 => {
            aberration(&import::load(path, tissues, background.unwrap_or_default())?, &probe, &pose)
        }
        _ => Vec::new(),
    };
    if args.json {
        output::json(&Printed { path, report: &report, aberration: &aberration })?;
    } else {
        print(&report)?;
        aberration.iter().try_for_each(|summary| output::line(summary))?;
    }
    match errors {
        0 => Ok(()),
        errors => Err(Failure::Other(anyhow!("{} has {}", path.display(), counted(errors, "error")))),
    }
}

fn print(report: &Report) -> Result<(), Failure> {
    let of = format!("{}, {}", counted(report.surfaces, "surface"), counted(report.triangles, "triangle"));
    if report.findings.is_empty() {
        return output::line(format!("nothing is wrong: {of}"));
    }
    report.findings.iter().try_for_each(|finding| output::line(line(finding)))?;
    let of_severity = |severity, name| counted(report.count(severity), name);
    let errors = of_severity(Severity::Error, "error");
    let (warnings, notes) = (of_severity(Severity::Warning, "warning"), of_severity(Severity::Note, "note"));
    output::line(format!("\n{errors}, {warnings}, {notes} in {of}"))
}

fn line(finding: &Finding) -> String {
    format!("{:8} {finding}\n         {}", finding.severity.to_string(), finding.remedy)
}
