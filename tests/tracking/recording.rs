//! Tests of the way from raw tracker bytes, through a recording and back, to poses.
// clippy.toml allows these in test functions only, not in their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs;
use std::io::{Cursor, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use bytes::BytesMut;
use glam::{DQuat, DVec3};
use insonify::pose::{Pose, Reading, TimedPose, TrackingState};
use insonify::recording::{
    DecodedRecording, Event, Item, QueueLimits, Recorder, RecordingError, RecordingInfo, RecordingReader,
    RecordingSummary, RecordingWriter, SessionPose, SessionSettings, part_path, poses, poses_of,
};
use insonify::tracker::ascii_line::{self, LINE_LIMIT};
use insonify::tracker::{DecodeError, ProbeSensor, Protocol, Record};
use proptest::prelude::*;

const START_NS: u64 = 1_790_000_000_000_000_000;
const PERIOD_NS: u64 = 16_666_667;

fn info() -> RecordingInfo {
    RecordingInfo {
        protocol: Protocol::AsciiLine,
        device: "test board".into(),
        scene: "none".into(),
        start_time_ns: START_NS,
        sensor: None,
        needle: None,
    }
}

fn record(i: u32) -> Record {
    let angle = f64::from(i) * 0.01;
    let pose = Pose {
        position_mm: DVec3::new(f64::from(i), -0.5 * f64::from(i), 80.0),
        orientation: DQuat::from_rotation_y(angle),
    };
    Record::pose(i, u64::from(i) * 16_667, pose)
}

fn pose_of(record: &Record) -> Pose {
    match record.reading {
        Reading::Pose(pose) => pose,
        other => panic!("not a pose: {other:?}"),
    }
}

/// Text line of a record with a counter, a clock and a pose.
fn line(record: &Record) -> String {
    ascii_line::encode(record.sequence.unwrap(), record.device_time_us.unwrap(), &pose_of(record))
}

/// Writes a recording with one message per line of `lines`, 60 a second.
fn write(path: &Path, lines: &[String]) {
    let mut writer = RecordingWriter::create(path, &info()).unwrap();
    writer.event(&Event::new(START_NS, "start")).unwrap();
    for (i, line) in lines.iter().enumerate() {
        writer.raw(START_NS + i as u64 * PERIOD_NS, line.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
}

fn recording(count: u32) -> (tempfile::TempDir, std::path::PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("exam.mcap");
    write(&path, &(0..count).map(|i| line(&record(i))).collect::<Vec<_>>());
    (dir, path)
}

fn read_bytes(bytes: &[u8]) -> Result<(Vec<TimedPose>, RecordingSummary), RecordingError> {
    let path = Path::new("memory.mcap");
    poses_of(RecordingReader::from_source(Cursor::new(bytes), path)?, path)
}

#[test]
fn a_recording_returns_its_poses_times_and_events() {
    let (_dir, path) = recording(150);
    assert!(!path.with_extension("mcap.part").exists());
    let (found, summary) = poses(&path).unwrap();
    assert_eq!(found.len(), 150);
    for (i, timed) in found.iter().enumerate() {
        let expected = record(i as u32);
        assert_eq!(timed.host_time_ns, START_NS + i as u64 * PERIOD_NS);
        assert_eq!(Some(timed.device_time_us), expected.device_time_us);
        assert!(timed.pose.position_mm.distance(pose_of(&expected).position_mm) < 1e-4);
        assert!(timed.pose.orientation.angle_between(pose_of(&expected).orientation) < 1e-7);
    }
    assert!(summary.is_clean(), "{summary}");
    assert_eq!((summary.messages, summary.records), (150, 150));
    assert_eq!(summary.info, info());
    assert_eq!(summary.events, [Event::new(START_NS, "start")]);
    assert_eq!(summary.duration.as_nanos(), u128::from(149 * PERIOD_NS));
}

#[test]
fn the_same_session_gives_the_same_file() {
    let (_a, a) = recording(100);
    let (_b, b) = recording(100);
    assert_eq!(fs::read(a).unwrap(), fs::read(b).unwrap());
}

#[test]
fn an_unfinished_recording_keeps_all_but_its_last_second() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("exam.mcap");
    let mut writer = RecordingWriter::create(&path, &info()).unwrap();
    for i in 0..150_u32 {
        writer.raw(START_NS + u64::from(i) * PERIOD_NS, line(&record(i)).as_bytes()).unwrap();
    }
    // The file on disk while the writer still runs is what a kill would leave.
    let left = fs::read(dir.path().join("exam.mcap.part")).unwrap();
    let (found, summary) = read_bytes(&left).unwrap();
    assert_eq!(found.len(), 120);
    let truncated = summary.damage.truncated.unwrap();
    assert_eq!(truncated, format!("it ends at byte {}, between two records", left.len()));
    assert!(!path.exists());
}

#[test]
fn a_truncated_recording_is_used_up_to_its_end_and_reported() {
    let (_dir, path) = recording(300);
    let bytes = fs::read(&path).unwrap();
    let (found, summary) = read_bytes(&bytes[..bytes.len() / 2]).unwrap();
    assert!((100..300).contains(&found.len()), "{}", found.len());
    let text = summary.to_string();
    assert!(text.contains(&format!("the file is not whole: it ends at byte {}", bytes.len() / 2)), "{text}");
    assert!(!summary.is_clean());
    let end = format!("; what was read ends after {:.1} s", summary.duration.as_secs_f64());
    assert!(text.contains(&end), "{text}");

    let (found, summary) = read_bytes(&bytes[..bytes.len() - 1]).unwrap();
    assert_eq!(found.len(), 300);
    assert!(summary.damage.truncated.unwrap().ends_with("every message lies before that"));
}

#[test]
fn every_truncation_is_an_error_or_reported() {
    let (_dir, path) = recording(70);
    let bytes = fs::read(&path).unwrap();
    let mut most = 0;
    for length in 0..bytes.len() {
        match read_bytes(&bytes[..length]) {
            Ok((found, summary)) => {
                assert!(summary.damage.truncated.is_some(), "cut at {length}");
                assert!(found.len() >= most, "cut at {length}");
                most = found.len();
            }
            Err(RecordingError::NotMcap { .. }) => assert!(length < 8, "cut at {length}"),
            Err(RecordingError::NoTracker { .. } | RecordingError::NoPose { .. }) => assert_eq!(most, 0),
            Err(other) => panic!("cut at {length}: {other}"),
        }
    }
    assert_eq!(most, 70);
}

#[test]
fn a_damaged_chunk_is_skipped_and_counted() {
    let (_dir, path) = recording(180);
    let mut bytes = fs::read(&path).unwrap();
    let at = bytes.windows(5).position(|w| w == b"P,90,").unwrap();
    bytes[at + 8] ^= 1;
    let (found, summary) = read_bytes(&bytes).unwrap();
    assert_eq!((found.len(), summary.damage.damaged, summary.missing_records), (120, 1, 60));
    assert!(summary.to_string().contains("Chunk CRC failed"), "{summary}");
}

#[test]
fn wrong_lines_are_counted_and_the_rest_is_used() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("noisy.mcap");
    let mut lines: Vec<_> = (0..60).map(|i| line(&record(i))).collect();
    lines[10] = lines[10].replace("80.0000", "81.0000");
    lines[20] = "boot v1.2\r\n".into();
    lines[59].truncate(20);
    write(&path, &lines);
    let (found, summary) = poses(&path).unwrap();
    assert_eq!((found.len(), summary.decode_errors, summary.missing_records), (57, 3, 2));
    let offset: usize = lines[..10].iter().map(String::len).sum();
    let text = summary.to_string();
    for part in [&format!("byte {offset} of"), "has the checksum", "starts with `boot v1.2`", "ends after 20 bytes"] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
}

#[test]
fn a_record_has_the_time_of_its_first_byte_and_time_never_runs_backward() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("cut.mcap");
    let text: String = (0..4).map(|i| line(&record(i))).collect();
    let second = line(&record(0)).len();
    let mut writer = RecordingWriter::create(&path, &info()).unwrap();
    let pieces = [(0, 0..second + 5), (10, second + 5..second + 9), (20, second + 9..text.len() - 9)];
    for (time, range) in pieces {
        writer.raw(START_NS + time, &text.as_bytes()[range]).unwrap();
    }
    writer.raw(START_NS + 5, &text.as_bytes()[text.len() - 9..]).unwrap();
    writer.raw(START_NS + 6, line(&record(4)).as_bytes()).unwrap();
    writer.finish().unwrap();
    let (found, summary) = poses(&path).unwrap();
    let times: Vec<_> = found.iter().map(|p| p.host_time_ns - START_NS).collect();
    assert_eq!(times, [0, 0, 20, 20]);
    assert_eq!((summary.records, summary.time_reversals), (5, 1));
}

