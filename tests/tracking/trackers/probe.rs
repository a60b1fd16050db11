//! Tests of `insonify calibrate probe --tracker`: steps recorded with an emulated tracker, prompts answered through a
//! pipe.

use std::f64::consts::{PI, TAU};
use std::thread::sleep;
use std::time::Duration;

use glam::{DQuat, DVec3};
use insonify::pose::{Calibration, Pose, angle_between};

use super::landmarks::{Asked, Hand, Tracker};

/// Position of the dimple in the tracker's frame, mm.
const DIMPLE: DVec3 = DVec3::new(210.0, -90.0, 40.0);

/// End of a convex probe's face at its marker, probe frame, mm.
const MARKER_END: DVec3 = DVec3::new(-28.0, 0.0, -8.0);

/// Other end of the face, probe frame, mm.
const OTHER_END: DVec3 = DVec3::new(28.0, 0.0, -8.0);

/// Time for which the hand moves in a step. Then the tracker sees nothing, which ends the step.
const MOVING: Duration = Duration::from_millis(1000);

fn sensor_from_probe() -> Pose {
    let orientation = DQuat::from_rotation_z(2.0) * DQuat::from_rotation_x(0.5);
    Pose { position_mm: DVec3::new(10.0, -20.0, 90.0), orientation }
}

/// Pose `n` of the sensor while the probe's point `rests` stays in the dimple. The probe is tilted by up to `tilt` and
/// turned by up to `spin`, rad; the movement repeats after 200 poses.
fn resting(n: u32, rests: DVec3, tilt: f64, spin: f64) -> Pose {
    let part = f64::from(n % 200) / 200.0;
    let axis = DVec3::new((5.0 * TAU * part).cos(), (5.0 * TAU * part).sin(), 0.0);
    let lean = DQuat::from_axis_angle(axis, tilt * (0.3 + 0.7 * part)) * DQuat::from_rotation_x(PI);
    let orientation = lean * DQuat::from_rotation_z(spin * (TAU * part).sin());
    Pose { position_mm: DIMPLE - orientation * rests, orientation } * sensor_from_probe().inverse()
}

/// Answers the prompt for a step with a hand that moves along `path`.
#[track_caller]
fn take(asked: &mut Asked, tracker: &Tracker, step: &str, path: fn(u32) -> Pose) {
    asked.until(step);
    loop {
        tracker.does(Hand::Along(path));
        asked.answer("");
        sleep(MOVING);
        tracker.does(Hand::Gone);
        let said = asked.until("   ");
        if said.trim_end().ends_with(" poses") {
            return;
        }
        // On a busy machine the time may be over before a round is.
        assert!(said.contains("once more"), "{said}");
    }
}

#[test]
fn a_probe_is_calibrated_step_by_step_and_the_calibration_file_is_written() {
    let (dir, tracker) = (tempfile::tempdir().unwrap(), Tracker::start());
    let mut asked = Asked::calibrating(dir.path(), &tracker, &["probe", "--json"]);
    take(&mut asked, &tracker, "1 of 4: rest the middle", |n| resting(n, DVec3::ZERO, 0.6, 0.3));
    take(&mut asked, &tracker, "2 of 4: rest the end", |n| resting(n, MARKER_END, 0.1, 0.0));
    take(&mut asked, &tracker, "3 of 4: rest the other", |n| resting(n, OTHER_END, 0.1, 0.0));
    take(&mut asked, &tracker, "4 of 4: hold the probe", |n| resting(n, DVec3::ZERO, 0.0, 1.5));
    let (code, report, said) = asked.end();
    assert_eq!(code, Some(0), "{said}");
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert!((report["width_mm"].as_f64().unwrap() - 56.0).abs() < 0.1, "{report}");
    assert!(report["beam_from"] == "spin" && report["pivot"]["rms_mm"].as_f64().unwrap() < 0.1, "{report}");
    let found = Calibration::load(&dir.path().join("cal.toml")).unwrap();
    assert!(found.stylus_tip_mm.is_some(), "what else is in the file stays");
    let mount = found.sensor_from_probe.unwrap().value;
    assert!(mount.position_mm.distance(sensor_from_probe().position_mm) < 0.05, "{mount:?}");
    assert!(angle_between(mount.orientation, sensor_from_probe().orientation) < 1e-3, "{mount:?}");
}
