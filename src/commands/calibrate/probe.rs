//! `insonify calibrate probe`: fits the mounting of a sensor on a probe.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Parser;
use insonify::files::Outputs;
use insonify::pose::pivot::{Pivot, explained};
use insonify::pose::probe_mount::{MountSteps, ProbeMount, mount};
use insonify::pose::{Fitted, Pose};

use super::super::{Classify, Failure, output};
use super::{OutputArgs, guided, poses, write};

/// Find the centre of a probe's face and the probe's axes in the frame of its sensor.
///
/// Needs a fixed dimple, such as one drilled into a plate, and up to five recordings (.mcap) or tables of the sensor's
/// poses (columns x,y,z,qw,qx,qy,qz, as for `calibrate pivot`):
///
/// PIVOT: the middle of the face rests in the dimple, and the probe is tilted to all sides. --marker-end, --other-end:
/// the ends of the face rest in the same dimple, one after the other. --spin: the probe is held upright and turned
/// about its own long axis, a quarter turn each way or more. A convex face whose arc is at least 4 mm high needs no
/// --spin, which still makes the beam's axis more certain. --slide: the probe slides straight sideways along a ruler,
/// the marker's side ahead. It replaces the two ends; together with them, it checks which end is at the marker.
///
/// With --tracker, the program asks for the steps one after another, and records them from the station's tracker. The
/// result goes into the station's calibration file, unless --out names another.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// Poses of tilting the probe about the middle of its face
    #[arg(required_unless_present = "tracker", conflicts_with_all = ["tracker", "sensor", "tool"])]
    pivot: Option<PathBuf>,

    /// Poses with the end of the face at the marker in the dimple
    #[arg(long, value_name = "POSES", requires = "other_end")]
    marker_end: Option<PathBuf>,

    /// Poses with the other end of the face in the dimple
    #[arg(long, value_name = "POSES", requires = "marker_end")]
    other_end: Option<PathBuf>,

    /// Poses of a straight slide sideways, the marker's side ahead
    #[arg(long, value_name = "POSES")]
    slide: Option<PathBuf>,

    /// Poses of turning the upright probe about its own long axis
    #[arg(long, value_name = "POSES")]
    spin: Option<PathBuf>,

    /// Record the steps with the tracker of this station (TOML)
    #[arg(long, value_name = "STATION", conflicts_with_all = ["marker_end", "other_end", "slide", "spin"])]
    tracker: Option<PathBuf>,

    /// Sensor of the probe [default: the station's]
    #[arg(long, requires = "tracker")]
    sensor: Option<u16>,

    /// OpenIGTLink name of the probe's tool [default: the station's]
    #[arg(long, value_name = "NAME", requires = "tracker", conflicts_with = "sensor")]
    tool: Option<String>,

    #[command(flatten)]
    output: OutputArgs,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if let Some(station) = &args.tracker {
        let check = |pivot: &Pivot| limit(pivot, args.output.max_rms);
        let chosen = (args.sensor, args.tool.as_deref());
        let (found, out) = guided::run(station, chosen, args.output.out.as_deref(), &check)?;
        return report(&found, Some(&out), args.output.json);
    }
    let pivot = args.pivot.as_deref().unwrap_or(Path::new(""));
    let further = [&args.marker_end, &args.other_end, &args.slide, &args.spin];
    if let Some(out) = &args.output.out {
        let all = further.iter().filter_map(|path| path.as_deref());
        Outputs::apart_from(all.chain([pivot])).replaced("--out", out)?;
    }
    let read = |path: &Option<PathBuf>| path.as_deref().map(poses::read).transpose();
    let tilted = poses::read(pivot)?;
    let (marker, other) = (read(&args.marker_end)?, read(&args.other_end)?);
    let (slide, spin) = (read(&args.slide)?, read(&args.spin)?);
    let steps = MountSteps {
        pivot: &tilted,
        ends: marker.as_deref().zip(other.as_deref()).map(<[_; 2]>::from),
        slide: slide.as_deref(),
        spin: spin.as_deref(),
    };
    let refused = |why: String| anyhow!("{}: {}", pivot.display(), explained(why, &tilted));
    let found = mount(&steps).map_err(|fault| refused(fault.to_string())).input()?;
    limit(&found.pivot, args.output.max_rms).map_err(refused).input()?;
    report(&found, args.output.out.as_deref(), args.output.json)
}

/// Refuses a face centre whose RMS residual exceeds `max_rms` mm.
fn limit(pivot: &Pivot, max_rms: f64) -> Result<(), String> {
    let rms_mm = pivot.rms_mm;
    if rms_mm <= max_rms {
        return Ok(());
    }
    Err(format!(
        "the middle of the face moved by {rms_mm:.2} mm RMS about the dimple, more than --max-rms {max_rms}; did it slip, or does the recording hold more than the tilting?"
    ))
}

/// Writes the mounting to the calibration file `out`, if there is one, and prints it.
fn report(found: &ProbeMount, out: Option<&Path>, json: bool) -> Result<(), Failure> {
    if let Some(out) = out {
        let value: Pose = found.sensor_from_probe;
        let fitted = Fitted { value, rms_mm: Some(found.pivot.rms_mm) };
        write(out, |calibration| calibration.sensor_from_probe = Some(fitted))?;
    }
    if json {
        return output::json(found);
    }
    output::text(found)?;
    out.map_or(Ok(()), |out| output::line(out.display()))
}