#[test]
fn other_files_get_a_clear_error() {
    let missing = poses(Path::new("/nonexistent/exam.mcap")).unwrap_err().to_string();
    assert!(missing.contains("cannot read the recording /nonexistent/exam.mcap"), "{missing}");
    for bytes in [&b""[..], b"\x89MCAP", b"time,x,y,z\n0,1,2,3\n"] {
        let error = read_bytes(bytes).unwrap_err();
        assert!(matches!(error, RecordingError::NotMcap { .. }), "{error}");
        assert!(error.to_string().starts_with("memory.mcap is not a recording"), "{error}");
    }
}

/// An MCAP file of another program, with the topic `topic`, its `metadata`, and one message.
fn foreign(topic: &str, metadata: &[(&str, &str)], message: &[u8]) -> Vec<u8> {
    let metadata = metadata.iter().map(|(k, v)| (k.to_string(), v.to_string())).collect();
    let options = mcap::WriteOptions::new().compression(None).use_chunks(false);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let channel_id = writer.add_channel(0, topic, "application/octet-stream", &metadata).unwrap();
    let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 5, publish_time: 5 };
    writer.write_to_known_channel(&header, message).unwrap();
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn the_metadata_is_checked() {
    let good = [("protocol", "ascii-line"), ("start_time_ns", "5"), ("format_version", "1")];
    let line = line(&record(1));
    let (found, _) = read_bytes(&foreign("/tracker/raw", &good, line.as_bytes())).unwrap();
    assert_eq!(found.len(), 1, "files without chunks are read too");

    let cases = [
        ("/camera", good, "memory.mcap holds no tracker data: it has no channel /tracker/raw"),
        (
            "/tracker/raw",
            [("protocol", "asci"), good[1], good[2]],
            "unknown tracker protocol `asci`; known: ascii-line",
        ),
        ("/tracker/raw", [good[0], good[1], ("format_version", "4")], "`format_version` is `4`; it must be in 1..=3"),
        ("/tracker/raw", [good[0], ("x", ""), good[2]], "`start_time_ns` is missing; it must be ns since 1970"),
    ];
    for (topic, metadata, message) in cases {
        let error = read_bytes(&foreign(topic, &metadata, line.as_bytes())).unwrap_err().to_string();
        assert!(error.contains(message), "{error}");
    }
    let error = read_bytes(&foreign("/tracker/raw", &good, b"noise\n")).unwrap_err().to_string();
    assert!(error.contains("holds no whole pose: byte 0"), "{error}");
}

