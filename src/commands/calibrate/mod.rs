//! `insonify calibrate`: fits the transforms between scene, tracker, sensors, probe and needle.

mod guided;
mod landmarks;
mod live;
mod needle;
mod pivot;
mod poses;
mod probe;
mod spin;
mod touch;

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::{Parser, Subcommand};
use insonify::files::Outputs;
use insonify::pose::Calibration;
use insonify::sink::write_text;
use insonify::station::Station;

use super::{Classify, Failure};

/// Fit the position of the tracker in the scene, and the mounting of a stylus, a probe or a needle on its sensor.
///
/// With --out the result goes into a calibration file, which a station names in `[calibration] path`. Other entries of
/// that file stay unchanged.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

const AFTER_HELP: &str = "\
Example:
  insonify calibrate pivot pivoting.mcap --out station.calibration.toml
  insonify calibrate probe --tracker station.toml            centre and axes of the probe, step by step
  insonify calibrate spin --of needle spinning.mcap --out station.calibration.toml
  insonify calibrate landmarks belly.csv --out station.calibration.toml
  insonify calibrate landmarks --tracker station.toml        touch the scene's landmarks one by one
and in the station file:
  [calibration]
  path = \"station.calibration.toml\"";

#[derive(Debug, Subcommand)]
enum What {
    Landmarks(landmarks::Args),
    Pivot(pivot::Args),
    Probe(probe::Args),
    Spin(spin::Args),
}

/// Options common to all calibrations.
#[derive(Debug, clap::Args)]
struct OutputArgs {
    /// Calibration file to write, or to change (TOML)
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Refuse a fit whose RMS residual is larger, mm
    #[arg(long, value_name = "MM", default_value_t = 5.0, value_parser = positive, allow_negative_numbers = true)]
    max_rms: f64,

    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    match &args.what {
        What::Landmarks(args) => landmarks::run(args),
        What::Pivot(args) => pivot::run(args),
        What::Probe(args) => probe::run(args),
        What::Spin(args) => spin::run(args),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|mm: &f64| *mm > 0.0).ok_or_else(|| "expected a number above 0, in mm".to_owned())
}

/// Calibration file for a result: `out`, else the station's. Refuses any other file that the station uses, and any file
/// in `others`.
fn calibration_file<'a>(
    station: &Station,
    out: Option<&Path>,
    others: impl IntoIterator<Item = &'a PathBuf>,
) -> Result<PathBuf, Failure> {
    let out = out.or(station.calibration.path.as_deref()).ok_or_else(|| {
        let path = station.path.display();
        anyhow!("{path} names no calibration file: give `[calibration] path` there, or --out FILE")
    });
    let out = out.input()?.to_owned();
    // The calibration file itself may be read and then changed.
    let read = station.files().into_iter().filter(|path| station.calibration.path.as_ref() != Some(path));
    Outputs::apart_from(read).and(others).replaced("--out", &out)?;
    Ok(out)
}

/// Applies `change` to the calibration file at `path`, which is created if missing.
fn write(path: &Path, change: impl FnOnce(&mut Calibration)) -> Result<(), Failure> {
    let mut calibration = if path.exists() { Calibration::load(path)? } else { Calibration::default() };
    change(&mut calibration);
    Ok(write_text(path, &calibration.to_toml())?)
}
