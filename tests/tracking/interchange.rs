//! Tests of recordings and other programs' sequences: import, export, and the commands that use them.
// clippy.toml allows these in test functions only, not in their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use flate2::read::ZlibDecoder;
use glam::{DMat4, DQuat, DVec3, Vec3};
use insonify::anatomy::analytic::cuboid;
use insonify::anatomy::export::{LabelledSurface, write_glb};
use insonify::pose::Pose;
use insonify::recording::interchange::meta_image::{self, Head};
use insonify::recording::interchange::{InterchangeError, TrackedRow, csv, tracked, transforms_of};
use insonify::recording::{Event, RecordingInfo, RecordingWriter, poses};
use insonify::sink::meta_image::{ImageTracking, MetaImageWriter};
use insonify::tracker::{Protocol, ascii_line};
use insonify::transducer::{Probe, Sector};
use proptest::prelude::*;
use serde_json::Value;
use sha2::{Digest, Sha256};

const PROBE: &str = "ProbeToTrackerTransform";

/// A sequence header as PLUS 2.9 writes it; the first matrix is from a real sweep.
const PLUS: &str = "\
ObjectType = Image
NDims = 3
AnatomicalOrientation = RAI
BinaryData = True
BinaryDataByteOrderMSB = False
CenterOfRotation = 0 0 0
CompressedData = False
DimSize = 4 2 3
ElementNumberOfChannels = 1
ElementSpacing = 1 1 1
ElementType = MET_UCHAR
Kinds = domain domain list
Offset = 0 0 0
TransformMatrix = 1 0 0 0 1 0 0 0 1
UltrasoundImageOrientation = MFA
UltrasoundImageType = BRIGHTNESS
Seq_Frame0000_FrameNumber = 1203
Seq_Frame0000_ImageStatus = OK
Seq_Frame0000_ProbeToTrackerTransform = -0.224009 -0.529064 0.818481 212.75 0.52031 0.6452 0.559459 -14.0417 -0.824074 0.551188 0.130746 -26.1193 0 0 0 1 
Seq_Frame0000_ProbeToTrackerTransformStatus = OK
Seq_Frame0000_Timestamp = 12.5
Seq_Frame0000_UnfilteredTimestamp = 12.498
Seq_Frame0001_ProbeToTrackerTransform = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 
Seq_Frame0001_ProbeToTrackerTransformStatus = INVALID
Seq_Frame0001_Timestamp = 12.55
Seq_Frame0002_ProbeToTrackerTransform = 0 -1 0 10 1 0 0 20 0 0 1 -30.25 0 0 0 1 
Seq_Frame0002_ProbeToTrackerTransformStatus = OK
Seq_Frame0002_Timestamp = 12.6
ElementDataFile = LOCAL
";

fn pixels() -> Vec<u8> {
    (0..24).collect()
}

fn sequence(bytes: &[u8]) -> Result<Head, InterchangeError> {
    meta_image::read(bytes, Path::new("memory.mha"))
}

fn rows(head: &str) -> Result<Vec<TrackedRow>, InterchangeError> {
    tracked(&sequence(head.as_bytes())?, PROBE, Path::new("memory.mha"))
}

#[test]
fn a_sequence_of_plus_is_parsed() {
    let rows = rows(PLUS).unwrap();
    assert_eq!(rows.iter().map(|row| row.time_s).collect::<Vec<_>>(), [12.5, 12.55, 12.6]);
    let first = rows[0].pose.unwrap();
    assert_eq!(first.position_mm, DVec3::new(212.75, -14.0417, -26.1193));
    // Columns of the matrix are the probe's axes in the tracker's frame; PLUS prints six digits.
    assert!((first.orientation * DVec3::X).distance(DVec3::new(-0.224009, 0.52031, -0.824074)) < 2e-6);
    assert!((first.orientation * DVec3::Z).distance(DVec3::new(0.818481, 0.559459, 0.130746)) < 2e-6);
    assert_eq!(rows[1].pose, None);
    let last = rows[2].pose.unwrap();
    assert!(last.orientation.angle_between(DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2)) < 1e-7);
    assert_eq!((rows[2].position.line, last.position_mm), (28, DVec3::new(10.0, 20.0, -30.25)));

    let head = sequence(&[PLUS.as_bytes(), &pixels()].concat()).unwrap();
    assert_eq!((head.width, head.height, head.images.len()), (4, 2, 3));
    let windows = PLUS.replace('\n', "\r\n");
    assert_eq!(sequence(&[windows.as_bytes(), &pixels()].concat()).unwrap().images.len(), 3);
    let four = PLUS.replace("NDims = 3", "NDims = 4").replace("4 2 3", "2 2 2 3");
    assert_eq!(sequence(four.as_bytes()).unwrap().images.len(), 3);
}