fn settings() -> SessionSettings {
    SessionSettings {
        version: "0.1.0".into(),
        seed: 4_000_000_000,
        adapter: "llvmpipe".into(),
        station_path: "configs/sphere.toml".into(),
        station: "[scene]\npath = \"sphere.glb\" # µ\n".into(),
    }
}

fn session_pose(i: u32, state: TrackingState) -> SessionPose {
    SessionPose { host_time_ns: START_NS + u64::from(i) * PERIOD_NS, pose: pose_of(&record(i)), state }
}

/// Writes a complete session through a recorder.
fn session(path: &Path, info: &RecordingInfo) {
    let mut writer = RecordingWriter::create(path, info).unwrap();
    writer.settings(&settings()).unwrap();
    let recorder = Recorder::start(writer, QueueLimits::default()).unwrap();
    let handle = recorder.handle();
    for i in 0..150 {
        let time_ns = START_NS + u64::from(i) * PERIOD_NS;
        handle.raw(time_ns, line(&record(i)).as_bytes());
        handle.pose(session_pose(i, if i < 100 { TrackingState::Good } else { TrackingState::Held }));
        match i {
            50 => handle.event(Event::new(time_ns, "gain_db").with(-3.5)),
            60 => handle.event(Event::new(time_ns, "frozen").with(true)),
            _ => {}
        }
    }
    let recorded = recorder.finish();
    assert!(recorded.failure.is_none());
    assert_eq!((recorded.messages, recorded.poses, recorded.events, recorded.left_out), (150, 150, 2, 0));
}

