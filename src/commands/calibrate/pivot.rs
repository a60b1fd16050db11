//! `insonify calibrate pivot`: fits the position of a stylus' tip to poses recorded while it pivots about the tip.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::{Parser, ValueEnum};
use insonify::files::Outputs;
use insonify::pose::pivot::{Pivot, calibrate, explained};
use insonify::pose::{Calibration, Fitted, Pose};

use super::super::{Classify, Failure, output};
use super::{OutputArgs, poses, write};

/// Find the tip of a stylus, or the centre of a probe's face, in the frame of its sensor.
///
/// Rest the tip in a dimple and tilt the stylus to all sides while the tracker is recorded. POSES is that recording
/// (.mcap), or a table of the sensor's poses in the tracker's frame. The table has the columns x,y,z,qw,qx,qy,qz, in
/// any order if a header line names them: positions in mm (or another unit, as x_m), and a unit quaternion. Rows that
/// are empty, NaN or zero, or whose `status` is invalid, are left out. With --of probe, the probe was tilted about the
/// centre of its face; its axes come from `insonify calibrate probe`.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// Poses of the pivoting sensor (MCAP recording or CSV)
    poses: PathBuf,

    /// Object that was pivoted
    #[arg(long, value_enum, default_value_t = Of::Stylus)]
    of: Of,

    #[command(flatten)]
    output: OutputArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Of {
    /// The tip is written to [stylus] tip_mm
    Stylus,
    /// The centre of the face is written to [sensor_from_probe] position_mm; the quaternion there is kept
    Probe,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if let Some(out) = &args.output.out {
        Outputs::apart_from([&args.poses]).replaced("--out", out)?;
    }
    let poses = poses::read(&args.poses)?;
    let found = calibrate(&poses).map_err(|fault| anyhow!(explained(fault, &poses))).input_of(&args.poses)?;
    if found.looks_like_metres() {
        let (path, tip_mm) = (args.poses.display(), found.tip_mm.length());
        return Err(Failure::Input(anyhow!(
            "{path}: the tip lies {tip_mm:.3} mm from the sensor: the positions are likely in metres; a table says so by the columns x_m,y_m,z_m (or x_cm, x_in), a tracker must send mm"
        )));
    }
    let Pivot { rms_mm, max_mm, .. } = found;
    if rms_mm > args.output.max_rms {
        let (path, limit) = (args.poses.display(), args.output.max_rms);
        let fault = format!(
            "the tip moved by {rms_mm:.2} mm RMS (at most {max_mm:.2} mm) about the pivot, more than --max-rms {limit}; did it slip, or does the recording hold more than the pivoting?"
        );
        return Err(Failure::Input(anyhow!("{path}: {}", explained(fault, &poses))));
    }
    if let Some(out) = &args.output.out {
        write(out, |calibration| set(calibration, args.of, &found))?;
    }
    if args.output.json {
        return output::json(&found);
    }
    output::text(found)?;
    args.output.out.as_ref().map_or(Ok(()), |out| output::line(out.display()))
}

fn set(calibration: &mut Calibration, of: Of, found: &Pivot) {
    let rms_mm = Some(found.rms_mm);
    match of {
        Of::Stylus => calibration.stylus_tip_mm = Some(Fitted { value: found.tip_mm, rms_mm }),
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
