//! Tests of columns of points and poses by their names, and of the mounting of a probe, by the command line.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};
use insonify::pose::{Calibration, Pose};
use serde_json::Value;

use crate::program::{insonify, refused, stderr, succeeded};

fn written(dir: &Path, name: &str, text: &str) -> PathBuf {
    let path = dir.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

fn report(arguments: &[&str]) -> Value {
    serde_json::from_str(&succeeded(&insonify(&[arguments, &["--json"]].concat()))).unwrap()
}

#[test]
fn landmarks_along_the_patients_axes_are_taken_in_lps() {
    let dir = tempfile::tempdir().unwrap();
    let rows = "0,-100,0,10,20,0,FRONT\n100,0,0,110,120,0,LEFT\n-100,0,0,-90,120,0,RIGHT\n0,-80,80,10,40,80,UP\n";
    let fit = |head: &str| {
        let path = written(dir.path(), "p.csv", &format!("{head}\n{rows}"));
        let output = insonify(&["calibrate", "landmarks", path.to_str().unwrap(), "--json"]);
        let report: Value = serde_json::from_str(&succeeded(&output)).unwrap();
        let numbers = |key: &str| -> Vec<f64> {
            report["scene_from_tracker"][key].as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect()
        };
        (numbers("position_mm"), numbers("quaternion"), stderr(&output))
    };
    let (position, quaternion, said) = fit("x,y,z,tx,ty,tz,name");
    assert!(
        (position[0] + 10.0).abs() < 1e-9 && (position[1] + 120.0).abs() < 1e-9 && said.is_empty(),
        "{position:?} {said}"
    );
    assert!((quaternion[0].abs() - 1.0).abs() < 1e-12);
    // Turned by 180° about z.
    let (position, quaternion, said) = fit("r,a,s,tx,ty,tz,name");
    assert!((quaternion[3].abs() - 1.0).abs() < 1e-12, "{quaternion:?}");
    assert!((position[0] - 10.0).abs() < 1e-9 && (position[1] - 120.0).abs() < 1e-9, "{position:?}");
    assert!(said.contains("r,a,s are the patient's axes") && said.contains("x = −r"), "{said}");
    let (turned, ..) = fit("tx,ty,tz,x,y,z,name");
    assert!((turned[0] - 10.0).abs() < 1e-9 && (turned[1] - 120.0).abs() < 1e-9, "{turned:?}");
    let path = written(dir.path(), "q.csv", &format!("x,y,z,a1,a2,a3,name\n{rows}"));
    refused(
        &insonify(&["calibrate", "landmarks", path.to_str().unwrap()]),
        &["unknown column `a1`", "tx,ty,tz of the tracker"],
    );
}

#[test]
fn landmarks_along_the_patients_axes_are_turned_into_the_axes_of_a_stations_scene() {
    let dir = tempfile::tempdir().unwrap();
    let station = written(dir.path(), "station.toml", "[scene]\nphantom = 'obstetric'\n");
    let rows = "0,-100,0,10,20,0,FRONT\n100,0,0,110,120,0,LEFT\n-100,0,0,-90,120,0,RIGHT\n0,-80,80,10,40,80,UP\n";
    let fit = |head: &str, more: &[&str]| {
        let path = written(dir.path(), "p.csv", &format!("{head}\n{rows}"));
        let output = insonify(&[&["calibrate", "landmarks", path.to_str().unwrap(), "--json"], more].concat());
        let report: Value = serde_json::from_str(&succeeded(&output)).unwrap();
        let numbers = |key: &str| -> Vec<f64> {
            report["scene_from_tracker"][key].as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect()
        };
        let [position, turn] = [numbers("position_mm"), numbers("quaternion")];
        let orientation = DQuat::from_xyzw(turn[1], turn[2], turn[3], turn[0]);
        (Pose { position_mm: DVec3::from_slice(&position), orientation }, stderr(&output))
    };
    let for_lps = DVec3::new(-10.0, -120.0, 0.0);
    for head in ["l,p,s,tx,ty,tz,name", "# CoordinateSystem = LPS\nx,y,z,tx,ty,tz,name"] {
        let (found, said) = fit(head, &[]);
        assert!(found.position_mm.distance(for_lps) < 1e-9, "{found:?}");
        assert!(said.contains("the result is for a scene in LPS") && said.contains("--station"), "{said}");
        // The phantom's x is left, its y cranial, its z anterior.
        let (found, said) = fit(head, &["--station", station.to_str().unwrap()]);
        assert!(found.position_mm.distance(DVec3::new(-10.0, 0.0, 120.0)) < 1e-9, "{found:?}");
        assert!((found.orientation * DVec3::Z).distance(DVec3::Y) < 1e-9, "{found:?}");
        assert!(!said.contains("the result is for a scene in LPS"), "{said}");
    }
    // The scene's own axes stay.
    let (found, said) = fit("x,y,z,tx,ty,tz,name", &["--station", station.to_str().unwrap()]);
    assert!(found.position_mm.distance(for_lps) < 1e-9 && said.is_empty(), "{found:?} {said}");
}

/// Poses of a probe's sensor while the probe's point `rests` stays in a dimple; the probe is tilted and turned.
fn poses(rests: DVec3, tilt: f64, spin: f64) -> Vec<Pose> {
    let pose = |i: u32| {
        let part = f64::from(i) / 300.0;
        let axis = DVec3::new((5.0 * TAU * part).cos(), (5.0 * TAU * part).sin(), 0.0);
        let lean = DQuat::from_axis_angle(axis, tilt * (0.3 + 0.7 * part)) * DQuat::from_rotation_x(TAU / 2.0);
        let orientation = lean * DQuat::from_rotation_z(spin * (TAU * part).sin());
        let probe = Pose { position_mm: DVec3::new(200.0, -50.0, 30.0) - orientation * rests, orientation };
        probe * sensor_from_probe().inverse()
    };
    (0..300).map(pose).collect()
}

fn sensor_from_probe() -> Pose {
    let orientation = DQuat::from_rotation_z(2.0) * DQuat::from_rotation_x(0.5);
    Pose { position_mm: DVec3::new(10.0, -20.0, 90.0), orientation }
}

fn table(dir: &Path, name: &str, head: &str, poses: &[Pose], metres: bool) -> PathBuf {
    let line = |pose: &Pose| {
        let [x, y, z, qw, qx, qy, qz] = pose.components();
        let unit = if metres { 1e-3 } else { 1.0 };
        format!("{},{},{},{qx},{qy},{qz},{qw}\n", x * unit, y * unit, z * unit)
    };
    written(dir, name, &format!("{head}\n{}", poses.iter().map(line).collect::<String>()))
}

#[test]
fn a_pivot_in_metres_with_the_scalar_last_gives_millimetres() {
    let dir = tempfile::tempdir().unwrap();
    let all = poses(DVec3::ZERO, 0.6, 0.3);
    let path = table(dir.path(), "p.csv", "x_m,y_m,z_m,qx,qy,qz,qw", &all, true);
    let found = report(&["calibrate", "pivot", path.to_str().unwrap()]);
    let tip: Vec<f64> = found["tip_mm"].as_array().unwrap().iter().map(|n| n.as_f64().unwrap()).collect();
    assert!(DVec3::new(tip[0], tip[1], tip[2]).distance(DVec3::new(10.0, -20.0, 90.0)) < 1e-6, "{tip:?}");
    // Metres that aren't named are noticed by the tip.
    let (path, out) = (table(dir.path(), "q.csv", "x,y,z,qx,qy,qz,qw", &all, true), dir.path().join("cal.toml"));
    let output = insonify(&["calibrate", "pivot", path.to_str().unwrap(), "--out", out.to_str().unwrap()]);
    refused(&output, &["q.csv: ", "the positions are likely in metres", "columns x_m,y_m,z_m"]);
    assert!(!out.exists(), "nothing is written");
}

#[test]
fn quaternions_that_were_misread_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let pivot = |name: &str, head: &str, all: &[Pose]| {
        let path = table(dir.path(), name, head, all, false);
        insonify(&["calibrate", "pivot", path.to_str().unwrap()])
    };
    // The numbers are x,y,z,w.
    let all = poses(DVec3::ZERO, 0.6, 0.3);
    refused(&pivot("a.csv", "x,y,z,qw,qx,qy,qz", &all), &["read as x,y,z,w", "the columns are qx,qy,qz,qw"]);
    let turned_back: Vec<Pose> = all.iter().map(|p| Pose { orientation: p.orientation.conjugate(), ..*p }).collect();
    refused(&pivot("b.csv", "x,y,z,qx,qy,qz,qw", &turned_back), &["with the opposite turn", "conjugate"]);
    let path = table(dir.path(), "c.csv", "x,y,z,qw,qx,qy,qz", &all, false);
    let end = path.to_str().unwrap();
    let probe = insonify(&["calibrate", "probe", end, "--marker-end", end, "--other-end", end]);
    refused(&probe, &["c.csv: ", "the columns are qx,qy,qz,qw"]);
}