#[test]
fn a_session_returns_its_poses_settings_and_values() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("session.mcap");
    session(&path, &RecordingInfo { sensor: Some(ProbeSensor::Number(0)), ..info() });
    let (found, summary) = poses(&path).unwrap();
    assert!(summary.is_clean(), "{summary}");
    assert_eq!((found.len(), summary.session_poses, summary.info.sensor), (150, 150, Some(ProbeSensor::Number(0))));
    assert_eq!(summary.settings, Some(settings()));
    let values: Vec<_> = summary.events.iter().map(|e| (e.name.as_str(), e.value.clone().unwrap())).collect();
    assert_eq!(values, [("gain_db", serde_json::json!(-3.5)), ("frozen", serde_json::json!(true))]);

    let mut decoded = DecodedRecording::new(RecordingReader::open(&path).unwrap());
    let (mut measurements, mut session_poses) = (0, Vec::new());
    while let Some(item) = decoded.next_item().unwrap() {
        match item {
            Item::Measurement(m) => {
                // Items come in the order of the session.
                assert_eq!(session_poses.len(), measurements);
                assert_eq!(m.sequence, Some(measurements as u32));
                measurements += 1;
            }
            Item::Pose(pose) => session_poses.push(pose),
            Item::Event(_) | Item::NeedleMeasurement(_) | Item::NeedlePose(_) => {}
        }
    }
    assert_eq!((measurements, session_poses.len()), (150, 150));
    for (i, found) in (0..).zip(&session_poses) {
        let expected = session_pose(i, if i < 100 { TrackingState::Good } else { TrackingState::Held });
        assert_eq!((found.host_time_ns, found.state), (expected.host_time_ns, expected.state));
        assert!(found.pose.position_mm.distance(expected.pose.position_mm) < 1e-10);
    }
}

#[test]
fn one_wrong_host_time_loses_one_pose() {
    let dir = tempfile::tempdir().unwrap();
    for (wrong_ns, at) in
        [(u64::MAX, 0), (u64::MAX, 40), (u64::MAX, 149), (0, 0), (0, 40), (START_NS + 3_600_000_000_000, 10)]
    {
        let path = dir.path().join(format!("{wrong_ns}-{at}.mcap"));
        let mut writer = RecordingWriter::create(&path, &info()).unwrap();
        for i in 0..150_u32 {
            let time_ns = if i == at { wrong_ns } else { START_NS + u64::from(i) * PERIOD_NS };
            writer.raw(time_ns, line(&record(i)).as_bytes()).unwrap();
        }
        // As left by a kill: one wrong time does not keep chunks from ending.
        let left = fs::read(part_path(&path)).unwrap();
        let on_disk = read_bytes(&left).map_or(0, |(poses, _)| poses.len());
        assert!(on_disk >= 60, "{on_disk} poses on the disk with {wrong_ns} at {at}");
        writer.finish().unwrap();
        let (found, summary) = poses(&path).unwrap();
        assert_eq!((found.len(), summary.time_reversals, summary.records), (149, 1, 150), "{wrong_ns} at {at}");
        assert!(found.iter().all(|pose| pose.host_time_ns != wrong_ns) && !summary.is_clean());
        assert!(summary.duration.as_secs_f64() < 2.6, "{summary}");
        assert!(summary.to_string().contains("1 poses left out since their time does not fit"), "{summary}");
    }
}

