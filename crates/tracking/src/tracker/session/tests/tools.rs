//! Sessions with several tools, and with damaged streams.

use glam::{DMat3, DVec3};
use insonify_core::pose::{Estimator, Measurement, TrackingState};
use tokio::io::AsyncWriteExt;

use super::devices::pipe;
use super::*;
use crate::recording::{DecodedRecording, Item, RecordingInfo, RecordingReader, RecordingWriter, stream_of};
use crate::tracker::openigtlink::message::put_transform;
use crate::tracker::{Damage, NeedleSensor, TrackerStream, ascii_line};

/// Time between two messages of a tool.
const PERIOD: Duration = Duration::from_millis(20);

/// A transform of `name` at (x, 0, 0).
fn transform(name: &str, x: f64) -> BytesMut {
    let mut bytes = BytesMut::new();
    put_transform(&mut bytes, name, 0, DMat3::IDENTITY, DVec3::X * x);
    bytes
}

/// A server that sends the stylus alone for 1 s, then the stylus and the probe.
fn server() -> Port {
    pipe(|mut far| async move {
        for n in 0..1000 {
            far.write_all(&transform("StylusToTracker", -500.0)).await.unwrap();
            if n > 50 {
                far.write_all(&transform("ProbeToTracker", f64::from(n))).await.unwrap();
            }
            sleep(PERIOD).await;
        }
    })
}

fn igtl(tool: Option<&str>) -> Settings {
    let mut settings = Settings { protocol: Protocol::OpenIgtLink, ..Settings::default() };
    settings.device.tool = tool.map(str::to_owned);
    settings
}

fn x_of(record: &Record) -> f64 {
    let insonify_core::pose::Reading::Pose(pose) = record.reading else { panic!("{record:?}") };
    pose.position_mm.x
}

async fn heard(tool: Option<&str>, seconds: u64) -> (SessionSummary, Shared) {
    let (mut session, calls, cancel) = session(&igtl(tool));
    session.port = server();
    (run_for(session, cancel, Duration::from_secs(seconds)).await, calls)
}

#[tokio::test(start_paused = true)]
async fn nothing_is_the_probe_once_a_second_tool_is_heard() {
    let (summary, calls) = heard(None, 4).await;
    let calls = calls.lock().unwrap();
    assert_eq!(names(&calls), ["connected", "only tool", "undecided"]);
    assert!((50..=52).contains(&calls.records.len()), "{}", calls.records.len());
    assert!(summary.undecided && summary.other_sensor > 200, "{summary:?}");
    let text = calls.events[2].1.to_string();
    assert!(text.contains("tool `StylusToTracker`, tool `ProbeToTracker`") && text.contains("--tool"), "{text}");
}

#[tokio::test(start_paused = true)]
async fn a_named_tool_is_the_probe_whenever_it_comes() {
    let (summary, calls) = heard(Some("ProbeToTracker"), 4).await;
    let calls = calls.lock().unwrap();
    assert_eq!(names(&calls), ["connected", "other sensor"]);
    assert!(calls.records.len() > 140 && calls.records.iter().all(|(_, record)| x_of(record) > 0.0), "{summary:?}");
}

#[tokio::test(start_paused = true)]
async fn a_named_tool_that_is_not_heard_is_told_with_those_that_are() {
    let (summary, calls) = heard(Some("probetotracker"), 4).await;
    let calls = calls.lock().unwrap();
    assert_eq!((summary.records, names(&calls)[1]), (0, "other sensor"));
    let missing = calls.events.iter().find(|(_, event)| name(event) == "probe missing").unwrap();
    let text = missing.1.to_string();
    assert!(text.contains("`probetotracker`) is not heard for 2.0 s"), "{text}");
    assert!(text.contains("did you mean `ProbeToTracker`?"), "{text}");
}

/// A session with the server above, with the stylus as its needle under `name`.
async fn with_needle(name: &str, seconds: u64) -> (SessionSummary, Shared) {
    let mut settings = igtl(None);
    settings.device.needle = Some(NeedleSensor::Tool(name.to_owned()));
    let (mut session, calls, cancel) = session(&settings);
    session.port = server();
    (run_for(session, cancel, Duration::from_secs(seconds)).await, calls)
}

