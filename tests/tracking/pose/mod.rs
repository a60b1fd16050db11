//! Tests of the way from a recorded stream to poses, and of calibrations by the command line.

// clippy counts helpers as outside of tests; a failing helper fails its test.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod columns;
mod estimator;
mod needle;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::process::Output;

use bytes::BytesMut;
use glam::{DQuat, DVec3};
use insonify::pose::{
    Calibration, Estimator, Fitted, Measurement, Pose, Reading, Settings, TrackingState, angle_between,
};
use insonify::recording::{Entry, RecordingInfo, RecordingReader, RecordingWriter, poses};
use insonify::station::Station;
use insonify::tracker::{Protocol, ascii_line};
use serde_json::Value;

use crate::program::{insonify, refused, succeeded};

const START_NS: u64 = 1_790_000_000_000_000_000;
const PERIOD_NS: u64 = 16_666_667;

/// Allocator that counts the allocations of the calling thread.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn pose_at(time_s: f64) -> Pose {
    let orientation = DQuat::from_rotation_y((0.5 * time_s).sin()) * DQuat::from_rotation_x(0.3);
    Pose { position_mm: DVec3::new(40.0 * (0.8 * time_s).sin(), 5.0 * time_s, 80.0), orientation }
}

/// Writes a recording of `count` poses, 60 a second, without those that `lost` selects.
fn record(path: &Path, count: u32, pose: impl Fn(f64) -> Pose, lost: impl Fn(u32) -> bool) {
    let info = RecordingInfo {
        protocol: Protocol::AsciiLine,
        device: "test board".into(),
        scene: "none".into(),
        start_time_ns: START_NS,
        sensor: None,
        needle: None,
    };
    let mut writer = RecordingWriter::create(path, &info).unwrap();
    for i in (0..count).filter(|i| !lost(*i)) {
        let line = ascii_line::encode(i, u64::from(i) * 16_667, &pose(f64::from(i) / 60.0));
        writer.raw(START_NS + u64::from(i) * PERIOD_NS, line.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
}

/// Measurements in a recording, read by the decoder of its protocol.
fn measurements(path: &Path) -> Vec<Measurement> {
    let mut reader = RecordingReader::open(path).unwrap();
    let mut decoder = reader.info().protocol.decoder();
    let mut buffer = BytesMut::new();
    let mut found = Vec::new();
    while let Some(entry) = reader.next_entry().unwrap() {
        let Entry::Raw { host_time_ns, bytes } = entry else { continue };
        buffer.extend_from_slice(&bytes);
        while let Some(record) = decoder.decode(&mut buffer).unwrap() {
            let (sequence, device_time_us) = (record.sequence, record.device_time_us);
            found.push(Measurement { host_time_ns, device_time_us, sequence, reading: record.reading });
        }
    }
    found
}

#[test]
fn a_recorded_stream_with_dropouts_is_followed_and_its_gaps_are_shown() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("session.mcap");
    // Gaps of 0.2, 1 and 3 s.
    let lost = |i: u32| (200..212).contains(&i) || (300..360).contains(&i) || (500..680).contains(&i);
    record(&path, 900, pose_at, lost);
    let mut estimator = Estimator::new(Settings::default());
    let mut next = measurements(&path).into_iter().peekable();
    let mut seen = Vec::new();
    let mut worst_mm: f64 = 0.0;
    for frame in 0..=450_u64 {
        let now_ns = START_NS + 33_333_333 * frame;
        while let Some(measurement) = next.next_if(|m| m.host_time_ns <= now_ns) {
            estimator.push(&measurement);
        }
        let estimate = estimator.sample(now_ns, now_ns + 20_000_000);
        if seen.last() != Some(&estimate.state) {
            seen.push(estimate.state);
        }
        assert_eq!(estimate.scene_from_probe.is_none(), estimate.state == TrackingState::Lost);
        if let (TrackingState::Good, Some(pose)) = (estimate.state, estimate.scene_from_probe) {
            let truth = pose_at((now_ns + 20_000_000 - START_NS) as f64 * 1e-9);
            worst_mm = worst_mm.max(pose.position_mm.distance(truth.position_mm));
        }
    }
    use TrackingState::{Good, Held, Lost, Stale};
    assert_eq!(seen, [Held, Good, Held, Good, Held, Stale, Held, Good, Held, Stale, Lost, Held, Good]);
    let counters = estimator.counters();
    assert_eq!((counters.used, counters.missing, counters.measurements), (648, 252, 648), "{counters:?}");
    println!("worst error of a good pose: {worst_mm:.2} mm");
    // A good pose may be 0.1 s old: at most 32 mm/s, less the compensation by 30 ms of prediction.
    assert!(worst_mm < 4.0, "{worst_mm}");
}

#[test]
fn the_recorded_exam_is_followed_without_a_drop() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/exams/obstetric_sweep.mcap");
    let mut estimator = Estimator::new(Settings::default());
    let (recorded, _) = poses(&path).unwrap();
    let mut squares = (0.0, 0.0);
    let found = measurements(&path);
    for (measurement, timed) in found.iter().zip(&recorded) {
        estimator.push(measurement);
        let now_ns = measurement.host_time_ns;
        let pose = estimator.sample(now_ns, now_ns).scene_from_probe.unwrap();
        squares.0 += pose.position_mm.distance_squared(timed.pose.position_mm);
        squares.1 += angle_between(pose.orientation, timed.pose.orientation).to_degrees().powi(2);
    }
    let counters = *estimator.counters();
    let dropped: Vec<_> =
        counters.named().filter(|(name, n)| *n > 0 && !["measurements", "used"].contains(name)).collect();
    assert_eq!((counters.used, dropped), (found.len() as u64, vec![]));
    let rms = |sum: f64| (sum / found.len() as f64).sqrt();
    println!(
        "exam: filtered poses are {:.3} mm and {:.3}° from the recorded ones (RMS)",
        rms(squares.0),
        rms(squares.1)
    );
    assert!(rms(squares.0) < 1.0 && rms(squares.1) < 1.0);
}