#[test]
fn an_unfinished_recording_is_named_kept_and_never_written_by_two() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("exam.mcap");
    let mut writer = RecordingWriter::create(&path, &info()).unwrap();
    writer.raw(START_NS, line(&record(7)).as_bytes()).unwrap();
    writer.flush().unwrap();
    let busy = RecordingWriter::create(&path, &info()).err().unwrap();
    assert!(matches!(busy, RecordingError::Busy { .. }), "{busy}");
    let unfinished = poses(&path).unwrap_err().to_string();
    assert!(
        unfinished.contains("was not finished; what was written of it is") && unfinished.ends_with("exam.mcap.part")
    );
    let left = fs::read(part_path(&path)).unwrap();
    // As after a kill: the lock is released, the file stays.
    drop(writer);
    for number in 1..3 {
        fs::write(part_path(&path), &left).unwrap();
        write(&path, &[line(&record(1))]);
        let kept = dir.path().join(format!("exam.recovered-{number}.mcap"));
        assert_eq!(fs::read(&kept).unwrap(), left);
        assert_eq!(poses(&kept).unwrap().0.len(), 1);
    }
    assert_eq!(poses(&path).unwrap().0.len(), 1);
    assert!(!part_path(&path).exists());
}

#[test]
fn damaged_settings_are_counted_and_the_poses_are_used() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("session.mcap");
    session(&path, &info());
    let whole = fs::read(&path).unwrap();
    for word in [&b"sphere.glb"[..], b"station.toml", b"4000000000"] {
        let mut bytes = whole.clone();
        let at = bytes.windows(word.len()).position(|w| w == word).unwrap();
        bytes[at + 2] = b'!';
        let (found, summary) = read_bytes(&bytes).unwrap();
        assert_eq!(found.len(), 150);
        // An attachment with another name is ignored.
        let station = summary.settings.as_ref().map(|s| s.station.as_str());
        assert!(summary.damage.damaged == 1 || station == Some(""), "{summary}");
    }
}

/// Starts `insonify record` of stdin in a shell that runs `before` first.
fn record_stdin(out: &Path, before: &str) -> Child {
    let station = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/sphere.toml");
    let mut command = Command::new("sh");
    command.args(["-c", &format!("{before} exec \"$0\" \"$@\""), env!("CARGO_BIN_EXE_insonify"), "record"]);
    command
        .arg(station)
        .arg("--stdin")
        .arg("--out")
        .arg(out)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::piped());
    command.spawn().unwrap()
}

/// Bytes of many lines, and the poses in them.
fn many_lines() -> (Vec<u8>, Vec<Pose>) {
    let text: String = (0..6000).map(|i| line(&record(i))).collect();
    let poses = decode_in_pieces(text.as_bytes(), &[]).into_iter().map(|record| pose_of(&record.unwrap())).collect();
    (text.into_bytes(), poses)
}

/// Asserts that the poses in the recording are the first ones of `sent`; returns their number.
fn is_a_prefix(recording: &Path, sent: &[Pose]) -> usize {
    let (found, summary) = poses(recording).unwrap();
    assert!(summary.damage.truncated.is_some() && summary.missing_records == 0, "{summary}");
    for (found, sent) in found.iter().zip(sent) {
        assert_eq!(found.pose, *sent);
    }
    assert_eq!(summary.settings.unwrap().seed, 0);
    found.len()
}

#[cfg(unix)]
#[test]
fn a_killed_recording_replays_up_to_its_last_complete_chunk() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("killed.mcap");
    let (text, sent) = many_lines();
    let mut child = record_stdin(&path, "");
    let mut stdin = child.stdin.take().unwrap();
    stdin.write_all(&text).unwrap();
    stdin.flush().unwrap();
    // Chunks of 64 KiB: four of them are complete once the file has 300 kB.
    let part = part_path(&path);
    let deadline = std::time::Instant::now() + std::time::Duration::from_secs(60);
    while fs::metadata(&part).map_or(0, |file| file.len()) < 300_000 {
        assert!(std::time::Instant::now() < deadline, "nothing is recorded");
        std::thread::yield_now();
    }
    child.kill().unwrap();
    assert!(!child.wait().unwrap().success());
    assert!(!path.exists());
    let count = is_a_prefix(&part, &sent);
    assert!((3000..=6000).contains(&count), "{count}");
}

