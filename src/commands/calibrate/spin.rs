//! `insonify calibrate spin`: fits the axis of a needle's shaft to poses recorded while it is turned about its shaft.

use std::path::PathBuf;

use clap::{Parser, ValueEnum};
use glam::DVec3;
use insonify::pose::Pose;
use insonify::pose::needle_mount::NeedleCalibration;
use insonify::pose::spin::{Spin, calibrate};

use super::super::{Failure, output};
use super::live::{LiveArgs, Motion};
use super::needle::{self, Report, along_axis};
use super::{OutputArgs, write};

/// Recording of a turn about the shaft.
const MOTION: Motion = Motion {
    what: "lay the needle in a groove or a tube that doesn't move, press Enter, and turn it about its own shaft, half a turn each way",
    seconds: 10,
    of_needle: true,
};

/// Find the axis of a needle's shaft in the frame of its sensor.
///
/// Turn the needle about its own shaft, half a turn each way, while the tracker is recorded. The shaft must keep its
/// direction: lay it in a groove or a tube that doesn't move. POSES is that recording (.mcap), or a table of the
/// sensor's poses as for `calibrate pivot`. With --tracker, the poses are recorded from the station's tracker, and the
/// result goes into the station's calibration file, unless --out names another.
///
/// A turn doesn't show which end of the axis is the tip. The tip of `calibrate pivot --of needle` does, whichever of
/// the two commands comes first. Only a sensor that is mounted level with the tip needs --towards-tip.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// Poses of the turning sensor (MCAP recording or CSV)
    #[arg(required_unless_present = "tracker", conflicts_with_all = ["tracker", "sensor", "tool"])]
    poses: Option<PathBuf>,

    /// Object that was turned
    #[arg(long, value_enum, default_value_t = Of::Needle)]
    of: Of,

    /// Axis of the sensor, such as +z or -x, that points roughly from the hub to the tip
    #[arg(long, value_name = "AXIS", value_parser = along_axis, allow_hyphen_values = true)]
    towards_tip: Option<DVec3>,

    /// Axis of the tracker, such as +z or -x, that the bevel's facet faced in the first pose [default: the bevel is unknown]
    #[arg(long, value_name = "AXIS", value_parser = along_axis, allow_hyphen_values = true)]
    bevel_faces: Option<DVec3>,

    #[command(flatten)]
    live: LiveArgs,

    #[command(flatten)]
    output: OutputArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Of {
    /// The axis is written to [needle] axis
    Needle,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let Of::Needle = args.of;
    let accept = |poses: &[Pose], before: NeedleCalibration| accept(args, poses, before);
    let (file, out) = (args.poses.as_deref(), args.output.out.as_deref());
    let ((found, needle, dropped_bevel), out) = needle::fitted(file, &args.live, out, &MOTION, accept)?;
    if dropped_bevel {
        tracing::warn!(
            "the axis differs from the earlier one, so the sensor was mounted anew: the earlier bevel is dropped (--bevel-faces finds it), and the tip must be found again"
        );
    }
    if let Some(out) = &out {
        write(out, |calibration| calibration.needle = Some(needle))?;
    }
    let report = Report::new(found, needle);
    if args.output.json {
        return output::json(&report);
    }
    output::text(report)?;
    out.as_ref().map_or(Ok(()), |out| output::line(out.display()))
}

/// Fits the axis to `poses`, and adds it to the needle's calibration. Returns also whether an earlier bevel was dropped.
fn accept(args: &Args, poses: &[Pose], before: NeedleCalibration) -> Result<(Spin, NeedleCalibration, bool), String> {
    let found = calibrate(poses).map_err(|error| error.to_string())?;
    let mut needle = before;
    let mut dropped_bevel = needle.set_axis(&found, args.towards_tip).map_err(needle::reason)?;
    if let (Some(first), Some(facing)) = (poses.first(), args.bevel_faces) {
        needle.set_bevel(first, facing).map_err(needle::reason)?;
        dropped_bevel = false;
    }
    let limit = args.output.max_rms;
    match needle.mount().ok().and_then(|mount| mount.across_mm()) {
        Some(mm) if mm > limit => Err(format!(
            "the axis is certain to {:.2}°, which is {mm:.2} mm over the distance between sensor and tip, more than --max-rms {limit}; turn the needle evenly to and fro, and don't move the shaft",
            found.axis_deg
        )),
        _ => Ok((found, needle, dropped_bevel)),
    }
}