#[test]
fn nothing_is_allocated_per_measurement_or_frame() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("session.mcap");
    record(&path, 600, pose_at, |i| (300..420).contains(&i));
    let measurements = measurements(&path);
    let mut estimator = Estimator::new(Settings::default());
    let before = ALLOCATIONS.get();
    for (i, measurement) in measurements.iter().enumerate() {
        estimator.push(measurement);
        let now_ns = measurement.host_time_ns;
        // Predicted and interpolated ones.
        let display_ns = if i % 2 == 0 { now_ns + 20_000_000 } else { now_ns - 50_000_000 };
        assert_ne!(estimator.sample(now_ns, display_ns).state, TrackingState::Lost);
    }
    assert_eq!(ALLOCATIONS.get(), before);
    assert_eq!(estimator.counters().used, 480);
}

fn calibrate(what: &str, input: &Path, more: &[&str]) -> Output {
    insonify(&[&["calibrate", what, input.to_str().unwrap()], more].concat())
}

const LANDMARKS: [(&str, [f64; 3]); 5] = [
    ("navel", [0.0, 0.0, 80.0]),
    ("left side", [120.0, 10.0, 20.0]),
    ("right side", [-118.0, -6.0, 22.0]),
    ("chest", [3.0, 140.0, 35.0]),
    ("pelvis", [-4.0, -130.0, 30.0]),
];

fn scene_from_tracker() -> Pose {
    Pose {
        position_mm: DVec3::new(300.0, -40.0, 120.0),
        orientation: DQuat::from_rotation_z(2.0) * DQuat::from_rotation_x(0.4),
    }
}

/// Writes a landmark file whose measured points are changed by `change`; returns its path.
fn landmarks(dir: &Path, change: impl Fn(usize, DVec3) -> DVec3) -> PathBuf {
    let mut text = "x,y,z,tx,ty,tz,name\n".to_owned();
    for (i, (name, scene)) in LANDMARKS.into_iter().enumerate() {
        let t = change(i, scene_from_tracker().inverse().transform_point(scene.into()));
        let [x, y, z] = scene;
        text += &format!("{x},{y},{z},{},{},{},{name}\n", t.x, t.y, t.z);
    }
    let path = dir.join("landmarks.csv");
    std::fs::write(&path, text).unwrap();
    path
}

/// Sensor pose of a stylus that is tilted to all sides about its tip.
fn pivoting(time_s: f64) -> Pose {
    let axis = DVec3::new((3.0 * time_s).cos(), (3.0 * time_s).sin(), 0.0);
    let orientation = DQuat::from_axis_angle(axis, 0.6 * (1.3 * time_s).sin()) * DQuat::from_rotation_z(time_s.sin());
    Pose { position_mm: DVec3::new(200.0, 100.0, -50.0) - orientation * DVec3::new(2.0, -1.0, 140.0), orientation }
}