#[cfg(unix)]
#[test]
fn a_full_disk_ends_the_recording_with_an_error_and_keeps_the_written_part() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("full.mcap");
    let (text, sent) = many_lines();
    // Files end at 200 kB or 400 kB, depending on the shell's block size. Writing more is an error instead of a signal.
    let mut child = record_stdin(&path, "trap '' XFSZ; ulimit -f 400;");
    // The pipe breaks when the recording has ended.
    let _ = child.stdin.take().unwrap().write_all(&text);
    let output = child.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    for part in ["the recording ended: cannot write the recording", "full.mcap.part", "File too large"] {
        assert!(message.contains(part), "`{part}` is missing: {message}");
    }
    assert!(!path.exists());
    let count = is_a_prefix(&part_path(&path), &sent);
    assert!((1000..6000).contains(&count), "{count}");
}

#[test]
#[ignore = "needs Python's mcap; `make test` runs it where that is installed"]
fn mcaps_own_reader_reads_our_recordings() {
    let python = std::env::var_os("INSONIFY_PYTHON").unwrap_or("python3".into());
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("session.mcap");
    session(&path, &info());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/read_recording.py");
    let output = Command::new(python).arg(script).arg(&path).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let seen: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(seen["profile"], "insonify");
    let raw: String = (0..150).map(|i| line(&record(i))).collect();
    assert_eq!((&seen["raw"], &seen["raw_metadata"]["protocol"]), (&raw.into(), &"ascii-line".into()));
    assert_eq!(seen["first_raw_time_ns"], START_NS);
    assert_eq!((&seen["events"][0]["name"], &seen["events"][0]["value"]), (&"gain_db".into(), &(-3.5).into()));
    assert_eq!(seen["pose_schema"], serde_json::json!(["foxglove.PoseInFrame", "jsonschema"]));
    assert_eq!((&seen["poses"], &seen["states"]), (&150.into(), &serde_json::json!(["good", "held"])));
    let last = &seen["last_pose"];
    assert_eq!(
        (&last["frame_id"], &last["timestamp"]["sec"]),
        (&"scene".into(), &(START_NS / 1_000_000_000 + 2).into())
    );
    assert!((last["pose"]["position"]["x"].as_f64().unwrap() - 0.149).abs() < 1e-12, "{last}");
    assert_eq!(seen["attachments"]["station.toml"], settings().station);
    assert_eq!(seen["metadata"]["insonify.settings"]["seed"], "4000000000");
}

fn any_record() -> impl Strategy<Value = Record> {
    let position = prop::array::uniform3(-1e5..1e5_f64);
    let axis = prop::array::uniform3(-1.0..1.0_f64);
    (any::<u32>(), any::<u64>(), position, axis, -4.0..4.0_f64).prop_map(
        |(sequence, device_time_us, p, axis, angle)| {
            let axis = DVec3::from_array(axis).normalize_or(DVec3::X);
            let orientation = DQuat::from_axis_angle(axis, angle);
            Record::pose(sequence, device_time_us, Pose { position_mm: DVec3::from_array(p), orientation })
        },
    )
}

/// Records and errors from `bytes`, received in pieces that end at `cuts`.
fn decode_in_pieces(bytes: &[u8], cuts: &[usize]) -> Vec<Result<Record, DecodeError>> {
    let mut ends: Vec<_> = cuts.iter().map(|cut| cut % (bytes.len() + 1)).collect();
    ends.push(bytes.len());
    ends.sort_unstable();
    let (mut decoder, mut buffer, mut out, mut start) = (Protocol::AsciiLine.decoder(), BytesMut::new(), Vec::new(), 0);
    for end in ends {
        buffer.extend_from_slice(&bytes[start..end]);
        start = end;
        loop {
            let before = buffer.len();
            match decoder.decode(&mut buffer) {
                Ok(Some(record)) => out.push(Ok(record)),
                Ok(None) => break,
                Err(error) => out.push(Err(error)),
            }
            assert!(buffer.len() < before, "no progress");
        }
        assert!(buffer.len() <= LINE_LIMIT);
    }
    out.extend(decoder.finish(&mut buffer).err().map(Err));
    assert!(buffer.is_empty());
    out
}

