//! Tests of calibrations and their file.

use super::*;

fn whole() -> Calibration {
    let pose =
        |x: f64, angle| Pose { position_mm: DVec3::new(x, -2.5, 1e-3), orientation: DQuat::from_rotation_y(angle) };
    Calibration {
        scene_from_tracker: Some(Fitted { value: pose(10.0, 0.3), rms_mm: Some(0.61) }),
        sensor_from_probe: Some(Fitted::known(pose(-4.0, 1.3))),
        stylus_tip_mm: Some(Fitted { value: DVec3::new(0.0, 1.0, 120.0), rms_mm: Some(0.2) }),
        needle: Some(needle()),
    }
}

fn needle() -> NeedleCalibration {
    NeedleCalibration {
        tip_mm: Some(DVec3::new(2.0, -30.0, 5.0)),
        rms_mm: Some(0.3),
        axis: Some(DVec3::NEG_Y),
        axis_deg: Some(0.05),
        points_to_tip: true,
        bevel: Some(DVec3::X),
    }
}

#[test]
fn a_calibration_survives_writing_and_reading() {
    let half = NeedleCalibration { tip_mm: None, bevel: None, points_to_tip: false, ..needle() };
    let half = Calibration { needle: Some(half), ..whole() };
    let partial = Calibration { scene_from_tracker: None, ..whole() };
    for calibration in [whole(), Calibration::default(), partial, half] {
        let found = Calibration::parse(&calibration.to_toml()).unwrap();
        assert_eq!(found.needle, calibration.needle);
        assert_eq!(found.stylus_tip_mm, calibration.stylus_tip_mm);
        for (a, b) in [
            (found.scene_from_tracker, calibration.scene_from_tracker),
            (found.sensor_from_probe, calibration.sensor_from_probe),
        ] {
            assert_eq!(a.map(|f| f.rms_mm), b.map(|f| f.rms_mm));
            let (Some(a), Some(b)) = (a, b) else { continue };
            assert!(a.value.position_mm == b.value.position_mm);
            assert!(a.value.orientation.angle_between(b.value.orientation) < 1e-7);
        }
    }
}

#[test]
fn the_documented_file_is_read() {
    let docs = include_str!("../calibration.rs").lines().skip_while(|l| !l.contains("```toml")).skip(1);
    let text: String = docs.take_while(|l| !l.contains("```")).map(|l| l[3..].trim_start().to_owned() + "\n").collect();
    let found = Calibration::parse(&text).unwrap();
    assert_eq!(found.stylus_tip_mm.unwrap().value, DVec3::Z * 120.0);
    assert_eq!(found.scene_from_tracker.unwrap().rms_mm, Some(0.6));
    let needle = found.needle_mount().unwrap();
    assert_eq!((needle.tip_mm, needle.axis, needle.bevel), (DVec3::Z * 95.0, DVec3::Z, Some(DVec3::X)));
}

#[test]
fn frames_are_chained_in_order() {
    let calibration = whole();
    let tracker_from_sensor = Pose { position_mm: DVec3::X, orientation: DQuat::from_rotation_z(1.0) };
    let scene_from_probe = calibration.scene_from_probe(tracker_from_sensor);
    let by_hand =
        calibration.scene_from_tracker.unwrap().value.transform_point(
            tracker_from_sensor.transform_point(calibration.sensor_from_probe.unwrap().value.position_mm),
        );
    assert!(scene_from_probe.position_mm.distance(by_hand) < 1e-12);
    assert_eq!(Calibration::default().scene_from_probe(tracker_from_sensor), tracker_from_sensor);
    // The needle has the tracker in common with the probe, and a sensor of its own.
    let mount = calibration.needle_mount().unwrap();
    let scene_from_tracker = calibration.scene_from_tracker.unwrap().value;
    let tip = scene_from_tracker.transform_point(tracker_from_sensor.transform_point(DVec3::new(2.0, -30.0, 5.0)));
    let along = scene_from_tracker.transform_vector(tracker_from_sensor.transform_vector(DVec3::NEG_Y));
    let found = calibration.scene_from_needle(tracker_from_sensor, &mount);
    assert!(found.position_mm.distance(tip) < 1e-12);
    assert!(found.transform_vector(DVec3::Z).distance(along) < 1e-12);
    let in_tracker = Calibration::default().scene_from_needle(tracker_from_sensor, &mount);
    assert_eq!(in_tracker, tracker_from_sensor * mount.sensor_from_needle());
}

