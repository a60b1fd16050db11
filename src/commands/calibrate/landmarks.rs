//! `insonify calibrate landmarks`: fits `scene_from_tracker` to paired points.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Parser;
use insonify::files::{FileKind, Outputs};
use insonify::pose::LandmarkFit;
use insonify::pose::csv::{self, Listed, Named};
use insonify::pose::registration::PointPair;
use insonify::station::Station;

use super::super::{Classify, Failure, input, output};
use super::touch::{self, TouchArgs};
use super::{OutputArgs, calibration_file, write};

/// Fit the transform from tracker to scene (scene_from_tracker) to landmarks known in both.
///
/// PAIRS is a table with a line for each landmark: its position x,y,z in the scene, its position tx,ty,tz as measured
/// by the tracker (the tip of a stylus), and its name. A header line may change the order, name a unit (x_m, tx_cm;
/// default mm), or give scene points along the patient's axes (r,a,s or l,p,s). Such points are converted to LPS, or
/// with --station to the axes of its scene. Fields are separated by commas, semicolons or tabs; numbers have a decimal
/// point. Three landmarks are needed; six or more are better, spread around the imaged region and not in one plane.
///
/// With --tracker, the user touches the landmarks one after another with a stylus or the probe's face. Enter takes the
/// requested landmark once the tip is held still; `back` repeats the last landmark, `again NAME` any other. Residuals
/// are shown from the fourth landmark on, likely mix-ups from the fifth on. The result goes into the station's
/// calibration file, unless --out names another.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// Landmarks (CSV)
    #[arg(conflicts_with_all = ["tracker", "points", "sensor", "tool", "samples", "tolerance"])]
    pairs: Option<PathBuf>,

    /// Station (TOML) whose scene has the landmarks: converts points along the patient's axes to the scene's axes
    #[arg(long, value_name = "STATION", conflicts_with = "tracker")]
    station: Option<PathBuf>,

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
    let Some(path) = args.pairs.as_deref() else {
        return Err(Failure::Input(anyhow!(
            "give PAIRS, a table of landmarks in scene and tracker, or --tracker STATION to touch them one after the other; --help has the details"
        )));
    };
    let station = args.station.as_deref().map(Station::load).transpose()?;
    match (&station, args.output.out.as_deref()) {
        (Some(station), Some(out)) => drop(calibration_file(station, Some(out), &args.pairs)?),
        (None, Some(out)) => drop(Outputs::apart_from([path]).replaced("--out", out)?),
        (_, None) => {}
    }
    let found = csv::pairs(&input::text(path, FileKind::Table, "the landmarks")?).input_of(path)?;
    found.notes.iter().for_each(|note| tracing::warn!("{}: {note}", path.display()));
    fit(&in_scene(found, station.as_ref(), path)?, path, &args.output)
}

/// Converts landmarks in LPS to the axes of the station's scene; without a station they stay in LPS. `path` is the
/// landmarks' file, for messages.
fn in_scene(
    found: Listed<Named<PointPair>>,
    station: Option<&Station>,
    path: &Path,
) -> Result<Vec<Named<PointPair>>, Failure> {
    if !found.in_lps {
        return Ok(found.values);
    }
    let Some(station) = station else {
        tracing::warn!(
            "{}: the result is for a scene in LPS (`extras.axes` is lps), as `insonify scene from-labels` and `from-meshes` write it; for another, such as the obstetric phantom, give its station with --station",
            path.display()
        );
        return Ok(found.values);
    };
    let axes = touch::scene_axes(station, path)?;
    let turned = |Named { name, value }: Named<PointPair>| {
        let scene_mm = axes.from_lps(value.scene_mm);
        Named { name, value: PointPair { scene_mm, ..value } }
    };
    Ok(found.values.into_iter().map(turned).collect())
}

/// Fits the transform to landmarks. `source` names their file in errors.
fn fit(pairs: &[Named<PointPair>], source: &Path, arguments: &OutputArgs) -> Result<(), Failure> {
    let found = LandmarkFit::of(pairs, arguments.max_rms).input_of(source)?;
    if found.coplanar {
        tracing::warn!(
            "the landmarks lie near one plane: a tracker with a mirrored axis would not be noticed; add one well outside of it"
        );
    }
    if let Some(likely) = &found.likely {
        tracing::warn!("{likely}; touch what is named once more before the result is used");
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