/// A piece of a stream: a record's line, or any kind of noise on a serial line.
fn any_piece() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        4 => any_record().prop_map(|r| line(&r).into_bytes()),
        1 => any_record().prop_map(|r| line(&r).replace('\n', "\r\n").into_bytes()),
        1 => prop::collection::vec(any::<u8>(), 0..40),
        1 => prop::collection::vec(prop::sample::select(&b"P,*\n\r0.-"[..]), 0..40),
        1 => (200..700_usize).prop_map(|n| vec![b'7'; n]),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_line_returns_its_record(record in any_record()) {
        let line = line(&record);
        prop_assert!(line.len() <= LINE_LIMIT);
        let found = Protocol::AsciiLine.decoder().decode(&mut BytesMut::from(line.as_str())).unwrap().unwrap();
        prop_assert_eq!((found.sequence, found.device_time_us), (record.sequence, record.device_time_us));
        for (a, b) in pose_of(&found).components().into_iter().zip(pose_of(&record).components()).take(3) {
            prop_assert!((a - b).abs() <= 5.1e-5);
        }
        for (a, b) in pose_of(&found).components().into_iter().zip(pose_of(&record).components()).skip(3) {
            prop_assert!((a - b).abs() <= 2e-8);
        }
    }

    #[test]
    fn any_split_of_any_stream_gives_the_same(
        pieces in prop::collection::vec(any_piece(), 0..12),
        cuts in prop::collection::vec(any::<usize>(), 0..20),
    ) {
        let bytes = pieces.concat();
        let whole = decode_in_pieces(&bytes, &[]);
        prop_assert_eq!(&decode_in_pieces(&bytes, &cuts), &whole);
        let every: Vec<_> = (0..bytes.len()).collect();
        prop_assert_eq!(&decode_in_pieces(&bytes, &every), &whole);
    }

    #[test]
    fn a_flipped_bit_never_passes_as_another_pose(record in any_record(), at in any::<usize>(), bit in 0..8_u8) {
        let mut bytes = line(&record).into_bytes();
        let whole = decode_in_pieces(&bytes, &[]);
        let at = at % bytes.len();
        bytes[at] ^= 1 << bit;
        for found in decode_in_pieces(&bytes, &[]).into_iter().flatten() {
            prop_assert_eq!(Ok(found), whole[0].clone());
        }
    }

    #[test]
    fn arbitrary_bytes_are_not_a_recording(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(read_bytes(&bytes).is_err());
        let behind_magic = [mcap::MAGIC, &bytes].concat();
        prop_assert!(read_bytes(&behind_magic).is_err());
    }

    #[test]
    fn an_arbitrary_chunk_without_checksum_never_panics(
        head in prop::collection::vec(prop_oneof![Just(0_u8), Just(4), Just(5), Just(6), Just(9), Just(0xff), any::<u8>()], 0..60),
        size in prop_oneof![Just(None), any::<u64>().prop_map(Some)],
    ) {
        let mut chunk = [0_u8; 40];
        chunk[16..24].copy_from_slice(&size.unwrap_or(head.len() as u64).to_le_bytes());
        chunk[32..].copy_from_slice(&(head.len() as u64).to_le_bytes());
        let length = (chunk.len() + head.len()) as u64;
        let bytes = [mcap::MAGIC, &[6], &length.to_le_bytes(), &chunk, &head].concat();
        prop_assert!(read_bytes(&bytes).is_err());
    }

    #[test]
    fn a_damaged_recording_never_panics_or_invents_poses(
        flips in prop::collection::vec((any::<usize>(), any::<u8>()), 1..6),
    ) {
        static RECORDING: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
        let whole = RECORDING.get_or_init(|| fs::read(recording(90).1).unwrap());
        let mut bytes = whole.clone();
        for (at, value) in flips {
            let at = at % bytes.len();
            bytes[at] = value;
        }
        let (original, _) = read_bytes(whole).unwrap();
        if let Ok((found, _)) = read_bytes(&bytes) {
            prop_assert!(found.iter().all(|pose| original.contains(pose)));
        }
    }
}