#[test]
fn every_mistake_of_a_sequence_is_named() {
    let swap = |from: &str, to: &str| PLUS.replacen(from, to, 1);
    let scaled = swap("0 -1 0 10 1 0 0 20 0 0 1", "0 -2 0 10 2 0 0 20 0 0 2");
    let cases = [
        (String::new(), "it ends within its head, before `ElementDataFile`"),
        ("P5 640 480\n".into(), "line 1 (byte 0): `P5 640 480` is no line of a MetaImage head"),
        (swap("NDims = 3\n", ""), "its head has no `NDims`"),
        (swap("NDims = 3", "NDims = 2"), "line 2 (byte 19): `NDims` is `2`; it must be 3 or 4"),
        (swap("4 2 3", "4 2"), "`DimSize` is `4 2`; it must be 3 whole numbers from 1"),
        (swap("4 2 3", "4 0 3"), "`DimSize` is `4 0 3`"),
        (swap("4 2 3", "4000000000 4000000000 3"), "of images of at most 268435456 bytes"),
        (swap("4 2 3", "4 2 2000000"), "of at most 1000000 images"),
        (swap("4 2 3", "4 2 5"), "DimSize says 5 images, but there are `Seq_Frame` fields of 3, the last of number 2"),
        (swap("MET_UCHAR", "MET_BITS"), "`ElementType` is `MET_BITS`"),
        (swap("CompressedData = False", "CompressedData = No"), "`CompressedData` is `No`; it must be True or False"),
        (swap("Channels = 1", "Channels = -1"), "`ElementNumberOfChannels` is `-1`"),
        (swap("BinaryData = True", "BinaryData = False"), "pixels as text are not read"),
        (swap("Offset = 0 0 0", "NDims = 3"), "line 13 (byte 272): `NDims` is there twice, first in line 2"),
        (swap("Seq_Frame0001_Time", "Seq_FrameABCD_Time"), "is no `Seq_FrameNNNN_KEY`"),
        (swap("Seq_Frame0001_Time", "Seq_Frame4000000000_Time"), "is no `Seq_FrameNNNN_KEY` below 1000000"),
        (swap("Timestamp = 12.5\n", "Timestamp = noon\n"), "line 21 (byte 657): `Timestamp` is `noon`"),
        (swap("Seq_Frame0001_Timestamp = 12.55\n", ""), "image 1 has no `Timestamp`"),
        (swap("10 1 0 0 20", "10 1 0 0"), "is not sixteen numbers"),
        (swap("-30.25 0 0 0 1", "-30.25 0 0 0 2"), "its last row is [0.0, 0.0, 0.0, 2.0]"),
        (swap("-30.25", "inf"), "is not sixteen numbers"),
        (swap("-30.25", "1e300"), "pose component `z`"),
        (scaled, "`ProbeToTrackerTransform`: the matrix is no rotation: its columns must have length 1"),
        (swap("0 0 1 -30.25", "0 0 -1 -30.25"), "it mirrors"),
        (PLUS.replace(PROBE, "ProbeToReferenceTransform"), "the sequence's transforms: ProbeToReferenceTransform"),
        (format!("Comment = {}\n{PLUS}", "x".repeat(70_000)), "line 1 (byte 0): it is longer than 65536 bytes"),
    ];
    for (head, message) in cases {
        let error = rows(&head).unwrap_err().to_string();
        assert!(error.starts_with("memory.mha") && error.contains(message), "`{message}` is not in {error}");
    }
    let not_text = [b"Comment = \xff\n", PLUS.as_bytes()].concat();
    assert!(sequence(&not_text).err().unwrap().to_string().contains("byte 10 of the line is no UTF-8 text"));
    assert_eq!(transforms_of(&sequence(PLUS.as_bytes()).unwrap()).into_iter().collect::<Vec<_>>(), [PROBE]);
}

#[test]
fn poses_are_read_wherever_the_pixels_are() {
    let packed = PLUS.replace("CompressedData = False", "CompressedData = True");
    let sized = PLUS.replace("CompressedData = False", "CompressedData = True\nCompressedDataSize = 20        ");
    for head in [packed, sized, PLUS.replace("= LOCAL", "= sweep.raw"), PLUS.replace("4 2 3", "16384 16384 3")] {
        assert_eq!(rows(&head).unwrap().len(), 3);
    }
}

const TABLE: &str = "\
\u{feff}# from a mocap system
time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz,status,event
0.00, 1.5,-2,80.25, 1,0,0,0, ok,start

0.02, 1.6,-2,80.25, 0.5,0.5,0.5,0.5,,
0.04, , , , , , , , invalid,lost
";

fn table(text: &str) -> Result<Vec<TrackedRow>, InterchangeError> {
    csv::read(text.as_bytes(), Path::new("poses.csv"))
}

#[test]
fn a_table_is_parsed() {
    let rows = table(TABLE).unwrap();
    assert_eq!(rows.len(), 3);
    assert_eq!(rows[0].pose, Some(Pose::from_components([1.5, -2.0, 80.25, 1.0, 0.0, 0.0, 0.0]).unwrap()));
    assert_eq!((rows[0].event.as_deref(), rows[1].event.as_deref()), (Some("start"), None));
    assert_eq!((rows[2].pose, rows[2].time_s, rows[2].position.line), (None, 0.04, 6));
    let turned = "qz,qy,qx,qw,z_mm,y_mm,x_mm,time_s\r\n0,0,0,1,80.25,-2,1.5,7\r\n";
    assert_eq!(table(turned).unwrap()[0].pose, rows[0].pose);
    // Units, separators and words of other programs.
    let metres = "Time [ms];pos_z (m);y_cm;x_in;q0;qx;qy;qz\n7000;0.08025;-0.2;0.05905511811023622;1;0;0;0\n";
    let found = table(metres).unwrap()[0].clone();
    assert!(found.pose.unwrap().position_mm.distance(rows[0].pose.unwrap().position_mm) < 1e-9 && found.time_s == 7.0);
    assert_eq!(table(&TABLE.replace(',', "\t")).unwrap()[0].pose, rows[0].pose);
}

