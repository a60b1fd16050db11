//! `insonify calibrate landmarks`: fits `scene_from_tracker` to paired points.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Parser;
use insonify::files::{FileKind, Outputs};
use insonify::pose::Fitted;
use insonify::pose::csv::{self, Named};
use insonify::pose::registration::{PointPair, Registration, register};
use serde::Serialize;

use super::super::{Classify, Failure, input, output};
use super::touch::{self, TouchArgs};
use super::{OutputArgs, TransformReport, write};

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

#[derive(Serialize)]
struct Report {
    scene_from_tracker: TransformReport,
    rms_mm: f64,
    coplanar: bool,
    landmarks: Vec<Row>,
}

#[derive(Serialize)]
struct Row {
    name: String,
    scene_mm: [f64; 3],
    tracker_mm: [f64; 3],
    residual_mm: f64,
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
    let points: Vec<PointPair> = pairs.iter().map(|p| p.value).collect();
    let found = register(&points).input_of(source)?;
    let rows: Vec<Row> =
        pairs.iter().zip(&found.residuals_mm).map(|(pair, residual_mm)| row(pair, *residual_mm)).collect();
    if found.rms_mm > arguments.max_rms {
        return Err(Failure::Input(too_far(&found, &rows, source, arguments.max_rms)));
    }
    if found.coplanar {
        tracing::warn!(
            "the landmarks lie near one plane: a tracker with a mirrored axis would not be noticed; add one well outside of it"
        );
    }
    if let Some(out) = &arguments.out {
        let fitted = Fitted { value: found.scene_from_tracker, rms_mm: Some(found.rms_mm) };
        write(out, |calibration| calibration.scene_from_tracker = Some(fitted))?;
    }
    if arguments.json {
        let scene_from_tracker = found.scene_from_tracker.into();
        let Registration { rms_mm, coplanar, .. } = found;
        return output::json(&Report { scene_from_tracker, rms_mm, coplanar, landmarks: rows });
    }
    output::line(table(&rows))?;
    output::line(format!("RMS residual {:.3} mm over {} landmarks", found.rms_mm, rows.len()))?;
    let [x, y, z, qw, qx, qy, qz] = found.scene_from_tracker.components();
    output::line(format!("scene_from_tracker: position_mm = [{x:.4}, {y:.4}, {z:.4}]"))?;
    output::line(format!("                    quaternion = [{qw:.6}, {qx:.6}, {qy:.6}, {qz:.6}]"))?;
    arguments.out.as_ref().map_or(Ok(()), |out| output::line(out.display()))
}

fn row(pair: &Named<PointPair>, residual_mm: f64) -> Row {
    let PointPair { scene_mm, tracker_mm } = pair.value;
    Row { name: pair.name.clone(), scene_mm: scene_mm.to_array(), tracker_mm: tracker_mm.to_array(), residual_mm }
}

fn table(rows: &[Row]) -> String {
    let width = rows.iter().map(|r| r.name.chars().count()).max().unwrap_or(0).max("landmark".len());
    let mut text = format!("{:width$} {:>11} {:>26} {:>29}", "landmark", "residual mm", "scene mm", "tracker mm");
    for Row { name, scene_mm: [x, y, z], tracker_mm: [tx, ty, tz], residual_mm } in rows {
        let scene = format!("{x:8.1} {y:8.1} {z:8.1}");
        text += &format!("\n{name:width$} {residual_mm:>11.3} {scene:>26}  {tx:>9.1} {ty:>8.1} {tz:>8.1}");
    }
    text
}

fn too_far(found: &Registration, rows: &[Row], source: &Path, max_rms: f64) -> anyhow::Error {
    let worst = rows.iter().max_by(|a, b| a.residual_mm.total_cmp(&b.residual_mm));
    let worst =
        worst.map_or_else(String::new, |w| format!("; the worst is `{}`, off by {:.2} mm", w.name, w.residual_mm));
    anyhow!(
        "{}: the landmarks fit with an RMS residual of {:.2} mm, more than --max-rms {max_rms}{worst}\n{}",
        source.display(),
        found.rms_mm,
        table(rows)
    )
}