#[test]
fn the_axes_of_a_probe_are_calibrated_from_four_tables() {
    let dir = tempfile::tempdir().unwrap();
    let head = "x,y,z,qx,qy,qz,qw";
    let make = |name: &str, poses: &[Pose]| table(dir.path(), name, head, poses, false).to_str().unwrap().to_owned();
    let pivot = make("pivot.csv", &poses(DVec3::ZERO, 0.6, 0.3));
    let [marker, other] = [("marker.csv", -28.0), ("other.csv", 28.0)]
        .map(|(name, x)| make(name, &poses(DVec3::new(x, 0.0, 0.0), 0.1, 0.0)));
    let spin = make("spin.csv", &poses(DVec3::ZERO, 0.0, 1.5));
    let out = dir.path().join("cal.toml");
    let ends =
        ["calibrate", "probe", &pivot, "--marker-end", &marker, "--other-end", &other, "--out", out.to_str().unwrap()];
    refused(&insonify(&ends), &["the beam's direction is unknown", "(--spin)", "too flat"]);
    assert!(!out.exists());
    let text = succeeded(&insonify(&[&ends[..], &["--spin", &spin]].concat()));
    assert!(text.contains("face 56.0 mm wide") && text.contains("beam from the turn about the probe's axis"), "{text}");
    let found = Calibration::load(&out).unwrap().sensor_from_probe.unwrap().value;
    assert!(found.position_mm.distance(sensor_from_probe().position_mm) < 1e-6, "{found:?}");
    assert!(insonify::pose::angle_between(found.orientation, sensor_from_probe().orientation) < 1e-6, "{found:?}");
    refused(&insonify(&["calibrate", "probe", &pivot]), &["--marker-end, --other-end"]);
    refused(&insonify(&["calibrate", "probe", &pivot, "--marker-end", &marker]), &["--other-end"]);
}

