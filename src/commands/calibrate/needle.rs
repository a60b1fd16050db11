//! Steps of a needle's calibration, which share the table `[needle]` of the calibration file.

use std::fmt;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use glam::DVec3;
use insonify::files::Outputs;
use insonify::pose::needle_mount::{NeedleCalibration, NeedleError};
use insonify::pose::{Calibration, Pose};
use serde::Serialize;

use super::super::{Classify, Failure};
use super::live::{self, LiveArgs, Motion};
use super::poses;

/// Fits a motion that is recorded in `file`, or with the live tracker of `args`. `accept` gets the poses, and the
/// calibration of the needle that the calibration file holds so far. Returns the result of `accept`, and the calibration
/// file to write: `out`, else that of the live tracker's station.
pub(super) fn fitted<T>(
    file: Option<&Path>,
    args: &LiveArgs,
    out: Option<&Path>,
    motion: &Motion,
    accept: impl Fn(&[Pose], NeedleCalibration) -> Result<T, String>,
) -> Result<(T, Option<PathBuf>), Failure> {
    if let Some(station) = &args.tracker {
        let (settings, out) = live::open(station, args, out, motion)?;
        let before = known(Some(&out))?;
        let found = live::motion(&settings, motion, |poses| accept(poses, before))?;
        return Ok((found, Some(out)));
    }
    let Some(file) = file else {
        return Err(Failure::Input(anyhow!("give POSES, a recording or a table, or --tracker STATION")));
    };
    if let Some(out) = out {
        Outputs::apart_from([file]).replaced("--out", out)?;
    }
    let before = known(out)?;
    let found = accept(&poses::read(file)?, before).map_err(anyhow::Error::msg).input_of(file)?;
    Ok((found, out.map(Path::to_owned)))
}

/// Calibration of the needle in the calibration file, if that exists.
fn known(file: Option<&Path>) -> Result<NeedleCalibration, Failure> {
    let file = file.filter(|file| file.exists());
    Ok(file.map(Calibration::load).transpose()?.and_then(|calibration| calibration.needle).unwrap_or_default())
}

/// Direction along one of the axes, from text such as `+z` or `-x`.
pub(super) fn along_axis(text: &str) -> Result<DVec3, String> {
    let (sign, name) = match text.strip_prefix('-') {
        Some(name) => (-1.0, name),
        None => (1.0, text.strip_prefix('+').unwrap_or(text)),
    };
    let axis = match name {
        "x" => DVec3::X,
        "y" => DVec3::Y,
        "z" => DVec3::Z,
        _ => return Err("expected one of +x, -x, +y, -y, +z and -z".to_owned()),
    };
    Ok(sign * axis)
}

/// Result of a step, and what is known of the needle after it.
#[derive(Serialize)]
pub(super) struct Report<T> {
    #[serde(flatten)]
    step: T,
    needle: NeedleCalibration,
    /// Standard error of the axis in mm across the shaft, at the distance between sensor and tip; `None` if tip or axis
    /// is missing.
    across_mm: Option<f64>,
    /// What is missing, with the command that finds it; `None` if nothing is.
    missing: Option<String>,
}

impl<T> Report<T> {
    pub(super) fn new(step: T, needle: NeedleCalibration) -> Self {
        let mount = needle.mount();
        let across_mm = mount.as_ref().ok().and_then(|mount| mount.across_mm());
        Self { step, needle, across_mm, missing: mount.err().map(|missing| missing.to_string()) }
    }
}

impl<T: fmt::Display> fmt::Display for Report<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.step.fmt(f)?;
        match (self.needle.mount(), &self.missing) {
            (Ok(mount), _) => mount.fmt(f),
            (_, Some(missing)) => writeln!(f, "still missing                 {missing}"),
            _ => Ok(()),
        }
    }
}

/// Text of an error, for the fit of a motion.
pub(super) fn reason(error: NeedleError) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_along_axes_are_read() {
        assert_eq!(along_axis("+z"), Ok(DVec3::Z));
        assert_eq!(along_axis("-x"), Ok(DVec3::NEG_X));
        assert_eq!(along_axis("y"), Ok(DVec3::Y));
        for wrong in ["", "+", "--z", "Z", "0,0,1"] {
            assert!(along_axis(wrong).unwrap_err().contains("one of +x"), "{wrong}");
        }
    }
}