#[test]
fn landmarks_and_a_pivot_share_one_file_that_a_station_uses() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("cal.toml");
    let out_text = out.to_str().unwrap();
    let recording = dir.path().join("pivot.mcap");
    record(&recording, 600, pivoting, |_| false);
    let text = succeeded(&calibrate("pivot", &recording, &["--out", out_text]));
    assert!(
        text.contains("tip in the sensor's frame     [2.000, -1.000, 140.000] mm") && text.contains("over 600 poses"),
        "{text}"
    );

    let wobble = |i: usize, p: DVec3| p + DVec3::X * if i.is_multiple_of(2) { 0.5 } else { -0.5 };
    let text = succeeded(&calibrate("landmarks", &landmarks(dir.path(), wobble), &["--out", out_text]));
    assert!(text.contains("RMS residual 0.") && text.contains("right side"), "{text}");
    let json = succeeded(&calibrate("landmarks", &landmarks(dir.path(), |_, p| p), &["--out", out_text, "--json"]));
    let report: Value = serde_json::from_str(&json).unwrap();
    assert!(report["rms_mm"].as_f64().unwrap() < 1e-6);
    assert_eq!(report["landmarks"][1]["name"], "left side");
    assert_eq!(report["scene_from_tracker"]["quaternion"].as_array().unwrap().len(), 4);

    // The tip is kept, and a station reads everything.
    let found = Calibration::load(&out).unwrap();
    assert!(found.stylus_tip_mm.unwrap().value.distance(DVec3::new(2.0, -1.0, 140.0)) < 0.01);
    assert!(found.scene_from_tracker.unwrap().value.position_mm.distance(scene_from_tracker().position_mm) < 1e-6);
    let station = dir.path().join("station.toml");
    let body = "[scene]\nphantom = 'obstetric'\n[calibration]\npath = 'cal.toml'\nsensor_from_probe_mm = [0, 0, 40]\n[filter]\nheld_ms = 80";
    std::fs::write(&station, body).unwrap();
    let settings = Station::load(&station).unwrap().pose_settings().unwrap();
    let mount = Pose { position_mm: DVec3::Z * 40.0, ..Pose::IDENTITY };
    assert_eq!((settings.filter.held_ms, settings.calibration.sensor_from_probe), (80.0, Some(Fitted::known(mount))));
    let mut estimator = Estimator::new(settings);
    let reading = Reading::Pose(Pose::IDENTITY);
    estimator.push(&Measurement { host_time_ns: START_NS, device_time_us: None, sequence: None, reading });
    let pose = estimator.sample(START_NS, START_NS).scene_from_probe.unwrap();
    assert!(pose.position_mm.distance(scene_from_tracker().transform_point(DVec3::Z * 40.0)) < 1e-6);
}

#[test]
fn a_probe_is_pivoted_about_its_face() {
    let dir = tempfile::tempdir().unwrap();
    let (csv, out) = (dir.path().join("poses.csv"), dir.path().join("cal.toml"));
    let lines = (0..300).map(|i| pivoting(f64::from(i) / 30.0).components().map(|c| c.to_string()).join(","));
    std::fs::write(&csv, lines.collect::<Vec<_>>().join("\n")).unwrap();
    let output = calibrate("pivot", &csv, &["--of", "probe", "--out", out.to_str().unwrap(), "--json"]);
    let report: Value = serde_json::from_str(&succeeded(&output)).unwrap();
    assert_eq!(report["poses"], 300);
    assert!(String::from_utf8_lossy(&output.stderr).contains("its axes are taken to be the sensor's"));
    let found = Calibration::load(&out).unwrap().sensor_from_probe.unwrap();
    assert!(found.value.position_mm.distance(DVec3::new(2.0, -1.0, 140.0)) < 1e-6);
}