#[test]
fn rows_of_a_lost_tracker_have_no_pose() {
    let text = "time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n0,1.5,2.5,3.5,1,0,0,0\n0.1,nan,nan,NaN,nan,nan,nan,nan\n0.2,,,,,,,\n\
                0.3,0,0,0,0,0,0,0\n0.4,1.6,2.5,3.5,1,0,0,0\n";
    let poses: Vec<bool> = table(text).unwrap().iter().map(|row| row.pose.is_some()).collect();
    assert_eq!(poses, [true, false, false, false, true]);
}

#[test]
fn every_mistake_of_a_table_is_named() {
    let swap = |from: &str, to: &str| TABLE.replacen(from, to, 1);
    let cases = [
        ("", "poses.csv: it has no head line; the columns are time_s, x_mm"),
        (
            &TABLE.replace("_mm", ""),
            "line 2 (byte 25): column `x` is not read: it has no unit; name it x_mm, x_cm, x_m",
        ),
        (&swap("x_mm", "x"), "line 2 (byte 25): column `x` is not read: it has no unit, but `y_mm` has one"),
        (&swap("time_s", "time"), "column `time` is not read: it has no unit; name it time_s or time_ms"),
        (&swap("x_mm", "u"), "line 2 (byte 25): unknown column `u`"),
        (&swap("qw,qx,qy,qz", "q0,q1,q2,q3"), "column `q1` is not read: whether the scalar part"),
        (
            &TABLE.replace(',', ";").replacen("1.5", "1,5", 1),
            "`x_mm` is `1,5`; it must be a decimal number with a decimal point instead of the decimal comma: 1.5",
        ),
        (&swap("x_mm", "xmm"), "(did you mean `x_mm`?)"),
        (&swap("y_mm", "x_mm"), "column `x_mm` is there twice"),
        (&swap("time_s,", ""), "column `time_s` is missing"),
        (&swap("1.6,-2", "1.6"), "line 5 (byte 111): 9 fields; the head has 10"),
        (&swap("1.6", "1,6"), "11 fields; the head has 10: are its numbers written with decimal commas?"),
        (&swap("1.6", "left"), "`x_mm` is `left`; it must be a decimal number"),
        (
            &swap("1.6", "NaN"),
            "`x_mm` is `NaN`, but other numbers of the pose are there; in a row without a pose all seven",
        ),
        (&swap("0.02", ""), "`time_s` is ``; it must be a decimal number"),
        (&swap("0.5,", "0.6,"), "it must be 1 within"),
        (&swap("ok,", "fine,"), "`status` is `fine`; it must be ok, invalid or empty"),
    ];
    for (text, message) in cases {
        let error = table(text).unwrap_err().to_string();
        assert!(error.contains(message), "`{message}` is not in {error}");
    }
}

fn insonify(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_insonify"));
    command.args(arguments).env_remove("RUST_LOG").current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap()
}

