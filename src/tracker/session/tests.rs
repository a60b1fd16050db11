//! Sessions in simulated time: with the mock, with recordings, and with a simulated Polhemus device.

use std::io;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};
use tokio_util::sync::CancellationToken;

use super::*;
use crate::pose::{Pose, Reading};
use crate::tracker::recording::{RecordingInfo, RecordingWriter};
use crate::tracker::transport::pipe::PipePort;
use crate::tracker::{Protocol, Speed, ascii_line, mock};

#[path = "../../../tests/trackers/polhemus.rs"]
#[allow(clippy::unwrap_used, clippy::panic, missing_docs, unreachable_pub, dead_code)]
mod polhemus;
use polhemus::{Kind, Polhemus};

/// Calls that a listener received.
#[derive(Debug, Default)]
struct Heard {
    bytes: Vec<(u64, Vec<u8>)>,
    records: Vec<(u64, Record)>,
    events: Vec<(u64, TrackerEvent)>,
    /// Number of records at which to cancel.
    enough: Option<(usize, CancellationToken)>,
}

type Shared = Arc<Mutex<Heard>>;

struct TrackerListener(Shared);

impl Listener for TrackerListener {
    fn bytes(&mut self, host_time_ns: u64, bytes: &[u8]) {
        self.0.lock().unwrap().bytes.push((host_time_ns, bytes.to_vec()));
    }

    fn record(&mut self, host_time_ns: u64, record: &Record) {
        let mut heard = self.0.lock().unwrap();
        heard.records.push((host_time_ns, *record));
        if let Some((count, cancel)) = &heard.enough
            && heard.records.len() >= *count
        {
            cancel.cancel();
        }
    }

    fn event(&mut self, host_time_ns: u64, event: &TrackerEvent) {
        self.0.lock().unwrap().events.push((host_time_ns, event.clone()));
    }
}

fn session(settings: &Settings) -> (Session, Shared, CancellationToken) {
    let (heard, cancel) = (Shared::default(), CancellationToken::new());
    let session = Session::new(settings, Box::new(TrackerListener(heard.clone())), cancel.clone()).unwrap();
    (session, heard, cancel)
}

/// Runs a session for `time`.
async fn run_for(session: Session, cancel: CancellationToken, time: Duration) -> SessionSummary {
    let clock = async {
        sleep(time).await;
        cancel.cancel();
    };
    tokio::join!(session.run(), clock).0
}

fn mock(schedule: &str) -> Settings {
    let mock = mock::Settings { schedule: schedule.parse().unwrap(), rate_hz: 100.0, ..mock::Settings::default() };
    Settings { transport: Transport::Mock(mock), ..Settings::default() }
}

fn names(heard: &Heard) -> Vec<&'static str> {
    heard.events.iter().map(|(_, event)| name(event)).collect()
}

fn name(event: &TrackerEvent) -> &'static str {
    match event {
        TrackerEvent::Connected { .. } => "connected",
        TrackerEvent::Disconnected { .. } => "disconnected",
        TrackerEvent::Silent { .. } => "silent",
        TrackerEvent::DecodeError(_) => "decode error",
        TrackerEvent::OtherSensor { .. } => "other sensor",
        TrackerEvent::Ended => "ended",
    }
}

#[tokio::test(start_paused = true)]
async fn a_steady_mock_delivers_records_at_its_times() {
    let (session, heard, cancel) = session(&mock("move 100"));
    let summary = run_for(session, cancel, Duration::from_millis(1005)).await;
    let heard = heard.lock().unwrap();
    assert_eq!(names(&heard), ["connected"]);
    assert_eq!((summary.records, heard.records.len(), summary.decode_errors), (101, 101, 0));
    let times: Vec<_> = heard.records.iter().map(|(time, _)| time - heard.records[0].0).collect();
    assert!(times.iter().enumerate().all(|(i, time)| *time == i as u64 * 10_000_000), "{times:?}");
    assert_eq!(summary.bytes, heard.bytes.iter().map(|(_, bytes)| bytes.len() as u64).sum::<u64>());
}