#[test]
fn faulty_files_are_explained() {
    let transform = "position_mm = [0, 0, 0]\nquaternion = [1, 0, 0, 0]\n";
    for (text, part) in [
        ("".to_owned(), "missing field `version`"),
        ("version = 2\nfuture = true".to_owned(), "`version` is 2; this program reads version 1"),
        ("version = 1\nscene_from_traker = 3".to_owned(), "unknown field `scene_from_traker`, expected one of"),
        (format!("version = 1\n[sensor_from_probe]\n{transform}scale = 2"), "unknown field `scale`"),
        ("version = 1\n[stylus]\ntip_mm = [1, 2]".to_owned(), "line 3"),
        ("version = 1\n[stylus]\ntip_mm = [1, 2, nan]".to_owned(), "`stylus.tip_mm` is [1.0, 2.0, NaN]"),
        ("version = 1\n[needle]\ntip_mm = [1, 2]".to_owned(), "line 3"),
        ("version = 1\n[needle]\ntip = [1, 2, 3]".to_owned(), "unknown field `tip`, expected one of `tip_mm`"),
        ("version = 1\n[needle]\ntip_mm = [1, 2, inf]".to_owned(), "`needle.tip_mm` is [1.0, 2.0, inf]; it must be"),
        (
            "version = 1\n[needle]\naxis = [0, 1, 1]".to_owned(),
            "`needle.axis` is [0.0, 1.0, 1.0], of length 1.414; it must be a direction of length 1",
        ),
        ("version = 1\n[needle]\nbevel = [nan, 1, 1]".to_owned(), "`needle.bevel` is [NaN, 1.0, 1.0]"),
        (
            "version = 1\n[needle]\naxis = [0, 0, 1]\nbevel = [0, 0.28, 0.96]".to_owned(),
            "`needle.bevel` is at an angle of 16° to `needle.axis`",
        ),
        ("version = 1\n[stylus".to_owned(), "TOML parse error at line 2"),
        (
            "version = 1\n[scene_from_tracker]\nposition_mm = [0, 0, 0]\nquaternion = [1, 1, 0, 0]".to_owned(),
            "[scene_from_tracker]: the pose's quaternion (qw,qx,qy,qz) has norm 1.414",
        ),
    ] {
        let found = Calibration::parse(&text).unwrap_err().to_string();
        assert!(found.contains(part), "{found}");
    }
    let found = Calibration::load(Path::new("/no/such.toml")).unwrap_err().to_string();
    assert!(found.starts_with("cannot read the calibration file /no/such.toml: there is no such file"), "{found}");
    assert!(
        found.contains("`[calibration] path`") && found.contains("`insonify calibrate landmarks --tracker"),
        "{found}"
    );
}

#[test]
fn a_stations_sensor_mounting_is_added_once_only() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("c.toml");
    let pose = Pose { position_mm: DVec3::Z, ..Pose::IDENTITY };
    let source = CalibrationSource { path: Some(path.clone()), sensor_from_probe: Some(pose) };
    std::fs::write(&path, Calibration { sensor_from_probe: None, ..whole() }.to_toml()).unwrap();
    assert_eq!(source.load().unwrap().sensor_from_probe, Some(Fitted::known(pose)));
    std::fs::write(&path, whole().to_toml()).unwrap();
    assert!(source.load().unwrap_err().to_string().contains("given twice"));
    assert_eq!(CalibrationSource::default().load().unwrap(), Calibration::default());
}

#[test]
fn an_earlier_file_holds_where_a_later_one_is_silent() {
    let dir = tempfile::tempdir().unwrap();
    let [ours, out] = ["station.toml", "out.toml"].map(|name| dir.path().join(name));
    let tip = |station: Option<&Path>| {
        let found = Calibration::of_files(station.into_iter().chain([out.as_path()])).unwrap();
        found.stylus_tip_mm.map(|tip| tip.value)
    };
    assert_eq!((tip(None), tip(Some(&ours))), (None, None));
    let write = |path: &Path, calibration: Calibration| std::fs::write(path, calibration.to_toml()).unwrap();
    let stylus = |z: f64| Calibration { stylus_tip_mm: Some(Fitted::known(DVec3::Z * z)), ..Calibration::default() };
    write(&ours, stylus(120.0));
    assert_eq!(tip(Some(&ours)), Some(DVec3::Z * 120.0));
    write(&out, Calibration::default());
    assert_eq!(tip(Some(&ours)), Some(DVec3::Z * 120.0));
    write(&out, stylus(90.0));
    assert_eq!(tip(Some(&ours)), Some(DVec3::Z * 90.0));
}
