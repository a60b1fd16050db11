//! `insonify doctor`: finds faults of a scene and names their remedies.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Parser;
use insonify::anatomy::TissueTable;
use insonify::anatomy::doctor::Severity;
use insonify::names::counted;
use insonify::pose::Pose;
use insonify::station::{Examination, SceneFile, Station};

use super::progress::Progress;
use super::session;
use super::{Classify, Failure, input, output};

/// List the faults of a scene or a station, where they are, and how to mend them in the modelling program.
///
/// A scene alone is examined with the built-in tissues. A station file adds its own tissues and the probe's pose. Its
/// tracker and calibration are examined, too, for missing files and ports, and for implausible values. At a pose (the
/// station's or `--pose`), the aberration by the tissue in front of the probe is printed.
///
/// Findings are errors (the scene is refused, or simulated wrongly), warnings (mended while loading, or locally wrong)
/// and notes. The exit code is 1 with an error, 0 without one, and 2 if the file cannot be read.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify doctor belly.glb\n  \
                        insonify doctor configs/gallbladder_stones.toml --json\n  \
                        insonify doctor belly.glb --pose 0,0,83.5,0,1,0,0")]
pub(crate) struct Args {
    /// Scene (.glb, .gltf) or station file (.toml)
    scene: PathBuf,

    /// Pose of the probe at which aberration is measured, x,y,z,qw,qx,qy,qz in mm [default: the station's]
    #[arg(long, allow_hyphen_values = true)]
    pose: Option<Pose>,

    /// Print the findings as JSON
    #[arg(long)]
    json: bool,
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
    let progress = Progress::new("doctor", 0);
    let show = |done, total| progress.set(done, total);
    let found = Examination::of(path, station.as_ref(), args.pose, &builtin, &show)?;
    drop(progress);
    if args.json {
        output::json(&found)?
    } else {
        output::text(&found)?
    };
    match found.count(Severity::Error) {
        0 => Ok(()),
        errors => {
            // A fault in the station's set-up is not in the scene file, so the error names the station file.
            let path = if found.setup.is_empty() { path } else { &args.scene };
            Err(Failure::Other(anyhow!("{} has {}", path.display(), counted(errors, "error"))))
        }
    }
}