#[test]
fn wrong_landmarks_are_refused_with_the_reason() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("cal.toml");
    let run = |path: &Path| calibrate("landmarks", path, &["--out", out.to_str().unwrap()]);
    let mirror = |_, p: DVec3| DVec3::new(-p.x, p.y, p.z);
    refused(
        &run(&landmarks(dir.path(), mirror)),
        &["landmarks.csv: ", "mirror image", "an axis of the tracker is reversed"],
    );
    refused(&run(&landmarks(dir.path(), |_, p| p * 0.1)), &["0.1000 times", "is a unit wrong"]);
    let one_off = |i, p: DVec3| if i == 3 { p + DVec3::Y * 40.0 } else { p };
    refused(&run(&landmarks(dir.path(), one_off)), &["more than --max-rms 5", "the worst is `chest`", "residual mm"]);
    let path = dir.path().join("wrong.csv");
    for (text, words) in [
        ("0,0,0,0,0,0\n1,0,0,1,0,0\n", "2 landmarks are too few"),
        ("0,0,0,0,0,0\n9,0,0,9,0,0\n50,0,0,50,0,0\n", "lie on one line"),
        ("0,0,0,0,0,0\n1,0,0,1,0\n", "line 2: expected `x,y,z,tx,ty,tz`"),
        (
            "0,0,0,0,0,0\n1,0,0,1,0,nan\n1,1,1,1,1,1",
            "line 2: `tz` is `nan`; it must be a decimal number that is finite",
        ),
        ("", "there is no line with"),
    ] {
        std::fs::write(&path, text).unwrap();
        refused(&run(&path), &["wrong.csv: ", words]);
    }
    std::fs::write(&path, [0xff, 0xfe, 0x00]).unwrap();
    refused(&run(&path), &["cannot read the landmarks"]);
    refused(&run(Path::new("/no/such.csv")), &["cannot read the landmarks /no/such.csv: No such file"]);
    assert!(!out.exists(), "nothing is written");
    // A file that isn't a calibration is not overwritten.
    std::fs::write(&out, "version = 1\nmine = true\n").unwrap();
    refused(&run(&landmarks(dir.path(), |_, p| p)), &["cal.toml: ", "unknown field `mine`"]);
    assert_eq!(std::fs::read_to_string(&out).unwrap(), "version = 1\nmine = true\n");
    refused(&calibrate("landmarks", &path, &["--max-rms", "-1"]), &["expected a number above 0"]);
}

#[test]
fn wrong_pivots_are_refused_with_the_reason() {
    let dir = tempfile::tempdir().unwrap();
    let run = |path: &Path| calibrate("pivot", path, &[]);
    let path = dir.path().join("pivot.mcap");
    let still = |_| pivoting(0.0);
    record(&path, 60, still, |_| false);
    refused(&run(&path), &["pivot.mcap: ", "turned by 0.0° only"]);
    let spun = |t: f64| Pose { orientation: DQuat::from_rotation_z(t), ..Pose::IDENTITY };
    record(&path, 60, spun, |_| false);
    refused(&run(&path), &["about nearly one axis"]);
    record(&path, 5, pivoting, |_| false);
    refused(&run(&path), &["5 poses are too few"]);
    let walking = |t: f64| Pose { position_mm: pivoting(t).position_mm + DVec3::X * 30.0 * t, ..pivoting(t) };
    record(&path, 600, walking, |_| false);
    refused(&run(&path), &["more than --max-rms 5", "did it slip"]);
    std::fs::write(&path, "0,0,0,1,0,0,0\n0,0,0,2,0,0,0\n").unwrap();
    refused(&run(&path), &["line 2: the pose's quaternion"]);
    refused(&run(Path::new("/no/such.mcap")), &["cannot read the poses /no/such.mcap"]);
}

#[test]
fn wrong_calibrations_of_a_station_are_named() {
    let error = |rest: &str| {
        let text = format!("[scene]\nphantom = 'obstetric'\n{rest}");
        let station = Station::parse(&text, Path::new("/stations"));
        station.and_then(|s| s.pose_settings()).unwrap_err().to_string()
    };
    for (rest, part) in [
        ("[calibration]\npath = 'c.toml'", "cannot read the calibration file /stations/c.toml"),
        ("[calibration]\nfile = 'c.toml'", "unknown key `file` in `[calibration]`"),
        (
            "[calibration]\nsensor_from_probe_quaternion = [1, 1, 0, 0]",
            "[calibration] sensor_from_probe: the pose's quaternion",
        ),
        ("[calibration]\nsensor_from_probe_mm = [1, 2]", "it must be [3 numbers within"),
        ("[filter]\nheld = 3", "unknown key `held` in `[filter]` (did you mean `held_ms`?)"),
        ("[filter]\nheld_ms = 3000", "`filter.held_ms` is 3000; it must be a number in 1..=500"),
        ("[filters]\n", "unknown table `[filters]` (did you mean `filter`?)"),
    ] {
        assert!(error(rest).contains(part), "{}", error(rest));
    }
}
