//! Sessions that play recordings.

use insonify_core::pose::{Pose, Reading};

use super::*;
use crate::recording::{RecordingInfo, RecordingWriter, stream_of};
use crate::tracker::{NeedleSensor, ascii_line};

fn line(n: u32) -> String {
    let pose = Pose::from_components([f64::from(n), 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
    ascii_line::encode(n, u64::from(n) * 20_000, &pose)
}

/// A recording of 50 lines per second, each split in two.
fn recording(lines: u32) -> (tempfile::TempDir, Settings) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.mcap");
    let info = RecordingInfo { start_time_ns: 1_000_000_000, ..RecordingInfo::default() };
    let mut writer = RecordingWriter::create(&path, &info).unwrap();
    for n in 0..lines {
        let (time, line) = (1_000_000_000 + u64::from(n) * 20_000_000, line(n));
        writer.raw(time, &line.as_bytes()[..10]).unwrap();
        writer.raw(time + 1_000_000, &line.as_bytes()[10..]).unwrap();
    }
    writer.finish().unwrap();
    let transport = Transport::Recording { path, speed: Speed::AtOnce, repeat: false };
    (dir, Settings { transport, ..Settings::default() })
}

fn at(settings: &Settings, wanted: Speed, again: bool) -> Settings {
    let mut settings = settings.clone();
    if let Transport::Recording { speed, repeat, .. } = &mut settings.transport {
        (*speed, *repeat) = (wanted, again);
    }
    settings
}

#[tokio::test(start_paused = true)]
async fn a_recording_played_at_once_keeps_its_times() {
    let (dir, settings) = recording(100);
    let (session, calls, _) = session(&settings);
    let summary = session.run().await;
    let calls = calls.lock().unwrap();
    let (poses, _) = crate::recording::poses(&dir.path().join("a.mcap")).unwrap();
    let expected: Vec<_> = poses.iter().map(|p| (p.host_time_ns, Reading::Pose(p.pose))).collect();
    let found: Vec<_> = calls.records.iter().map(|(time, record)| (*time, record.reading)).collect();
    assert_eq!(found, expected);
    assert_eq!(names(&calls), ["connected", "ended"]);
    assert_eq!((summary.records, calls.bytes.len()), (100, 200));
}

#[tokio::test(start_paused = true)]
async fn a_recording_plays_at_a_factor_and_repeats() {
    let (_dir, settings) = recording(100);
    let (session, calls, cancel) = session(&at(&settings, Speed::Factor(4.0), true));
    let started = Instant::now();
    let cancelling = cancel.clone();
    calls.lock().unwrap().enough = Some((150, cancelling));
    session.run().await;
    let calls = calls.lock().unwrap();
    assert_eq!(calls.records.len(), 150);
    let times: Vec<_> = calls.records.iter().map(|(time, _)| time - calls.records[0].0).collect();
    // The timer rounds both times of each difference to 1 ms.
    for (i, time) in times[..100].iter().enumerate() {
        assert!(time.abs_diff(i as u64 * 5_000_000) <= 2_000_000, "record {i} at {time} ns");
    }
    assert_eq!(calls.records[100].1.sequence, Some(0));
    assert!(started.elapsed() > Duration::from_millis(700));
    assert_eq!(names(&calls), ["connected"]);
}

#[tokio::test(start_paused = true)]
async fn an_endless_recording_can_be_cancelled() {
    let (_dir, settings) = recording(10);
    let (session, calls, cancel) = session(&at(&settings, Speed::AtOnce, true));
    calls.lock().unwrap().enough = Some((1000, cancel));
    assert_eq!(session.run().await.records, 1000);
}

#[test]
fn the_selected_sensor_is_the_stations_or_the_streams() {
    let (dir, mut settings) = recording(1);
    let stream = |protocol, sensor| TrackerStream { protocol, sensor, needle: None };
    assert_eq!(stream_of(&settings).unwrap(), stream(Protocol::AsciiLine, None));
    let path = dir.path().join("b.mcap");
    let number = |number| Some(ProbeSensor::Number(number));
    let info = RecordingInfo { protocol: Protocol::Liberty, sensor: number(2), ..RecordingInfo::default() };
    RecordingWriter::create(&path, &info).unwrap().finish().unwrap();
    settings.transport = Transport::Recording { path, speed: Speed::AtOnce, repeat: false };
    assert_eq!(stream_of(&settings).unwrap(), stream(Protocol::Liberty, number(2)));
    settings.device.sensor = Some(3);
    assert_eq!(stream_of(&settings).unwrap(), stream(Protocol::Liberty, number(3)));
    // So is the needle's.
    settings.device.needle = Some(NeedleSensor::Number(4));
    assert_eq!(stream_of(&settings).unwrap().needle, Some(NeedleSensor::Number(4)));
    let live = Settings { protocol: Protocol::Liberty, ..Settings::default() };
    assert_eq!(stream_of(&live).unwrap(), stream(Protocol::Liberty, number(1)));
    let live = Settings { protocol: Protocol::OpenIgtLink, ..Settings::default() };
    assert_eq!(stream_of(&live).unwrap(), stream(Protocol::OpenIgtLink, Some(ProbeSensor::Only)));
}