#[tokio::test(start_paused = true)]
async fn a_silent_mock_is_reported_and_recovers() {
    let (session, heard, cancel) = session(&mock("move 1, drop 7"));
    run_for(session, cancel, Duration::from_millis(8495)).await;
    let heard = heard.lock().unwrap();
    // A limit of 2 s, then twice as much: the second silence would be reported at 0.99 + 2 + 4 s.
    assert_eq!(names(&heard), ["connected", "silent", "silent"]);
    let silent: Vec<_> = heard.events[1..].iter().map(|(_, event)| event.clone()).collect();
    let expected = [(2, 1), (6, 2)].map(|(s, attempt)| TrackerEvent::Silent { for_: Duration::from_secs(s), attempt });
    assert_eq!(silent, expected);
    assert_eq!(heard.records.len(), 150);
    let gap = heard.records[100].1.sequence.unwrap() - heard.records[99].1.sequence.unwrap();
    assert_eq!(gap, 701, "the board's counter goes on");
}

#[tokio::test(start_paused = true)]
async fn an_unplugged_mock_is_reopened_until_it_returns() {
    let (session, heard, cancel) = session(&mock("move 1, unplug 3, corrupt 1"));
    let summary = run_for(session, cancel, Duration::from_millis(4900)).await;
    let heard = heard.lock().unwrap();
    // It disappears at 1 s; reopening is tried at 1.25, 1.75, 2.75 and 4.75 s.
    assert_eq!(names(&heard)[..5], ["connected", "disconnected", "disconnected", "disconnected", "disconnected"]);
    assert_eq!(names(&heard)[5], "connected");
    let TrackerEvent::Disconnected { reason, retry } = &heard.events[4].1 else { panic!() };
    assert!(reason.contains("unplugged") && *retry == Duration::from_secs(2), "{reason}, {retry:?}");
    assert!(summary.decode_errors > 0 && heard.records.len() > 100, "{summary:?}");
}

