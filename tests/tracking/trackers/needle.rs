//! Tests of `insonify calibrate spin --tracker` and `pivot --tracker`: motions recorded with an emulated tracker.

use std::f64::consts::TAU;
use std::thread::sleep;
use std::time::Duration;

use glam::{DQuat, DVec3};
use insonify::pose::needle_mount::NeedleError;
use insonify::pose::{Calibration, Pose};

use super::landmarks::{Asked, Hand, Tracker};

/// Time for which the hand moves. Then the tracker sees nothing, which ends the recording.
const MOVING: Duration = Duration::from_millis(1000);

/// Axis of the shaft in the sensor's frame.
const AXIS: DVec3 = DVec3::new(0.0, 0.6, 0.8);

/// Tip in the sensor's frame, mm.
const TIP_MM: DVec3 = DVec3::new(10.0, 54.0, 72.0);

/// Pose `n` of a needle that is turned about its shaft; the movement repeats after 200 poses.
fn spinning(n: u32) -> Pose {
    let angle = 1.5 * (TAU * f64::from(n % 200) / 200.0).sin();
    Pose { position_mm: DVec3::X * 200.0, orientation: DQuat::from_axis_angle(AXIS, angle) }
}

/// Pose `n` of a needle that is tilted about its tip.
fn tilting(n: u32) -> Pose {
    let part = f64::from(n % 200) / 200.0;
    let axis = DVec3::new((5.0 * TAU * part).cos(), (5.0 * TAU * part).sin(), 0.0);
    let orientation = DQuat::from_axis_angle(axis, 0.6 * (0.3 + 0.7 * part));
    Pose { position_mm: DVec3::X * 200.0 - orientation * TIP_MM, orientation }
}

/// Lets the hand move along `path` until a motion is accepted. Returns exit code and output of the program.
fn moved(args: &[&str], request: &str, path: fn(u32) -> Pose) -> (Option<i32>, String, String, Calibration) {
    let (dir, tracker) = (tempfile::tempdir().unwrap(), Tracker::start());
    let mut asked = Asked::calibrating(dir.path(), &tracker, args);
    asked.until(request);
    // Nothing moves at first, so the motion is asked for again.
    asked.answer("");
    let said = asked.until("once more");
    assert!(said.contains("no pose came"), "{said}");
    tracker.does(Hand::Along(path));
    sleep(Duration::from_millis(200));
    asked.answer("");
    sleep(MOVING);
    tracker.does(Hand::Gone);
    // On a busy machine the time may be over before the motion is. Then the input ends, and the exit code is 2.
    let (code, report, said) = asked.end();
    (code, report, said, Calibration::load(&dir.path().join("cal.toml")).unwrap())
}

#[test]
fn a_spin_is_recorded_and_the_calibration_file_is_written() {
    let (code, report, said, found) = moved(&["spin", "--json"], "turn it about its own shaft", spinning);
    assert_eq!(code, Some(0), "{said}");
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert!(report["turn_deg"].as_f64().unwrap() > 90.0, "{report}");
    assert!(found.stylus_tip_mm.is_some(), "what else is in the file stays");
    assert_eq!(found.needle_mount(), Err(NeedleError::NoTip));
    let axis = found.needle.unwrap().axis.unwrap();
    assert!(axis.distance(AXIS) < 1e-3, "{axis}");
}

#[test]
fn a_pivot_of_a_needle_is_recorded_and_the_calibration_file_is_written() {
    let (code, report, said, found) = moved(&["pivot", "--of", "needle"], "tilt the tool", tilting);
    assert_eq!(code, Some(0), "{said}");
    assert!(report.contains("tip in the sensor's frame     [10.0") && report.contains("still missing"), "{report}");
    assert_eq!(found.needle_mount(), Err(NeedleError::NoAxis));
    assert!(found.needle.unwrap().tip_mm.unwrap().distance(TIP_MM) < 0.05);
    assert!(found.stylus_tip_mm.is_some(), "what else is in the file stays");
}
