//! Tests of the calibration of a needle by the command line.

use std::f64::consts::TAU;
use std::path::Path;

use glam::{DQuat, DVec3};
use insonify::pose::needle_mount::NeedleMount;
use insonify::pose::{Calibration, Pose};
use serde_json::Value;

use super::record;
use crate::program::{insonify, refused, stderr, succeeded};

/// Position of the dimple in the tracker's frame, mm.
const DIMPLE: DVec3 = DVec3::new(200.0, 100.0, -50.0);

/// Mounting of a sensor at the hub of a needle of 90 mm.
fn sensor_from_needle() -> Pose {
    let orientation = DQuat::from_rotation_y(2.5) * DQuat::from_rotation_x(0.4);
    Pose { position_mm: orientation * DVec3::new(12.0, -5.0, 94.0), orientation }
}

/// Pose of the sensor while the tip rests and the needle has this orientation.
fn at(orientation: DQuat) -> Pose {
    Pose { position_mm: DIMPLE, orientation } * sensor_from_needle().inverse()
}

/// The needle is tilted to all sides.
fn tilting(time_s: f64) -> Pose {
    let axis = DVec3::new((3.0 * time_s).cos(), (3.0 * time_s).sin(), 0.0);
    at(DQuat::from_axis_angle(axis, 0.6 * (1.3 * time_s).sin()) * DQuat::from_rotation_x(2.8))
}

/// The needle is turned about its shaft.
fn spinning(time_s: f64) -> Pose {
    at(DQuat::from_rotation_x(2.8) * DQuat::from_rotation_z(1.5 * (0.2 * TAU * time_s).sin()))
}

fn calibrate(what: &str, input: &Path, more: &[&str]) -> std::process::Output {
    insonify(&[&["calibrate", what, "--of", "needle", input.to_str().unwrap()], more].concat())
}

fn needle(path: &Path) -> NeedleMount {
    Calibration::load(path).unwrap().needle_mount().unwrap()
}

#[test]
fn a_needle_is_calibrated_in_either_order_and_shares_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let [tilted, spun] =
        [("tilted.mcap", tilting as fn(f64) -> Pose), ("spun.mcap", spinning)].map(|(name, motion)| {
            let path = dir.path().join(name);
            record(&path, 600, motion, |_| false);
            path
        });
    let files = ["a.toml", "b.toml"].map(|name| dir.path().join(name));
    let stylus = "version = 1\n[stylus]\ntip_mm = [1, 2, 3]\n";
    files.iter().for_each(|file| std::fs::write(file, stylus).unwrap());
    let [a, b] = files.each_ref().map(|file| file.to_str().unwrap());

    let text = succeeded(&calibrate("pivot", &tilted, &["--out", a]));
    assert!(
        text.contains("over 600 poses") && text.contains("`insonify calibrate spin --of needle` finds it"),
        "{text}"
    );
    let said = Calibration::load(&files[0]).unwrap().needle_mount().unwrap_err().to_string();
    assert!(said.contains("the axis of the needle's shaft is unknown"), "{said}");
    let text = succeeded(&calibrate("spin", &spun, &["--out", a]));
    assert!(text.contains("tip 94.9 mm from its sensor") && text.contains("mm over 95 mm"), "{text}");
    assert!(text.contains("bevel                       unknown") && text.ends_with("a.toml\n"), "{text}");

    let report: Value = serde_json::from_str(&succeeded(&calibrate("spin", &spun, &["--out", b, "--json"]))).unwrap();
    assert!(report["missing"].as_str().unwrap().contains("`insonify calibrate pivot --of needle`"), "{report}");
    assert!(report["across_mm"].is_null() && report["turn_deg"].as_f64().unwrap() > 160.0, "{report}");
    let report: Value =
        serde_json::from_str(&succeeded(&calibrate("pivot", &tilted, &["--out", b, "--json"]))).unwrap();
    assert!(report["missing"].is_null() && report["across_mm"].as_f64().unwrap() < 0.01, "{report}");
    assert!(report["poses"] == 600 && report["needle"]["axis"].as_array().unwrap().len() == 3, "{report}");

    let found = files.each_ref().map(|file| needle(file));
    assert_eq!(found[0], found[1]);
    assert_eq!(std::fs::read_to_string(a).unwrap(), std::fs::read_to_string(b).unwrap());
    let axis = sensor_from_needle().transform_vector(DVec3::Z);
    assert!(found[0].tip_mm.distance(sensor_from_needle().position_mm) < 0.01, "{found:?}");
    assert!(found[0].axis.distance(axis) < 1e-4 && found[0].bevel.is_none(), "{found:?}");
    assert!(Calibration::load(&files[0]).unwrap().stylus_tip_mm.is_some(), "what else is in the file stays");
}

#[test]
fn the_bevel_and_a_stated_sense_are_taken() {
    let dir = tempfile::tempdir().unwrap();
    let (spun, out) = (dir.path().join("spun.mcap"), dir.path().join("cal.toml"));
    let out_text = out.to_str().unwrap();
    record(&spun, 600, spinning, |_| false);
    // At the first pose the needle's x is the tracker's x.
    succeeded(&calibrate("spin", &spun, &["--out", out_text, "--bevel-faces", "+x"]));
    let found = Calibration::load(&out).unwrap().needle.unwrap();
    let x = sensor_from_needle().transform_vector(DVec3::X);
    assert!(found.bevel.unwrap().distance(x) < 1e-3 && !found.points_to_tip, "{found:?}");
    // A turn of the same sensor keeps the bevel.
    succeeded(&calibrate("spin", &spun, &["--out", out_text, "--towards-tip", "-z"]));
    let stated = Calibration::load(&out).unwrap().needle.unwrap();
    assert!(stated.points_to_tip && stated.axis.unwrap().z < 0.0 && stated.bevel.is_some(), "{stated:?}");
    // That of a sensor mounted anew does not.
    let anew = dir.path().join("anew.mcap");
    let turned = |t: f64| spinning(t) * Pose { orientation: DQuat::from_rotation_y(0.4), ..Pose::IDENTITY };
    record(&anew, 600, turned, |_| false);
    let output = calibrate("spin", &anew, &["--out", out_text]);
    succeeded(&output);
    assert!(stderr(&output).contains("the earlier bevel is dropped"), "{}", stderr(&output));
    assert_eq!(Calibration::load(&out).unwrap().needle.unwrap().bevel, None);
}

