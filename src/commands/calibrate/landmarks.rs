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

/// Fit where the tracker is in the scene to landmarks known in both.
///
/// PAIRS is a table with a line for each landmark: x,y,z in the scene, tx,ty,tz as the tracker measures the same point (of
/// a stylus: its tip), and its name. A line of column names may order them otherwise, name a unit (x_m, tx_cm; mm without
/// one), or give the scene's points along the patient's axes (r,a,s or l,p,s; they are taken in LPS, and with --station
/// turned into the axes of its scene). Fields are separated by commas, semicolons or tabs; numbers have a decimal point.
/// Three landmarks are needed, six or more are better, well around the field and not in one plane.
///
/// With --tracker they are touched instead, one after the other, with a stylus or the probe's face: each line of the
/// input (Enter) takes the landmark that is asked for, once the tip is held still. `back` takes the last one again, `again
/// NAME` any other. From the fourth on the residuals are shown; from the fifth on landmarks that were likely mixed up are
/// named. The result goes into the calibration file that the station names, unless --out names another.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// Landmarks (CSV)
    #[arg(conflicts_with = "tracker")]
    pairs: Option<PathBuf>,

    /// Station whose scene PAIRS is about (TOML): points along the patient's axes are turned into the scene's
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

/// Turns landmarks into the axes of the station's scene; without a station they stay in LPS. `path` is the landmarks'
/// file, for errors.
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