fn line(n: u32) -> String {
    let pose = Pose::from_components([f64::from(n), 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
    ascii_line::encode(n, u64::from(n) * 20_000, &pose)
}

/// A recording of 50 lines a second, each split in two.
fn recording(lines: u32) -> (tempfile::TempDir, Settings) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.mcap");
    let info = RecordingInfo {
        protocol: Protocol::AsciiLine,
        device: String::new(),
        scene: String::new(),
        start_time_ns: 1_000_000_000,
        sensor: None,
    };
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
    let (session, heard, _) = session(&settings);
    let summary = session.run().await;
    let heard = heard.lock().unwrap();
    let (poses, _) = crate::tracker::recording::poses(&dir.path().join("a.mcap")).unwrap();
    let expected: Vec<_> = poses.iter().map(|p| (p.host_time_ns, Reading::Pose(p.pose))).collect();
    let found: Vec<_> = heard.records.iter().map(|(time, record)| (*time, record.reading)).collect();
    assert_eq!(found, expected);
    assert_eq!(names(&heard), ["connected", "ended"]);
    assert_eq!((summary.records, heard.bytes.len()), (100, 200));
}

#[tokio::test(start_paused = true)]
async fn a_recording_plays_at_a_factor_and_repeats() {
    let (_dir, settings) = recording(100);
    let (session, heard, cancel) = session(&at(&settings, Speed::Factor(4.0), true));
    let started = Instant::now();
    let cancelling = cancel.clone();
    heard.lock().unwrap().enough = Some((150, cancelling));
    session.run().await;
    let heard = heard.lock().unwrap();
    assert_eq!(heard.records.len(), 150);
    let times: Vec<_> = heard.records.iter().map(|(time, _)| time - heard.records[0].0).collect();
    // Within a millisecond, the resolution of the timer.
    for (i, time) in times[..100].iter().enumerate() {
        assert!(time.abs_diff(i as u64 * 5_000_000) <= 2_000_000, "record {i} at {time} ns");
    }
    assert_eq!(heard.records[100].1.sequence, Some(0));
    assert!(started.elapsed() > Duration::from_millis(700));
    assert_eq!(names(&heard), ["connected"]);
}

#[tokio::test(start_paused = true)]
async fn an_endless_recording_can_be_cancelled() {
    let (_dir, settings) = recording(10);
    let (session, heard, cancel) = session(&at(&settings, Speed::AtOnce, true));
    heard.lock().unwrap().enough = Some((1000, cancel));
    assert_eq!(session.run().await.records, 1000);
}

#[tokio::test(start_paused = true)]
async fn sessions_end_when_cancelled_in_any_state() {
    // No tracker; waiting to reopen; no device present.
    let port = crate::tracker::PortName::Path("/nonexistent/tty".into());
    let transports = [Transport::None, Transport::Serial { port, baud: 9600 }, Transport::Hid { device: None }];
    for transport in transports {
        let protocol = Protocol::AsciiLine;
        if !transport.carries(protocol) || (transport.name() == "serial" && !cfg!(feature = "serial")) {
            continue;
        }
        let settings = Settings { transport, protocol, ..Settings::default() };
        for milliseconds in [0, 100, 10_000] {
            let (session, heard, cancel) = session(&settings);
            run_for(session, cancel, Duration::from_millis(milliseconds)).await;
            assert!(heard.lock().unwrap().records.is_empty());
        }
    }
}

#[test]
fn impossible_settings_are_refused() {
    let listener = || Box::new(TrackerListener(Shared::default()));
    let settings = Settings { transport: Transport::Hid { device: None }, ..Settings::default() };
    let error = spawn(&settings, listener(), CancellationToken::new()).unwrap_err();
    assert_eq!(error.to_string(), "trackers that speak `ascii-line` aren't reached by transport `hid`");
    let path = "/nonexistent/a.mcap".into();
    let transport = Transport::Recording { path, speed: Speed::AtOnce, repeat: false };
    let error =
        spawn(&Settings { transport, ..Settings::default() }, listener(), CancellationToken::new()).unwrap_err();
    assert!(error.to_string().contains("cannot read the recording /nonexistent/a.mcap"), "{error}");
}

/// A device behind a pipe.
type Device = Arc<Mutex<Polhemus>>;

/// Plays the device's side of one connection, until the host disconnects.
async fn play(device: Device, mut stream: DuplexStream, epoch: Instant) {
    let mut input = [0; 256];
    loop {
        let due = device.lock().unwrap().next_at().map_or(epoch.elapsed() + Duration::from_millis(5), |at| at);
        tokio::select! {
            read = stream.read(&mut input) => match read {
                Ok(length) if length > 0 => device.lock().unwrap().receive(epoch.elapsed(), &input[..length]),
                _ => return,
            },
            () = sleep_until(epoch + due) => {}
        }
        loop {
            let record = device.lock().unwrap().next_record(epoch.elapsed());
            let Some(record) = record else { break };
            // The host has disconnected; its earlier bytes are still to be read.
            if stream.write_all(&record).await.is_err() {
                break;
            }
        }
    }
}

fn piped(device: &Device, protocol: Protocol, reset_delay: Duration) -> (Session, Shared, CancellationToken) {
    let mut settings = Settings { protocol, ..Settings::default() };
    settings.device.reset_delay = reset_delay;
    let (mut session, heard, cancel) = session(&settings);
    let (device, epoch) = (device.clone(), Instant::now());
    session.port = Port::Pipe(PipePort::new(Box::new(move || -> io::Result<DuplexStream> {
        let (host, far) = tokio::io::duplex(4096);
        tokio::spawn(play(device.clone(), far, epoch));
        Ok(host)
    })));
    (session, heard, cancel)
}

const POLHEMUS: [(Kind, Protocol); 3] = [
    (Kind::Fastrak, Protocol::FastrakAscii),
    (Kind::Fastrak, Protocol::FastrakBinary),
    (Kind::Liberty, Protocol::Liberty),
];

#[tokio::test(start_paused = true)]
async fn a_polhemus_device_is_set_up_and_streams_millimetres() {
    for (kind, protocol) in POLHEMUS {
        let device = Device::new(Mutex::new(Polhemus::new(kind)));
        // An earlier program left it streaming something else.
        device.lock().unwrap().state.streaming = true;
        let (session, heard, cancel) = piped(&device, protocol, Duration::from_secs(20));
        run_for(session, cancel, Duration::from_secs(3)).await;
        sleep(Duration::from_millis(50)).await;
        assert!(!device.lock().unwrap().state.streaming, "it is told to stop");
        let (device, heard) = (device.lock().unwrap(), heard.lock().unwrap());
        assert_eq!((device.resets, device.refused.as_slice()), (0, [].as_slice()), "{protocol:?}");
        assert_eq!(device.state.hemisphere.as_deref(), Some("0,0,1"));
        assert!(device.state.station_on && device.state.centimetres);
        assert!(heard.records.len() > 200, "{protocol:?}: {} records, {:?}", heard.records.len(), names(&heard));
        let Reading::Pose(pose) = heard.records.last().unwrap().1.reading else { panic!() };
        assert!((pose.position_mm.y + 200.0).abs() < 1e-3 && (pose.position_mm.z - 300.0).abs() < 1e-3, "{pose:?}");
        assert!((pose.orientation * glam::DVec3::X).distance(glam::DVec3::Y) < 1e-3);
        assert!(!names(&heard).contains(&"silent"));
    }
}

#[tokio::test(start_paused = true)]
async fn a_hung_device_is_restarted_with_growing_force_until_its_reset() {
    for (kind, protocol) in POLHEMUS {
        let device = Device::new(Mutex::new(Polhemus::new(kind)));
        device.lock().unwrap().hung = true;
        let (session, heard, cancel) = piped(&device, protocol, Duration::from_secs(20));
        run_for(session, cancel, Duration::from_secs(60)).await;
        let (device, heard) = (device.lock().unwrap(), heard.lock().unwrap());
        // Commands alone, then with a carriage return first, then with a reset on a reopened port.
        assert_eq!(names(&heard), ["connected", "silent", "silent", "disconnected", "connected"], "{protocol:?}");
        assert_eq!((device.resets, device.lost), (1, 0), "{protocol:?}");
        assert!(heard.records.len() > 1000, "{protocol:?}: {}", heard.records.len());
    }
}

#[tokio::test(start_paused = true)]
async fn commands_during_a_reset_are_lost() {
    let device = Device::new(Mutex::new(Polhemus::new(Kind::Liberty)));
    device.lock().unwrap().hung = true;
    // Less than the 15 s that the reset takes.
    let (session, heard, cancel) = piped(&device, Protocol::Liberty, Duration::from_secs(5));
    run_for(session, cancel, Duration::from_secs(20)).await;
    assert!(device.lock().unwrap().lost > 0 && heard.lock().unwrap().records.is_empty());
}

#[tokio::test(start_paused = true)]
async fn another_sensor_is_ignored_and_reported_once() {
    let mut settings = Settings { protocol: Protocol::FastrakAscii, ..Settings::default() };
    settings.device.sensor = Some(1);
    let (mut session, heard, cancel) = session(&settings);
    session.port = Port::Pipe(PipePort::new(Box::new(|| {
        let (host, mut far) = tokio::io::duplex(4096);
        tokio::spawn(async move {
            for station in ['1', '2', '1', '2', '3', '1'] {
                let line = format!("0{station}   10.50 -20.25  30.12  90.00   0.00   0.00\r\n");
                far.write_all(line.as_bytes()).await.unwrap();
                sleep(Duration::from_millis(10)).await;
            }
            far.write_all(b"01   10.5").await.unwrap();
        });
        Ok(host)
    })));
    let summary = run_for(session, cancel, Duration::from_millis(200)).await;
    let heard = heard.lock().unwrap();
    assert_eq!((summary.records, summary.other_sensor), (3, 3));
    // Then the port is lost within a record.
    assert_eq!(names(&heard), ["connected", "other sensor", "other sensor", "decode error", "disconnected"]);
    assert_eq!(heard.events[1].1, TrackerEvent::OtherSensor { sensor: 2, used: 1 });
    let text = format!("{:?}", heard.events[3].1);
    assert!(text.contains("Incomplete { length: 9 }"), "{text}");
}

#[tokio::test(start_paused = true)]
async fn a_device_with_normal_silence_is_not_restarted() {
    let (mut session, heard, cancel) = session(&mock("drop 86400"));
    session.may_rest = true;
    let summary = run_for(session, cancel, Duration::from_secs(3 * 3600)).await;
    assert_eq!((names(&heard.lock().unwrap()), summary.silences), (vec!["connected"], 0));
}

/// A device that is set up within 3 s, does not answer for 2 s, and is then set up again by its driver.
#[derive(Default)]
struct NeverAnswers {
    started: Duration,
    now: Duration,
}

impl NeverAnswers {
    fn in_round(&self) -> Duration {
        Duration::from_millis((self.now - self.started).as_millis() as u64 % 5000)
    }

    fn is_asked(&self) -> bool {
        self.in_round() >= Duration::from_secs(3)
    }
}

impl Driver for NeverAnswers {
    fn protocol(&self) -> Protocol {
        Protocol::Ndi
    }

    fn start(&mut self, now: Duration, _: u32) {
        (self.started, self.now) = (now, now);
    }

    fn transmit(&mut self, now: Duration) -> Option<bytes::Bytes> {
        self.now = now;
        None
    }

    fn wake_at(&self) -> Option<Duration> {
        let next = Duration::from_secs(if self.is_asked() { 5 } else { 3 });
        Some(self.now + next - self.in_round())
    }

    fn silence_limit(&self) -> Duration {
        Duration::from_secs(if self.is_asked() { 5 } else { 40 })
    }

    fn decode(&mut self, _: Duration, _: &mut BytesMut) -> Result<Option<Record>, DecodeError> {
        Ok(None)
    }

    fn finish(&mut self, _: &mut BytesMut) -> Result<(), DecodeError> {
        Ok(())
    }
}

#[tokio::test(start_paused = true)]
async fn a_device_that_is_set_up_and_never_answers_is_silent() {
    let (mut session, heard, cancel) = session(&Settings::default());
    session.driver = Box::<NeverAnswers>::default();
    session.port = Port::Pipe(PipePort::new(Box::new(|| {
        let (host, far) = tokio::io::duplex(4096);
        // The far end stays open until the test's runtime ends.
        tokio::spawn(async move {
            let _far = far;
            std::future::pending::<()>().await;
        });
        Ok(host)
    })));
    run_for(session, cancel, Duration::from_millis(21_200)).await;
    // First asked at 3 s: silent when asked again at 8 s, and with twice the limit 13 s after that.
    assert_eq!(names(&heard.lock().unwrap()), ["connected", "silent", "silent", "disconnected"]);
}

#[test]
fn the_selected_sensor_is_the_stations_or_the_streams() {
    let (dir, mut settings) = recording(1);
    assert_eq!(stream_sensor(&settings).unwrap(), None);
    let path = dir.path().join("b.mcap");
    let info = RecordingInfo {
        protocol: Protocol::Liberty,
        device: String::new(),
        scene: String::new(),
        start_time_ns: 1,
        sensor: Some(2),
    };
    RecordingWriter::create(&path, &info).unwrap().finish().unwrap();
    settings.transport = Transport::Recording { path, speed: Speed::AtOnce, repeat: false };
    assert_eq!(stream_sensor(&settings).unwrap(), Some(2));
    settings.device.sensor = Some(3);
    assert_eq!(stream_sensor(&settings).unwrap(), Some(3));
    let live = Settings { protocol: Protocol::Liberty, ..Settings::default() };
    assert_eq!(stream_sensor(&live).unwrap(), Some(1));
}
