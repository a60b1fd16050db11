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

/// Say what is wrong with a scene or a station, where, and what to do about it in the modelling program.
///
/// A scene alone is examined with the built-in tissues. A station file also tells its own tissues and where the probe
/// starts. Its tracker and calibration are examined, too: files and ports that are not there, values that can hardly be.
/// At a pose, the station's or `--pose`, it tells how the tissue before the probe aberrates.
///
/// Findings are errors (refused, or simulated wrongly), warnings (mended while loading, or wrong in places) and notes.
/// Exit code 1 where there is an error, 0 without one, 2 where the file cannot be read at all.
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
