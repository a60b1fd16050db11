//! `insonify calibrate landmarks`: fits `scene_from_tracker` to paired points.

use std::path::{Path, PathBuf};

use clap::Parser;
use insonify::files::{FileKind, Outputs};
use insonify::pose::LandmarkFit;
use insonify::pose::csv::{self, Named};
use insonify::pose::registration::PointPair;

use super::super::{Classify, Failure, input, output};
use super::touch::{self, TouchArgs};
use super::{OutputArgs, write};

/// Fit where the tracker is in the scene to landmarks known in both.
///
/// PAIRS has a line `x,y,z,tx,ty,tz` for each landmark, and its name behind a further comma if it has one: the point in
/// the scene, and the same point as the tracker measures it (of a stylus: its tip), in mm. Empty lines, lines that
/// begin with `#`, and a first line of column names are passed over. Three landmarks are needed, six or more are better,
/// well around the field and not in one plane.
///
/// With --tracker they are touched instead, one after the other, with a stylus or the probe's face: each line of the
/// input (Enter) takes the landmark that is asked for, once the tip is held still. The result goes into the calibration
/// file that the station names, unless --out names another.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// Landmarks (CSV)
    #[arg(required_unless_present = "tracker", conflicts_with = "tracker")]
    pairs: Option<PathBuf>,

    #[command(flatten)]
    touch: TouchArgs,

    #[command(flatten)]
    output: OutputArgs,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if let Some(station) = &args.touch.tracker {
        let (pairs, out) = touch::run(station, &args.touch, args.output.out.as_deref())?;
        return fit(&pairs, station, &OutputArgs { out: Some(out), ..args.output });
    }
    let path = args.pairs.as_deref().unwrap_or(Path::new(""));
    if let Some(out) = &args.output.out {
        Outputs::beside([path]).replaced("--out", out)?;
    }
    let pairs = csv::pairs(&input::text(path, FileKind::Table, "the landmarks")?).input_of(path)?;
    fit(&pairs, path, &args.output)
}

/// Fits landmarks; `source` names them in errors.
fn fit(pairs: &[Named<PointPair>], source: &Path, arguments: &OutputArgs) -> Result<(), Failure> {
    let found = LandmarkFit::of(pairs, arguments.max_rms).input_of(source)?;
    if found.coplanar {
        tracing::warn!(
            "the landmarks lie near one plane: a tracker with a mirrored axis would not be noticed; add one well outside of it"
        );
    }
    if let Some(out) = &arguments.out {
        write(out, |calibration| calibration.scene_from_tracker = Some(found.fitted()))?;
    }
    if arguments.json {
        return output::json(&found);
    }
    output::text(&found)?;
    arguments.out.as_ref().map_or(Ok(()), |out| output::line(out.display()))
}