#[tokio::test(start_paused = true)]
async fn the_needle_is_heard_apart_from_the_probe_which_needs_no_choice() {
    let (summary, calls) = with_needle("StylusToTracker", 4).await;
    let calls = calls.lock().unwrap();
    assert_eq!(names(&calls), ["connected", "only tool"]);
    assert!(calls.records.len() > 140 && calls.records.iter().all(|(_, record)| x_of(record) > 0.0));
    assert!(calls.needle.len() > 190 && calls.needle.iter().all(|(_, record)| x_of(record) == -500.0));
    assert_eq!((summary.needle_records, summary.other_sensor), (calls.needle.len() as u64, 0));
    assert!(!summary.undecided);
}

#[tokio::test(start_paused = true)]
async fn a_needle_that_is_never_heard_is_told_once() {
    let (summary, calls) = with_needle("stylustotracker", 6).await;
    let calls = calls.lock().unwrap();
    let told: Vec<_> = calls.events.iter().filter(|(_, event)| name(event) == "needle missing").collect();
    assert_eq!((told.len(), summary.needle_records), (1, 0));
    let text = told[0].1.to_string();
    assert!(text.contains("the needle (tool `stylustotracker`) is not heard for 2.0 s"), "{text}");
    assert!(text.contains("did you mean `StylusToTracker`?"), "{text}");
}

/// Tracking states of probe and needle at these times of a session, s since its first record.
fn states(calls: &Calls, times_s: &[f64]) -> Vec<(TrackingState, TrackingState)> {
    let [mut probe, mut needle] = [(); 2].map(|()| Estimator::new(insonify_core::pose::Settings::default()));
    let start_ns = calls.records[0].0.min(calls.needle[0].0);
    let measurements = |records: &[(u64, Record)]| -> Vec<Measurement> {
        records.iter().map(|(host_time_ns, record)| record.measurement(*host_time_ns)).collect()
    };
    let all = [measurements(&calls.records), measurements(&calls.needle)];
    let mut next = [0; 2];
    let mut at = |time_s: &f64| {
        let now_ns = start_ns + (1e9 * time_s) as u64;
        for ((estimator, all), next) in [&mut probe, &mut needle].into_iter().zip(&all).zip(&mut next) {
            while let Some(measurement) = all.get(*next).filter(|m| m.host_time_ns <= now_ns) {
                estimator.push(measurement);
                *next += 1;
            }
        }
        (probe.sample(now_ns, now_ns).state, needle.sample(now_ns, now_ns).state)
    };
    times_s.iter().map(&mut at).collect()
}

