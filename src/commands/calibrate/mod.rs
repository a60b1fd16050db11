//! `insonify calibrate`: transforms between scene, tracker, sensor and probe.

mod landmarks;
mod pivot;
mod touch;

use std::path::{Path, PathBuf};

use clap::{Parser, Subcommand};
use insonify::pose::Calibration;
use insonify::sink::write_text;

use super::Failure;

/// Find where the tracker is in the scene, or where a stylus' tip or a probe's face is at its sensor.
///
/// With --out the result goes into a calibration file that a station names in `[calibration] path`; what else the file
/// holds stays as it is.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    #[command(subcommand)]
    what: What,
}

const AFTER_HELP: &str = "\
Example:
  insonify calibrate pivot pivoting.mcap --out station.calibration.toml
  insonify calibrate landmarks belly.csv --out station.calibration.toml
  insonify calibrate landmarks --tracker station.toml        touch the scene's landmarks one by one
and in the station file:
  [calibration]
  path = \"station.calibration.toml\"";

#[derive(Debug, Subcommand)]
enum What {
    Landmarks(landmarks::Args),
    Pivot(pivot::Args),
}

/// Options that every calibration has.
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
    }
}

fn positive(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|mm: &f64| *mm > 0.0).ok_or_else(|| "expected a number above 0, in mm".to_owned())
}

/// Applies `change` to the calibration file at `path`, which is created if missing.
fn write(path: &Path, change: impl FnOnce(&mut Calibration)) -> Result<(), Failure> {
    let mut calibration = if path.exists() { Calibration::load(path)? } else { Calibration::default() };
    change(&mut calibration);
    Ok(write_text(path, &calibration.to_toml())?)
}