/// JSON that a successful command printed.
#[track_caller]
fn json(arguments: &[&str]) -> Value {
    let output = insonify(&[arguments, &["--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Error message of a command that refused its input.
#[track_caller]
fn refused(arguments: &[&str]) -> String {
    let output = insonify(arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    message
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn imports_become_recordings() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: &[u8]| {
        let path = dir.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    };
    let out = dir.path().join("deep/out.mcap");
    let sequence = file("sweep.igs.mha", &[PLUS.as_bytes(), &pixels()].concat());
    let report = json(&["import", text(&sequence), "--out", text(&out)]);
    assert_eq!((&report["poses"], &report["without_pose"], &report["events"]), (&2.into(), &1.into(), &0.into()));
    let (found, summary) = poses(&out).unwrap();
    assert_eq!(summary.info.device, "imported from sweep.igs.mha");
    assert_eq!(found.iter().map(|pose| pose.host_time_ns).collect::<Vec<_>>(), [0, 100_000_000]);
    for (found, row) in found.iter().zip(rows(PLUS).unwrap().iter().filter_map(|row| row.pose)) {
        assert!(found.pose.position_mm.distance(row.position_mm) < 1e-4);
        assert!(found.pose.orientation.angle_between(row.orientation) < 1e-6);
    }
    let again = fs::read(&out).unwrap();
    assert!(refused(&["import", text(&sequence), "--out", text(&out)]).contains("--force replaces it"));
    json(&["import", text(&sequence), "--out", text(&out), "--force"]);
    assert_eq!(fs::read(&out).unwrap(), again, "the same file gives the same recording");

    // A first time since 1970 is kept.
    let unix = TABLE.replace("\n0.0", "\n1790000000.0");
    let report = json(&["import", text(&file("poses.csv", unix.as_bytes())), "--out", text(&out), "--force"]);
    assert_eq!((&report["poses"], &report["events"]), (&2.into(), &2.into()));
    let (found, summary) = poses(&out).unwrap();
    assert_eq!(found[0].host_time_ns, 1_790_000_000_000_000_000);
    assert_eq!(summary.events.iter().map(|e| e.name.as_str()).collect::<Vec<_>>(), ["start", "lost"]);

    let back = file("back.csv", TABLE.replace("0.04", "0.01").as_bytes());
    let message = refused(&["import", text(&back), "--out", text(&out), "--force"]);
    assert!(message.contains("line 6 (byte") && message.contains("times must not fall"), "{message}");
    let none = file("none.csv", b"time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n");
    assert!(refused(&["import", text(&none), "--out", text(&out), "--force"]).contains("it has no rows"));
    assert!(refused(&["import", "poses.xlsx", "--out", "x.mcap"]).contains("is neither .mha, .mhd nor .csv"));
    assert!(refused(&["import", "a.igs.nrrd", "--out", "x.mcap"]).contains("save it as .igs.mha"));
    let people = insonify(&["import", text(&sequence), "--out", text(&dir.path().join("people.mcap"))]);
    let people = String::from_utf8_lossy(&people.stdout).into_owned();
    assert!(people.contains("not in the recording: events, names of planes, measurements and texts"), "{people}");
    assert_eq!(poses(&out).unwrap().0.len(), 2, "a refused import leaves what was there");
}

fn small_sector() -> Sector {
    Sector::fit(&Probe::default(), 32, 24)
}

fn tracking(i: u32) -> ImageTracking {
    let angle = f64::from(i) * 0.3;
    let pose = Pose {
        position_mm: DVec3::new(1.0 / 3.0, f64::from(i), -80.0),
        orientation: DQuat::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), angle),
    };
    let needle = (i != 3).then(|| Pose { position_mm: DVec3::new(1.0, 2.0, f64::from(i)), ..pose });
    ImageTracking { time_s: f64::from(i) * 0.05, pose, tracked: i != 2, needle, needle_tracked: i != 1 }
}

/// Pixels of all images in a sequence file, one image after the other.
fn written_pixels(path: &Path, compressed: bool) -> Vec<u8> {
    let (file, last) = (fs::read(path).unwrap(), b"ElementDataFile = LOCAL\n");
    let behind = file.windows(last.len()).position(|line| line == last).unwrap() + last.len();
    let mut pixels = Vec::new();
    match compressed {
        true => ZlibDecoder::new(&file[behind..]).read_to_end(&mut pixels).unwrap(),
        false => (&file[behind..]).read_to_end(&mut pixels).unwrap(),
    };
    pixels
}

#[test]
fn written_sequences_are_read_back() {
    let dir = tempfile::tempdir().unwrap();
    let sector = small_sector();
    let tracking: Vec<_> = (0..5).map(tracking).collect();
    let image = |i: usize| (0..32 * 24).map(|p| (p * (i + 3) % 251) as u8).collect::<Vec<_>>();
    for compress in [false, true] {
        let path = dir.path().join("out.igs.mha");
        let mut writer = MetaImageWriter::create(&path, &sector, &tracking, compress).unwrap();
        for i in 0..5 {
            writer.push(&image(i)).unwrap();
        }
        assert!(writer.push(&[0; 7]).is_err(), "an image of another size");
        writer.finish().unwrap();
        let head = meta_image::open(&path).unwrap();
        assert_eq!((head.width, head.height, head.images.len()), (32, 24, 5));
        let rows = tracked(&head, PROBE, &path).unwrap();
        assert_eq!(rows.len(), tracking.len());
        for (row, sent) in rows.iter().zip(&tracking) {
            assert_eq!(row.time_s, sent.time_s);
            assert_eq!(row.pose.is_some(), sent.tracked);
            let Some(pose) = row.pose else { continue };
            assert_eq!(pose.position_mm, sent.pose.position_mm);
            assert!(pose.orientation.angle_between(sent.pose.orientation) < 1e-7);
        }
        let needles = tracked(&head, "NeedleTipToTrackerTransform", &path).unwrap();
        for (row, sent) in needles.iter().zip(&tracking) {
            let expected = sent.needle.filter(|_| sent.needle_tracked);
            assert_eq!(row.pose.map(|pose| pose.position_mm), expected.map(|needle| needle.position_mm));
        }
        // The transform from pixels to the probe frame is the sector's.
        let numbers: Vec<f64> =
            head.images[0]["ImageToProbeTransform"].value.split(' ').map(|n| n.parse().unwrap()).collect();
        let matrix = DMat4::from_cols_slice(&numbers).transpose();
        let probe = matrix.transform_point3(DVec3::new(17.0, 5.0, 0.0));
        let expected = sector.pixel_centre_mm(17, 5);
        assert!(probe.distance(DVec3::new(expected.x, 0.0, expected.y)) < 1e-9, "{probe}");
        assert!(matrix.determinant() > 0.0);

        assert_eq!(written_pixels(&path, compress), (0..5).flat_map(image).collect::<Vec<_>>());
    }
    let path = dir.path().join("short.igs.mha");
    let writer = MetaImageWriter::create(&path, &sector, &tracking, false).unwrap();
    let error = writer.finish().unwrap_err().to_string();
    assert!(error.contains("0 images came; its head says 5") && !path.exists(), "{error}");
}

/// A station over a box of liver, and a recording of one second over it.
fn station() -> (tempfile::TempDir, PathBuf, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let mesh = cuboid(Vec3::new(-60.0, -60.0, 10.0), Vec3::new(60.0, 60.0, 90.0));
    let surface = LabelledSurface { name: "block".into(), tissue: "liver".into(), priority: 1, mesh };
    write_glb(&[surface], &dir.path().join("scene.glb")).unwrap();
    let station = dir.path().join("station.toml");
    let small = "[probe]\nscanlines = 32\nsamples = 256\n[image]\nwidth = 160\nheight = 120\n";
    fs::write(&station, format!("[scene]\npath = \"scene.glb\"\n{small}")).unwrap();
    let recording = dir.path().join("exam.mcap");
    let start_time_ns = 1_790_000_000_000_000_000;
    let info = RecordingInfo {
        protocol: Protocol::AsciiLine,
        device: "test".into(),
        scene: "box".into(),
        start_time_ns,
        sensor: None,
        needle: None,
    };
    let mut writer = RecordingWriter::create(&recording, &info).unwrap();
    for i in 0..61_u32 {
        let time_ns = start_time_ns + u64::from(i) * 1_000_000_000 / 60;
        // Out of view for 300 ms.
        if (20..38).contains(&i) {
            continue;
        }
        let pose = Pose { position_mm: DVec3::X * f64::from(i) * 0.3, orientation: DQuat::IDENTITY };
        writer.raw(time_ns, ascii_line::encode(i, u64::from(i) * 16_667, &pose).as_bytes()).unwrap();
    }
    writer.event(&Event::new(start_time_ns + 1_000_000_000, "gain_db").with(6.0)).unwrap();
    writer.finish().unwrap();
    (dir, station, recording)
}

#[test]
fn the_same_recording_seed_and_settings_give_the_same_frames_at_any_speed() {
    let (dir, station, recording) = station();
    let replay = |name: &str, more: &[&str]| {
        let out = dir.path().join(name);
        let report =
            json(&[&["replay", text(&recording), text(&station), "--fps", "10", "--out", text(&out)], more].concat());
        assert_eq!(report["rendered"], 11);
        (report["frames_sha256"].as_str().unwrap().to_owned(), report["behind_s"].is_number())
    };
    let (first, paced) = replay("a", &["--seed", "3"]);
    assert!(first.len() == 64 && !paced);
    assert_eq!(replay("b", &["--seed", "3", "--speed", "max"]).0, first);
    assert_eq!(replay("c", &["--seed", "3", "--speed", "20"]), (first.clone(), true));
    assert_ne!(replay("d", &["--seed", "4"]).0, first);
    assert!(refused(&["replay", text(&recording), text(&station), "--speed", "0"]).contains("0.01..=1000"));
}

#[test]
fn a_replay_repeats_the_recorded_session_and_each_part_can_be_left_out() {
    let (dir, station, recording) = station();
    let text_of = fs::read_to_string(&station).unwrap();
    // The tracker's frame is 5 mm beside the scene's.
    let calibration = dir.path().join("calibrated.toml");
    fs::write(&calibration, format!("{text_of}[calibration]\nsensor_from_probe_mm = [0, 0, 5]\n")).unwrap();
    let start_ns = 1_790_000_000_000_000_000;
    let info = poses(&recording).unwrap().1.info;
    let set = dir.path().join("set.mcap");
    let mut writer = RecordingWriter::create(&set, &info).unwrap();
    for i in 0..61_u32 {
        let time_ns = start_ns + u64::from(i) * 1_000_000_000 / 60;
        let pose = Pose { position_mm: DVec3::X * f64::from(i) * 0.3, orientation: DQuat::IDENTITY };
        writer.raw(time_ns, ascii_line::encode(i, u64::from(i) * 16_667, &pose).as_bytes()).unwrap();
        let value = match i {
            15 => serde_json::json!({"gain_db": 6.0, "frozen": true}),
            30 => serde_json::json!({"depth_mm": 60.0, "rays": 2, "tgc_sliders_db": [1, 2, 3, 4, 5, 6, 7, 8]}),
            45 => serde_json::json!({"frozen": false, "focus_mm": 30.0, "dynamic_range_db": 40.0}),
            50 => serde_json::json!({"gain_db": 1e9}),
            _ => continue,
        };
        writer.event(&Event::new(time_ns, "settings").with(value)).unwrap();
    }
    writer.finish().unwrap();
    let replay = |recording: &Path, station: &Path, name: &str, more: &[&str]| {
        let out = dir.path().join(name);
        let report =
            json(&[&["replay", text(recording), text(station), "--fps", "10", "--out", text(&out)], more].concat());
        let file: Value = serde_json::from_slice(&fs::read(out.join("replay.json")).unwrap()).unwrap();
        let at = |i: usize, axis: usize| file["frames"][i]["pose"]["position_mm"][axis].as_f64().unwrap();
        let (xs, zs): (Vec<f64>, Vec<f64>) = (0..11).map(|i| (at(i, 0), at(i, 2))).unzip();
        (report["frames_sha256"].as_str().unwrap().to_owned(), report["changes"].as_u64().unwrap(), xs, zs)
    };
    let (whole, changes, xs, _) = replay(&set, &station, "set", &[]);
    assert_eq!(changes, 3);
    let file: Value = serde_json::from_slice(&fs::read(dir.path().join("set/replay.json")).unwrap()).unwrap();
    let parts: Vec<_> = file["parts"].as_array().unwrap().iter().collect();
    assert_eq!(parts.iter().map(|part| part["frames"].as_u64().unwrap()).sum::<u64>(), 11);
    assert_eq!(parts.iter().map(|part| part["first"].as_u64().unwrap()).collect::<Vec<_>>(), [0, 3, 5, 8]);
    assert_eq!((&parts[1]["gain_db"], &parts[2]["probe"]["depth_mm"]), (&6.0.into(), &60.0.into()));
    assert_eq!((&parts[2]["quality"]["rays"], &parts[3]["probe"]["focus_mm"]), (&2.into(), &30.0.into()));
    // Frozen from 250 to 750 ms at the pose of 200 ms; after that it follows the probe.
    assert!(xs[3..8].iter().all(|x| *x == xs[2]) && xs[8] > xs[2] + 5.0, "{xs:?}");
    for (name, speed) in [("again", "max"), ("paced", "30")] {
        assert_eq!(replay(&set, &station, name, &["--speed", speed]).0, whole, "{name}");
    }
    let (ignored, changes, xs, _) = replay(&set, &station, "ignored", &["--ignore-controls"]);
    assert!(ignored != whole && changes == 0 && xs.windows(2).all(|x| x[1] > x[0]), "{xs:?}");
    let (raw, _, raw_xs, zs) = replay(&set, &calibration, "raw", &["--raw-poses", "--ignore-controls"]);
    assert!(raw != ignored && (raw_xs[5] - 9.0).abs() < 1e-3 && zs[5] == 0.0, "{raw_xs:?}");
    // The filter lags slightly, and the calibration is the station's.
    assert!(xs[5] != raw_xs[5] && (xs[5] - raw_xs[5]).abs() < 2.0, "{xs:?}");
    let (_, _, _, zs) = replay(&set, &calibration, "calibrated", &[]);
    assert!((zs[5] - 5.0).abs() < 1e-3, "{zs:?}");
    let sequence = dir.path().join("set.igs.mha");
    let export = ["export", text(&set), text(&station), "--fps", "10", "--out", text(&sequence)];
    assert!(refused(&export).contains("changes the depth at frame 5"));
    json(&[&export[..], &["--frames", "..5"]].concat());
}

#[test]
fn imported_poses_are_not_calibrated_a_second_time() {
    let (dir, station, _) = station();
    let text_of = fs::read_to_string(&station).unwrap();
    fs::write(&station, format!("{text_of}[calibration]\nsensor_from_probe_mm = [0, 0, 5]\n")).unwrap();
    let [table, recording, out] = ["poses.csv", "imported.mcap", "out"].map(|name| dir.path().join(name));
    let rows: String = (0..40).map(|i| format!("{:.2},7,0,1,1,0,0,0\n", 0.02 * f64::from(i))).collect();
    fs::write(&table, format!("time_s,x_mm,y_mm,z_mm,qw,qx,qy,qz\n{rows}")).unwrap();
    json(&["import", text(&table), "--out", text(&recording)]);
    let replay = ["replay", text(&recording), text(&station), "--fps", "10", "--frames", "..2", "--out", text(&out)];
    let output = insonify(&replay);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert_eq!(said.matches("the station's calibration is not applied to them").count(), 1, "{said}");
    let file: Value = serde_json::from_slice(&fs::read(out.join("replay.json")).unwrap()).unwrap();
    let position = &file["frames"][0]["pose"]["position_mm"];
    let off_mm = |axis: usize, mm: f64| (position[axis].as_f64().unwrap() - mm).abs();
    assert!(off_mm(0, 7.0) < 1e-3 && off_mm(2, 1.0) < 1e-3, "{position}");
}

#[test]
fn an_exported_sequence_contains_the_replays_frames() {
    let (dir, station, recording) = station();
    let out = dir.path().join("replay");
    json(&["replay", text(&recording), text(&station), "--fps", "10", "--maps", "--out", text(&out)]);
    let frames = |map: &str| {
        let frame = |i| image::open(out.join(map).join(format!("{i:05}.png"))).unwrap().into_bytes();
        (0..11).map(frame).collect::<Vec<_>>()
    };
    let file = dir.path().join("deep/sweep.igs.mha");
    for (more, map) in [(&[][..], "bmode"), (&["--compress"], "bmode"), (&["--map", "segmentation"], "segmentation")] {
        let arguments = ["export", text(&recording), text(&station), "--fps", "10", "--force", "--out", text(&file)];
        let report = json(&[&arguments, more].concat());
        assert_eq!((&report["images"], &report["invalid"], &report["width"]), (&11.into(), &3.into(), &160.into()));
        assert_eq!(written_pixels(&file, more == ["--compress"]), frames(map).concat(), "{more:?}");
    }
    let other = dir.path().join("sweep.nrrd");
    let message = refused(&["export", text(&recording), text(&station), "--out", text(&other)]);
    assert!(message.contains("must end in .igs.mha or .mha") && !other.exists(), "{message}");
    let short = ["export", text(&recording), text(&station), "--force", "--frames", "..1", "--out"];
    let people = insonify(&[&short[..], &[text(&dir.path().join("short.mha"))]].concat());
    let people = String::from_utf8_lossy(&people.stdout).into_owned();
    assert!(people.contains("left out: events, names of planes"), "{people}");
    // Imported as a recording again: the gap remains one.
    let back = dir.path().join("back.mcap");
    let report = json(&["import", text(&file), "--out", text(&back)]);
    assert_eq!((&report["poses"], &report["without_pose"]), (&8.into(), &3.into()));
    let (found, _) = poses(&back).unwrap();
    // The filter lags slightly behind the probe at 18 mm.
    assert!((found[7].pose.position_mm.x - 18.0).abs() < 0.5, "{:?}", found[7]);
}

#[test]
#[ignore = "needs Python's SimpleITK; `make test` runs it where that is installed"]
fn simple_itk_reads_our_sequences() {
    let python = PathBuf::from(std::env::var_os("INSONIFY_PYTHON").unwrap_or("python3".into()));
    let dir = tempfile::tempdir().unwrap();
    let tracking: Vec<_> = (0..3).map(tracking).collect();
    let pixels: Vec<u8> = (0..3 * 32 * 24).map(|p| (p * 7 % 253) as u8).collect();
    for compress in [false, true] {
        let path = dir.path().join(format!("{compress}.igs.mha"));
        let mut writer = MetaImageWriter::create(&path, &small_sector(), &tracking, compress).unwrap();
        pixels.chunks(32 * 24).for_each(|image| writer.push(image).unwrap());
        writer.finish().unwrap();
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/read_sequence.py");
        let output = Command::new(&python).arg(script).arg(&path).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let seen: Value = serde_json::from_slice(&output.stdout).unwrap();
        let sha256: String = Sha256::digest(&pixels).iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!((&seen["size"], &seen["sha256"]), (&serde_json::json!([32, 24, 3]), &sha256.into()));
        assert_eq!(seen["type"], "8-bit unsigned integer");
        let field = |key: &str| seen["fields"][key].as_str().unwrap_or_default().trim().to_owned();
        assert_eq!(field("Seq_Frame0002_ProbeToTrackerTransformStatus"), "INVALID");
        assert_eq!(field("Seq_Frame0001_Timestamp"), "0.05");
        assert_eq!(
            field("Seq_Frame0000_ProbeToTrackerTransform"),
            "1 0 0 0.3333333333333333 0 1 0 0 0 0 1 -80 0 0 0 1"
        );
        assert_eq!(field("UltrasoundImageOrientation"), "MFA");
    }
}

#[test]
fn a_recording_is_inspected() {
    let (dir, _, recording) = station();
    let report = json(&["inspect", text(&recording)]);
    assert_eq!(
        (&report["protocol"], &report["poses"], &report["clean"]),
        (&"ascii-line".into(), &43.into(), &false.into())
    );
    assert_eq!((&report["missing_records"], &report["timing"]["gap_count"]), (&18.into(), &1.into()));
    let near = |value: &Value, expected: f64, within: f64| {
        assert!((value.as_f64().unwrap() - expected).abs() < within, "{value} is not {expected}");
    };
    near(&report["duration_s"], 1.0, 1e-6);
    near(&report["timing"]["rate_hz"], 60.0, 1e-3);
    near(&report["timing"]["gaps"][0]["length_s"], 19.0 / 60.0, 1e-6);
    assert_eq!(report["events"][0]["value"], 6.0);
    let people = insonify(&["inspect", text(&recording)]);
    let people = String::from_utf8_lossy(&people.stdout).into_owned();
    for part in [
        "43 records",
        "poses      43\n",
        "rate       60.00 poses a second",
        "gaps       1 of more",
        "1.000 s  gain_db = 6.0",
    ] {
        assert!(people.contains(part), "`{part}` is missing: {people}");
    }
    // The file left by a kill can be inspected, too, even before any pose.
    let whole = fs::read(&recording).unwrap();
    let cut = dir.path().join("cut.mcap.part");
    fs::write(&cut, &whole[..600]).unwrap();
    let report = json(&["inspect", text(&cut)]);
    assert!(report["poses"] == 0 && report["truncated"].as_str().unwrap().contains("byte 600"), "{report}");
    assert!(refused(&["inspect", text(&dir.path().join("cut.mcap"))]).contains("was not finished"));
    let message = refused(&["inspect", text(&recording), "--station"]);
    assert!(message.contains("holds no station file; only recordings by `insonify run`"), "{message}");
}

#[test]
fn record_takes_a_tracker_from_tcp_and_keeps_the_station() {
    let (dir, station, _) = station();
    let out = dir.path().join("live.mcap");
    let server = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = server.local_addr().unwrap().to_string();
    let lines: String = (0..50).map(|i| ascii_line::encode(i, u64::from(i) * 10_000, &tracking(i).pose)).collect();
    let sent = lines.clone();
    // The tracker disconnects after its last record; the recorder waits for its return.
    let sender = std::thread::spawn(move || server.accept().unwrap().0.write_all(sent.as_bytes()).unwrap());
    let from = ["record", text(&station), "--address", &address, "--protocol", "ascii-line", "--out", text(&out)];
    let report = json(&[&from[..], &["--duration", "1"]].concat());
    sender.join().unwrap();
    assert_eq!((&report["bytes"], &report["records"]), (&lines.len().into(), &50.into()));
    let (found, summary) = poses(&out).unwrap();
    assert_eq!((found.len(), summary.is_clean()), (50, true), "{summary}");
    let settings = summary.settings.unwrap();
    assert_eq!(settings.station, fs::read_to_string(&station).unwrap());
    let events: Vec<_> = summary.events.iter().map(|event| event.name.as_str()).collect();
    assert!(events.starts_with(&["tracker", "tracker-disconnected"]) && events.ends_with(&["end"]), "{events:?}");
    assert_eq!(summary.events.last().unwrap().value, Some("the duration was over".into()));
    let printed = insonify(&["inspect", text(&out), "--station"]);
    assert_eq!(String::from_utf8_lossy(&printed.stdout), settings.station);
    let message = refused(&from);
    assert!(message.contains("is there already; --force replaces it"), "{message}");
    let message = refused(&["record", text(&station), "--out", text(&dir.path().join("other.mcap"))]);
    assert!(message.contains("--port or --address, or --stdin"), "{message}");
}

#[cfg(unix)]
#[test]
fn record_takes_the_stations_tracker_until_ctrl_c() {
    use std::io::{BufRead, BufReader, Read};

    let (dir, station, _) = station();
    let text_of = fs::read_to_string(&station).unwrap();
    let tracker = "[tracker]\ntransport = \"mock\"\nschedule = \"move 60\"\nrate_hz = 200\n";
    fs::write(&station, format!("{text_of}{tracker}")).unwrap();
    let out = dir.path().join("mock.mcap");
    let mut child = Command::new(env!("CARGO_BIN_EXE_insonify"))
        .args(["record", text(&station), "--out", text(&out), "--json"])
        .env_remove("RUST_LOG")
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stderr.take().unwrap()).lines();
    assert!(said.by_ref().any(|line| line.unwrap().contains("connected to")));
    let id = nix::unistd::Pid::from_raw(i32::try_from(child.id()).unwrap());
    nix::sys::signal::kill(id, nix::sys::signal::Signal::SIGINT).unwrap();
    let rest: Vec<String> = said.map(Result::unwrap).collect();
    assert!(child.wait().unwrap().success(), "{rest:?}");
    let mut printed = String::new();
    child.stdout.take().unwrap().read_to_string(&mut printed).unwrap();
    let report: Value = serde_json::from_str(&printed).unwrap();
    assert!(report["records"].as_u64().unwrap() > 0, "{report}");
    let (found, summary) = poses(&out).unwrap();
    assert_eq!((found.len() as u64, summary.is_clean()), (report["records"].as_u64().unwrap(), true), "{summary}");
    assert_eq!(summary.events.last().unwrap().value, Some("it was stopped".into()));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn arbitrary_bytes_are_neither_a_sequence_nor_a_table(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        prop_assert!(sequence(&bytes).is_err());
        prop_assert!(csv::read(&bytes[..], Path::new("x.csv")).is_err());
    }

    #[test]
    fn a_damaged_sequence_is_an_error_or_has_its_shape(
        flips in prop::collection::vec((any::<usize>(), prop_oneof![any::<u8>(), prop::sample::select(&b"0123456789 -.e\n="[..])]), 1..5),
        cut in prop_oneof![4 => Just(usize::MAX), 1 => any::<usize>()],
    ) {
        let mut bytes = [PLUS.as_bytes(), &pixels()].concat();
        for (at, value) in flips {
            let at = at % bytes.len();
            bytes[at] = value;
        }
        bytes.truncate(cut.max(1));
        if let Ok(head) = sequence(&bytes) {
            let count = head.images.len();
            if let Ok(rows) = tracked(&head, PROBE, Path::new("x.mha")) {
                prop_assert_eq!(rows.len(), count);
                for pose in rows.iter().filter_map(|row| row.pose) {
                    prop_assert!(pose.position_mm.is_finite() && pose.orientation.is_normalized());
                }
            }
        }
    }

    #[test]
    fn a_damaged_table_is_an_error_or_has_poses(
        flips in prop::collection::vec((any::<usize>(), prop::sample::select(&b"0123456789 -.,e\n#a"[..])), 1..6),
    ) {
        let mut bytes = TABLE.as_bytes().to_vec();
        for (at, value) in flips {
            let at = at % bytes.len();
            bytes[at] = value;
        }
        if let Ok(rows) = csv::read(&bytes[..], Path::new("x.csv")) {
            for row in rows {
                prop_assert!(row.time_s.is_finite());
                prop_assert!(row.pose.is_none_or(|pose| pose.orientation.is_normalized()));
            }
        }
    }
}
