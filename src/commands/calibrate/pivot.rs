//! `insonify calibrate pivot`: fits the position of a tool's tip to poses recorded while it pivots about the tip.

use std::path::PathBuf;

use clap::{Parser, ValueEnum};
use insonify::pose::needle_mount::{self, NeedleCalibration};
use insonify::pose::pivot::{Pivot, calibrate, explained};
use insonify::pose::{Calibration, Fitted, Pose};

use super::super::{Failure, output};
use super::live::{LiveArgs, Motion};
use super::needle::{self, Report};
use super::{OutputArgs, write};

/// Recording of a pivot.
const MOTION: Motion = Motion {
    what: "rest the tip in the dimple, press Enter, and tilt the tool slowly by 30° to all sides",
    seconds: 15,
    of_needle: false,
};

/// Find the tip of a stylus or a needle, or the centre of a probe's face, in the frame of its sensor.
///
/// Rest the tip in a dimple and tilt the tool to all sides while the tracker is recorded. POSES is that recording
/// (.mcap), or a table of the sensor's poses in the tracker's frame. The table has the columns x,y,z,qw,qx,qy,qz, in
/// any order if a header line names them: positions in mm (or another unit, as x_m), and a unit quaternion. Rows that
/// are empty, NaN or zero, or whose `status` is invalid, are left out. With --of probe, the probe was tilted about the
/// centre of its face; its axes come from `insonify calibrate probe`.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// Poses of the pivoting sensor (MCAP recording or CSV)
    #[arg(required_unless_present = "tracker", conflicts_with_all = ["tracker", "sensor", "tool"])]
    poses: Option<PathBuf>,

    /// Object that was pivoted
    #[arg(long, value_enum, default_value_t = Of::Stylus)]
    of: Of,

    #[command(flatten)]
    live: LiveArgs,

    #[command(flatten)]
    output: OutputArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Of {
    /// The tip is written to [stylus] tip_mm
    Stylus,
    /// The centre of the face is written to [sensor_from_probe] position_mm; the quaternion there is kept
    Probe,
    /// The tip is written to [needle] tip_mm
    Needle,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let (file, out) = (args.poses.as_deref(), args.output.out.as_deref());
    let motion = Motion { of_needle: args.of == Of::Needle, ..MOTION };
    let accept = |poses: &[Pose], before: NeedleCalibration| accept(args, poses, before);
    let ((found, needle), out) = needle::fitted(file, &args.live, out, &motion, accept)?;
    if let Some(out) = &out {
        write(out, |calibration| set(calibration, args.of, &found, needle))?;
    }
    match (args.of, args.output.json) {
        (Of::Needle, true) => return output::json(&Report::new(found, needle)),
        (Of::Needle, false) => output::text(Report::new(found, needle))?,
        (_, true) => return output::json(&found),
        (_, false) => output::text(found)?,
    }
    out.as_ref().map_or(Ok(()), |out| output::line(out.display()))
}

/// Fits the tip to `poses`. Returns also the needle's calibration, changed if the tool is the needle.
fn accept(args: &Args, poses: &[Pose], before: NeedleCalibration) -> Result<(Pivot, NeedleCalibration), String> {
    let found = match args.of {
        Of::Needle => needle_mount::pivot(poses).map_err(|fault| explained(fault, poses))?,
        Of::Stylus | Of::Probe => calibrate(poses).map_err(|fault| explained(fault, poses))?,
    };
    if found.looks_like_metres() {
        let tip_mm = found.tip_mm.length();
        return Err(format!(
            "the tip lies {tip_mm:.3} mm from the sensor: the positions are likely in metres; a table says so by the columns x_m,y_m,z_m (or x_cm, x_in), a tracker must send mm"
        ));
    }
    let Pivot { rms_mm, max_mm, .. } = found;
    if rms_mm > args.output.max_rms {
        let limit = args.output.max_rms;
        let fault = format!(
            "the tip moved by {rms_mm:.2} mm RMS (at most {max_mm:.2} mm) about the pivot, more than --max-rms {limit}; did it slip, or does the recording hold more than the pivoting?"
        );
        return Err(explained(fault, poses));
    }
    let mut needle = before;
    if args.of == Of::Needle {
        needle.set_tip(&found).map_err(needle::reason)?;
    }
    Ok((found, needle))
}

fn set(calibration: &mut Calibration, of: Of, found: &Pivot, needle: NeedleCalibration) {
    let rms_mm = Some(found.rms_mm);
    match of {
        Of::Stylus => calibration.stylus_tip_mm = Some(Fitted { value: found.tip_mm, rms_mm }),
        Of::Needle => calibration.needle = Some(needle),
        Of::Probe => {
            let orientation = calibration.sensor_from_probe.map(|f| f.value.orientation);
            if orientation.is_none() {
                tracing::warn!(
                    "a pivot doesn't show how the probe is turned: its axes are taken to be the sensor's; `insonify calibrate probe` finds them"
                );
            }
            let orientation = orientation.unwrap_or(Pose::IDENTITY.orientation);
            let value = Pose { position_mm: found.tip_mm, orientation };
            calibration.sensor_from_probe = Some(Fitted { value, rms_mm });
        }
    }
}