#[test]
fn exchanged_landmarks_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let points =
        [[0.0, 0.0, 80.0], [120.0, 10.0, 20.0], [-118.0, -6.0, 22.0], [3.0, 140.0, 35.0], [-4.0, -130.0, 30.0]];
    let touched = [0, 1, 3, 2, 4].map(|i: usize| points[i]);
    let line = |(i, (p, t)): (usize, (&[f64; 3], &[f64; 3]))| {
        format!("{},{},{},{},{},{},P{i}\n", p[0], p[1], p[2], t[0] + 300.0, t[1], t[2])
    };
    let text: String = points.iter().zip(&touched).enumerate().map(line).collect();
    let path = written(dir.path(), "p.csv", &text);
    refused(
        &insonify(&["calibrate", "landmarks", path.to_str().unwrap()]),
        &["`P2` and `P3`", "likely touched in each other's turn"],
    );
}

#[test]
fn landmarks_without_arguments_name_both_ways() {
    refused(&insonify(&["calibrate", "landmarks"]), &["give PAIRS", "--tracker STATION"]);
}

#[test]
fn a_landmark_that_was_touched_elsewhere_is_named_though_the_fit_is_accepted() {
    let dir = tempfile::tempdir().unwrap();
    let points: [[i32; 3]; 7] =
        [[0, 0, 80], [0, 90, 60], [0, -90, 55], [140, 0, 0], [-135, 0, 0], [90, -70, 60], [-85, -70, 60]];
    let line = |(i, [x, y, z]): (usize, [i32; 3])| {
        let off = if i == 3 { 9 } else { 0 };
        format!("{x},{y},{z},{},{y},{},P{i}\n", x + 300, z + off)
    };
    let text: String = points.into_iter().enumerate().map(line).collect();
    let path = written(dir.path(), "p.csv", &text);
    let output = insonify(&["calibrate", "landmarks", path.to_str().unwrap()]);
    succeeded(&output);
    let said = stderr(&output);
    assert!(said.contains("`P3` was likely touched elsewhere: without it, the RMS residual is 0.00 mm"), "{said}");
}

#[test]
fn the_doctor_examines_the_calibration_of_a_station() {
    let dir = tempfile::tempdir().unwrap();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/sphere.glb");
    let body = format!("[scene]\npath = '{}'\nbackground = 'liver'\n[calibration]\npath = 'c.toml'\n", scene.display());
    let station = written(dir.path(), "station.toml", &body);
    let doctor = || insonify(&["doctor", station.to_str().unwrap()]);
    let output = doctor();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("error") && said.contains("c.toml: there is no such file"), "{said}");
    assert!(stderr(&output).contains("station.toml has 1 error"), "{}", stderr(&output));
    written(dir.path(), "c.toml", "version = 1\n[stylus]\ntip_mm = [0, 0, 0.12]\n");
    let said = succeeded(&doctor());
    assert!(said.contains("warning") && said.contains("0.120 mm from its sensor: is it in metres?"), "{said}");
    written(dir.path(), "c.toml", "version = 1\n[stylus]\ntip_mm = [0, 0, 120]\n");
    assert!(!succeeded(&doctor()).contains("stylus"));
}
