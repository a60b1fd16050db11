//! Sessions in simulated time: here with the mock; with recordings and simulated devices in the submodules.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use tokio_util::sync::CancellationToken;

use super::*;
use crate::recording::{self, RecordingPlayback};
use crate::tracker::{PlaybackError, Protocol, Record, Speed, TrackerStream, mock};

mod devices;
mod recordings;
mod tools;

/// Calls received by a listener.
#[derive(Debug, Default)]
struct Calls {
    bytes: Vec<(u64, Vec<u8>)>,
    records: Vec<(u64, Record)>,
    needle: Vec<(u64, Record)>,
    events: Vec<(u64, TrackerEvent)>,
    /// Number of records at which to cancel the session, and its token; `None`: the test cancels it.
    enough: Option<(usize, CancellationToken)>,
}

type Shared = Arc<Mutex<Calls>>;

struct TrackerListener(Shared);

impl Listener for TrackerListener {
    fn bytes(&mut self, host_time_ns: u64, bytes: &[u8]) {
        self.0.lock().unwrap().bytes.push((host_time_ns, bytes.to_vec()));
    }

    fn record(&mut self, host_time_ns: u64, record: &Record) {
        let mut calls = self.0.lock().unwrap();
        calls.records.push((host_time_ns, *record));
        if let Some((count, cancel)) = &calls.enough
            && calls.records.len() >= *count
        {
            cancel.cancel();
        }
    }

    fn needle_record(&mut self, host_time_ns: u64, record: &Record) {
        self.0.lock().unwrap().needle.push((host_time_ns, *record));
    }

    fn event(&mut self, host_time_ns: u64, event: &TrackerEvent) {
        self.0.lock().unwrap().events.push((host_time_ns, event.clone()));
    }
}

/// Bytes of the recording that the settings name; `None` for other transports.
fn playback(settings: &Settings) -> Option<Box<dyn Playback>> {
    let Transport::Recording { path, .. } = &settings.transport else { return None };
    Some(Box::new(RecordingPlayback::open(path).unwrap()))
}

fn session(settings: &Settings) -> (Session, Shared, CancellationToken) {
    let (calls, cancel) = (Shared::default(), CancellationToken::new());
    let session =
        Session::new(settings, playback(settings), Box::new(TrackerListener(calls.clone())), cancel.clone()).unwrap();
    (session, calls, cancel)
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

fn names(calls: &Calls) -> Vec<&'static str> {
    calls.events.iter().map(|(_, event)| name(event)).collect()
}

fn name(event: &TrackerEvent) -> &'static str {
    match event {
        TrackerEvent::Connected { .. } => "connected",
        TrackerEvent::Disconnected { .. } => "disconnected",
        TrackerEvent::Silent { .. } => "silent",
        TrackerEvent::DecodeError(_) => "decode error",
        TrackerEvent::Damaged(_) => "damaged",
        TrackerEvent::OtherSensor { .. } => "other sensor",
        TrackerEvent::OnlyTool { .. } => "only tool",
        TrackerEvent::Undecided { .. } => "undecided",
        TrackerEvent::ProbeMissing { .. } => "probe missing",
        TrackerEvent::NeedleMissing { .. } => "needle missing",
        TrackerEvent::OtherSender { .. } => "other sender",
        TrackerEvent::SenderChanged { .. } => "sender changed",
        TrackerEvent::Irregular(_) => "irregular",
        TrackerEvent::Ended => "ended",
    }
}

#[tokio::test(start_paused = true)]
async fn a_steady_mock_delivers_records_at_its_times() {
    let (session, calls, cancel) = session(&mock("move 100"));
    let summary = run_for(session, cancel, Duration::from_millis(1005)).await;
    let calls = calls.lock().unwrap();
    assert_eq!(names(&calls), ["connected"]);
    assert_eq!((summary.records, calls.records.len(), summary.decode_errors), (101, 101, 0));
    let times: Vec<_> = calls.records.iter().map(|(time, _)| time - calls.records[0].0).collect();
    assert!(times.iter().enumerate().all(|(i, time)| *time == i as u64 * 10_000_000), "{times:?}");
    assert_eq!(summary.bytes, calls.bytes.iter().map(|(_, bytes)| bytes.len() as u64).sum::<u64>());
}