#[test]
fn wrong_motions_of_a_needle_are_refused_with_what_to_do() {
    let dir = tempfile::tempdir().unwrap();
    let (tilted, spun) = (dir.path().join("tilted.mcap"), dir.path().join("spun.mcap"));
    let (still, out) = (dir.path().join("still.mcap"), dir.path().join("cal.toml"));
    record(&tilted, 600, tilting, |_| false);
    record(&spun, 600, spinning, |_| false);
    record(&still, 600, |_| spinning(0.0), |_| false);
    let to = ["--out", out.to_str().unwrap()];
    refused(&calibrate("pivot", &spun, &to), &["spun.mcap: ", "are for `insonify calibrate spin --of needle`"]);
    refused(&calibrate("spin", &tilted, &to), &["tilted.mcap: ", "are for `insonify calibrate pivot --of needle`"]);
    refused(&calibrate("spin", &still, &to), &["still.mcap: ", "turned by 0° only", "at least 60°"]);
    refused(&calibrate("spin", &spun, &["--towards-tip", "up"]), &["expected one of +x, -x, +y, -y, +z and -z"]);
    refused(&calibrate("spin", &spun, &["--bevel-faces", "1,0,0"]), &["expected one of +x"]);
    refused(&insonify(&["calibrate", "spin", "--of", "stylus", spun.to_str().unwrap()]), &["invalid value 'stylus'"]);
    refused(&insonify(&["calibrate", "spin"]), &["<POSES>"]);
    refused(
        &insonify(&["calibrate", "spin", spun.to_str().unwrap(), "--sensor", "2"]),
        &["cannot be used with", "--sensor"],
    );
    assert!(!out.exists(), "nothing is written");
    // The facet can't face along the shaft.
    let along = at(DQuat::IDENTITY);
    let upright = dir.path().join("upright.mcap");
    let turned = |t: f64| along * Pose { position_mm: DVec3::ZERO, orientation: sensor_spin(1.5 * (1.2 * t).sin()) };
    record(&upright, 600, turned, |_| false);
    refused(&calibrate("spin", &upright, &["--bevel-faces", "-z"]), &["0° from the shaft", "in the first pose"]);
    // A stated sense that the tip contradicts.
    succeeded(&calibrate("pivot", &tilted, &to));
    let before = std::fs::read_to_string(&out).unwrap();
    let wrong = if needle_axis().z > 0.0 { "-z" } else { "+z" };
    refused(&calibrate("spin", &spun, &[&to[..], &["--towards-tip", wrong]].concat()), &["contradicts the tip"]);
    // A calibration file with a fault.
    std::fs::write(&out, "version = 1\n[needle]\naxis = [0, 0, 2]\n").unwrap();
    refused(&calibrate("spin", &spun, &to), &["cal.toml: `needle.axis` is [0.0, 0.0, 2.0], of length 2.000"]);
    std::fs::write(&out, before).unwrap();
    // The largest accepted residual also holds for the axis, in mm.
    let shaky = dir.path().join("shaky.mcap");
    let shaking =
        |t: f64| at(DQuat::from_rotation_y(0.06 * (1.7 * t).sin())) * at(DQuat::IDENTITY).inverse() * spinning(t);
    record(&shaky, 600, shaking, |_| false);
    refused(&calibrate("spin", &shaky, &[&to[..], &["--max-rms", "0.1"]].concat()), &["more than --max-rms 0.1"]);
}

/// Direction of the shaft in the sensor's frame.
fn needle_axis() -> DVec3 {
    sensor_from_needle().transform_vector(DVec3::Z)
}

/// Turn about the shaft, in the sensor's frame.
fn sensor_spin(angle: f64) -> DQuat {
    DQuat::from_axis_angle(needle_axis(), angle)
}

#[test]
fn a_needle_among_several_sensors_must_be_named() {
    let dir = tempfile::tempdir().unwrap();
    let station = dir.path().join("station.toml");
    for (tracker, probe) in [
        ("protocol = 'liberty'\n", "sensor 1"),
        ("protocol = 'openigtlink'\ntool = 'ProbeToTracker'\n", "tool `ProbeToTracker`"),
    ] {
        let text = format!(
            "[scene]\nphantom = 'obstetric'\n[calibration]\npath = 'c.toml'\n\
             [tracker]\ntransport = 'tcp'\naddress = '127.0.0.1:9'\n{tracker}"
        );
        std::fs::write(&station, text).unwrap();
        let station = station.to_str().unwrap();
        let said = [format!("{probe} is the probe's"), "--sensor N or --tool NAME".to_owned()];
        for what in [&["spin"][..], &["pivot", "--of", "needle"]] {
            let output = insonify(&[&["calibrate"], what, &["--tracker", station]].concat());
            refused(&output, &said.each_ref().map(String::as_str));
        }
    }
}