#[tokio::test(start_paused = true)]
async fn a_needle_out_of_view_for_two_seconds_is_lost_alone_and_found_again() {
    use TrackingState::{Good, Held, Lost, Stale};
    for order in [["ProbeToTracker", "NeedleToTracker"], ["NeedleToTracker", "ProbeToTracker"]] {
        let mut settings = igtl(Some("ProbeToTracker"));
        settings.device.needle = Some(NeedleSensor::Tool("NeedleToTracker".to_owned()));
        let (mut session, calls, cancel) = session(&settings);
        session.port = pipe(move |mut far| async move {
            for n in 0..250 {
                for name in order {
                    // 2.4 s without a message of the needle.
                    if name == "ProbeToTracker" || !(50..170).contains(&n) {
                        far.write_all(&transform(name, 0.1 * f64::from(n))).await.unwrap();
                    }
                }
                sleep(PERIOD).await;
            }
        });
        run_for(session, cancel, Duration::from_secs(5)).await;
        let calls = calls.lock().unwrap();
        assert_eq!(names(&calls), ["connected"], "{order:?}");
        let found = states(&calls, &[0.9, 1.3, 1.9, 3.2, 4.5]);
        let needle: Vec<_> = found.iter().map(|(_, needle)| *needle).collect();
        assert_eq!(needle, [Good, Held, Stale, Lost, Good], "{order:?}");
        assert!(found.iter().all(|(probe, _)| *probe == Good), "{order:?}: {found:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_probe_that_is_missed_is_told_while_only_the_needle_is_heard() {
    let (mut session, calls, cancel) = {
        let mut settings = igtl(Some("Probe"));
        settings.device.needle = Some(NeedleSensor::Tool("StylusToTracker".to_owned()));
        session(&settings)
    };
    session.port = server();
    run_for(session, cancel, Duration::from_millis(2990)).await;
    assert!(names(&calls.lock().unwrap()).contains(&"probe missing"));
}

#[test]
fn a_name_for_a_protocol_with_numbers_is_refused() {
    let mut settings = mock("move 1");
    settings.device.tool = Some("Probe".into());
    let listener = Box::new(TrackerListener(Shared::default()));
    let error = spawn(&settings, listener, CancellationToken::new()).unwrap_err();
    assert!(error.to_string().contains("`ascii-line` has no named tools, so the probe can't be `Probe`"), "{error}");
}

#[test]
fn a_number_for_a_protocol_with_names_is_refused() {
    let mut settings = igtl(None);
    settings.device.sensor = Some(0);
    let listener = Box::new(TrackerListener(Shared::default()));
    let error = spawn(&settings, listener, CancellationToken::new()).unwrap_err();
    assert!(error.to_string().contains("`openigtlink` numbers its tools by arrival"), "{error}");
}

/// A session is recorded and its bytes are played again.
#[tokio::test(start_paused = true)]
async fn a_replay_takes_the_same_records_as_the_session() {
    for tool in [None, Some("ProbeToTracker")] {
        let (_, calls) = heard(tool, 3).await;
        let (bytes, live) = {
            let calls = calls.lock().unwrap();
            let live: Vec<_> = calls.records.iter().map(|(time, record)| (*time, record.reading)).collect();
            (calls.bytes.clone(), live)
        };
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.mcap");
        let TrackerStream { protocol, sensor, needle } = stream_of(&igtl(tool)).unwrap();
        let info = RecordingInfo { protocol, sensor, needle, ..RecordingInfo::default() };
        let mut writer = RecordingWriter::create(&path, &info).unwrap();
        bytes.iter().for_each(|(time, bytes)| writer.raw(*time, bytes).unwrap());
        writer.finish().unwrap();
        assert!(live.len() > 40);

        let mut decoded = DecodedRecording::new(RecordingReader::open(&path).unwrap());
        let mut found = Vec::new();
        while let Some(item) = decoded.next_item().unwrap() {
            let Item::Measurement(measurement) = item else { panic!("{item:?}") };
            found.push((measurement.host_time_ns, measurement.reading));
        }
        assert_eq!(found, live, "{tool:?}");
        let summary = decoded.finish();
        assert_eq!((summary.sensors.len(), summary.undecided), (2, tool.is_none()));

        let transport = Transport::Recording { path, speed: Speed::AtOnce, repeat: false };
        let (session, calls, _) = session(&Settings { transport, ..Settings::default() });
        session.run().await;
        let calls = calls.lock().unwrap();
        let played: Vec<_> = calls.records.iter().map(|(time, record)| (*time, record.reading)).collect();
        assert_eq!(played, live, "{tool:?}");
    }
}

#[tokio::test(start_paused = true)]
async fn damage_is_counted_each_and_told_seldom() {
    let (mut session, calls, cancel) = session(&Settings::default());
    session.port = pipe(|mut far| async move {
        for n in 0..1000_u32 {
            let line = ascii_line::encode(n, u64::from(n) * 10_000, &insonify_core::pose::Pose::IDENTITY);
            // Every second line lost its last character before the line feed.
            let line = if n.is_multiple_of(2) { line } else { format!("{}\n", &line[..line.len() - 2]) };
            far.write_all(line.as_bytes()).await.unwrap();
            sleep(Duration::from_millis(10)).await;
        }
        std::future::pending::<()>().await;
    });
    let summary = run_for(session, cancel, Duration::from_secs(11)).await;
    assert_eq!((summary.records, summary.decode_errors), (500, 500));
    let calls = calls.lock().unwrap();
    let told: Vec<&Damage> = calls
        .events
        .iter()
        .filter_map(|(_, event)| if let TrackerEvent::Damaged(damage) = event { Some(damage) } else { None })
        .collect();
    // The first report comes after one second, further reports at most every five seconds.
    assert_eq!(told.len(), 3, "{told:?}");
    assert_eq!(told.iter().map(|damage| damage.damaged).sum::<u64>(), 500);
    let text = told[1].to_string();
    assert!(text.contains("250 damaged pieces and 250 records in 5.0 s; the last: byte"), "{text}");
}