#[tokio::test(start_paused = true)]
async fn a_silent_mock_is_reported_and_recovers() {
    let (session, calls, cancel) = session(&mock("move 1, drop 7"));
    run_for(session, cancel, Duration::from_millis(8495)).await;
    let calls = calls.lock().unwrap();
    // A limit of 2 s, then twice as much: the second silence would be reported at 0.99 + 2 + 4 s.
    assert_eq!(names(&calls), ["connected", "silent", "silent"]);
    let silent: Vec<_> = calls.events[1..].iter().map(|(_, event)| event.clone()).collect();
    let silence = |(s, attempt)| TrackerEvent::Silent { for_: Duration::from_secs(s), attempt, cause: None };
    let expected = [(2, 1), (6, 2)].map(silence);
    assert_eq!(silent, expected);
    assert_eq!(calls.records.len(), 150);
    let gap = calls.records[100].1.sequence.unwrap() - calls.records[99].1.sequence.unwrap();
    assert_eq!(gap, 701, "the board's counter goes on");
}

#[tokio::test(start_paused = true)]
async fn an_unplugged_mock_is_reopened_until_it_returns() {
    let (session, calls, cancel) = session(&mock("move 1, unplug 3, corrupt 1"));
    let summary = run_for(session, cancel, Duration::from_millis(4900)).await;
    let calls = calls.lock().unwrap();
    // The port disappears at 1 s; reopening is tried at 1.25, 1.75, 2.75 and 4.75 s.
    assert_eq!(names(&calls)[..5], ["connected", "disconnected", "disconnected", "disconnected", "disconnected"]);
    assert_eq!(names(&calls)[5], "connected");
    let TrackerEvent::Disconnected { reason, retry } = &calls.events[4].1 else { panic!() };
    assert!(reason.contains("unplugged") && *retry == Duration::from_secs(2), "{reason}, {retry:?}");
    assert!(summary.decode_errors > 0 && calls.records.len() > 100, "{summary:?}");
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
            let (session, calls, cancel) = session(&settings);
            run_for(session, cancel, Duration::from_millis(milliseconds)).await;
            assert!(calls.lock().unwrap().records.is_empty());
        }
    }
}

/// A recording without any bytes.
struct Nothing;

impl Playback for Nothing {
    fn name(&self) -> String {
        "nothing".to_owned()
    }

    fn stream(&self) -> TrackerStream {
        TrackerStream::default()
    }

    fn next_message(&mut self) -> Result<Option<(u64, Vec<u8>)>, PlaybackError> {
        Ok(None)
    }

    fn rewind(&mut self) -> Result<(), PlaybackError> {
        Ok(())
    }
}

#[test]
fn recorded_bytes_are_not_played_in_place_of_a_device() {
    let listener = Box::new(TrackerListener(Shared::default()));
    let error = play(&mock("move 1"), Box::new(Nothing), listener, CancellationToken::new()).unwrap_err();
    assert!(matches!(error, TrackerError::NoRecording { transport: "mock" }), "{error}");
}

#[test]
fn impossible_settings_are_refused() {
    let listener = || Box::new(TrackerListener(Shared::default()));
    let settings = Settings { transport: Transport::Hid { device: None }, ..Settings::default() };
    let error = spawn(&settings, listener(), CancellationToken::new()).unwrap_err();
    assert_eq!(error.to_string(), "trackers that speak `ascii-line` aren't reached by transport `hid`");
    let path = "/nonexistent/a.mcap".into();
    let transport = Transport::Recording { path, speed: Speed::AtOnce, repeat: false };
    let settings = Settings { transport, ..Settings::default() };
    let error = spawn(&settings, listener(), CancellationToken::new()).unwrap_err();
    assert!(matches!(error, TrackerError::NoPlayback), "{error}");
    let error = recording::spawn(&settings, listener(), CancellationToken::new()).unwrap_err();
    assert!(error.to_string().contains("cannot read the recording /nonexistent/a.mcap"), "{error}");
}

#[tokio::test(start_paused = true)]
async fn a_device_with_normal_silence_is_not_restarted() {
    let (mut session, calls, cancel) = session(&mock("drop 86400"));
    session.silence = SilenceWatch::new(true);
    let summary = run_for(session, cancel, Duration::from_secs(3 * 3600)).await;
    assert_eq!((names(&calls.lock().unwrap()), summary.silences), (vec!["connected"], 0));
}
