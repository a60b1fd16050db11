//! A sensor that freezes: effects from its measurements to each display.

use std::io::Read;
use std::net::TcpStream;
use std::path::Path;

use futures_util::StreamExt;
use insonify::pipeline::{RecordingObserver, ReplayedPoses};
use insonify::pose::{Estimator, Measurement, Reading, Settings as PoseSettings};
use insonify::recording::{Entry, QueueLimits, Recorder, RecordingInfo, RecordingReader, RecordingWriter};
use insonify::sink::browser::{BrowserSink, SceneInfo, Settings as PageSettings};
use insonify::sink::openigtlink::{OpenIgtLink, Settings as IgtlSettings};
use insonify::tracker::Protocol;
use tokio_tungstenite::tungstenite::Message;

use super::*;

/// Time at which the sensor freezes: it repeats one reading until it moves again.
const FROZEN_AT: Duration = Duration::from_secs(3);
const MOVES_AGAIN: Duration = Duration::from_secs(8);
/// Default of `[filter] stuck_ms`.
const THRESHOLD: Duration = Duration::from_secs(2);

/// A tracker of 60 measurements a second that passes through the estimator of a live session.
struct Tracker(ReplayedPoses);

impl Tracker {
    fn new() -> Self {
        let measurement = |i: u64| {
            let time = Duration::from_micros(16_667 * i);
            let moved = if (FROZEN_AT..MOVES_AGAIN).contains(&time) { FROZEN_AT } else { time };
            let reading = Reading::Pose(pose(5.0 * moved.as_secs_f64()));
            let host_time_ns = START_NS + time.as_nanos() as u64;
            Measurement { host_time_ns, device_time_us: None, sequence: None, reading }
        };
        Self(ReplayedPoses::new(Estimator::new(PoseSettings::default()), (0..600).map(measurement).collect(), &[]))
    }
}

impl PoseSource for Tracker {
    fn sample(&mut self, now_ns: u64, _: u64) -> Estimate {
        self.0.at(now_ns)
    }
}

/// Runs the session; returns its frames, and their number for each tracking state.
fn session(observer: Option<Arc<dyn Observer>>) -> (Vec<PresentedFrame>, [u64; 5]) {
    let clock = clock();
    let frames = Arc::<Mutex<Vec<PresentedFrame>>>::default();
    let kept = frames.clone();
    let display = sink("display", move |frame| {
        kept.lock().unwrap().push(frame.clone());
        Ok(())
    });
    let session =
        Session { poses: Box::new(Tracker::new()), sinks: vec![display], observer, ..Session::new(&clock, resting) };
    let by_tracking = session.run().by_tracking;
    (Arc::into_inner(frames).unwrap().into_inner().unwrap(), by_tracking)
}

#[test]
fn presented_frames_say_stuck_within_a_second_of_the_threshold() {
    let _guard = beside_others();
    let (frames, by_tracking) = session(None);
    let stuck: Vec<Duration> = frames
        .iter()
        .filter(|frame| frame.info.estimate.state == TrackingState::Stuck)
        .map(|frame| frame.info.timeline.presented)
        .collect();
    let (first, last) = (stuck[0], stuck[stuck.len() - 1]);
    assert!(first >= FROZEN_AT + THRESHOLD && first <= FROZEN_AT + THRESHOLD + SECOND, "{first:?}");
    assert!(last >= MOVES_AGAIN && last <= MOVES_AGAIN + SECOND, "{last:?}");
    assert_eq!(by_tracking[TrackingState::Stuck as usize], stuck.len() as u64);
    let said = frames.iter().find(|frame| frame.notice.as_deref().is_some_and(|notice| notice.contains("stuck")));
    assert!(said.unwrap().info.timeline.presented <= first + SECOND);
    let picture = frames.iter().find(|frame| frame.info.timeline.presented == first).unwrap();
    assert!(picture.info.pose().is_some() && !picture.image.is_empty(), "the picture stays");
}

#[test]
fn page_and_openigtlink_clients_are_told_that_the_sensor_is_stuck() {
    let _guard = beside_others();
    let (frames, _) = session(None);
    let at = FROZEN_AT + THRESHOLD + SECOND;
    let frame = frames.iter().find(|frame| frame.info.timeline.presented >= at).unwrap();

    let header = page_header(frame);
    assert_eq!(header[40], TrackingState::Stuck as u8);
    let page = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/browser/wire.js")).unwrap();
    let names = TrackingState::ALL.map(|state| format!("\"{}\"", state.name())).join(", ");
    assert!(page.contains(&format!("TRACKING = [{names}]")), "the page reads the states in their order");

    let messages = openigtlink_messages(frame);
    let kinds: Vec<&str> = messages.iter().map(|(kind, _)| kind.as_str()).collect();
    assert_eq!(kinds, ["STATUS", "IMAGE"], "no transform of a pose that is not live");
    let status = &messages[0].1;
    assert_eq!((status[1], status[10..].starts_with(b"STUCK\0")), (13, true));
}

#[test]
fn the_recording_says_that_the_sensor_is_stuck() {
    let _guard = beside_others();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("session.mcap");
    let info = RecordingInfo {
        protocol: Protocol::AsciiLine,
        device: "test".to_owned(),
        scene: "none".to_owned(),
        start_time_ns: START_NS,
        sensor: None,
        needle: None,
    };
    let mut writer = RecordingWriter::create(&path, &info).unwrap();
    writer.raw(START_NS, b"\n").unwrap();
    let recorder = Recorder::start(writer, QueueLimits::default()).unwrap();
    session(Some(Arc::new(RecordingObserver(recorder.handle()))));
    assert!(recorder.finish().failure.is_none());

    let first = (FROZEN_AT + THRESHOLD).as_nanos() as u64;
    let limit = first..=first + 1_000_000_000;
    let (mut events, mut poses) = (Vec::new(), Vec::new());
    let mut reader = RecordingReader::open(&path).unwrap();
    while let Some(entry) = reader.next_entry().unwrap() {
        match entry {
            Entry::Event(event) if event.value.as_ref().is_some_and(|v| v.to_string().contains("stuck")) => {
                events.push(event.host_time_ns - START_NS);
            }
            Entry::Pose(pose) if pose.state == TrackingState::Stuck => poses.push(pose.host_time_ns - START_NS),
            _ => {}
        }
    }
    assert!(limit.contains(&events[0]) && limit.contains(&poses[0]), "{} {}", events[0], poses[0]);
}

/// Time after which a frame is presented again.
const AGAIN: Duration = Duration::from_millis(200);

/// The first message that a page receives for `frame`.
fn page_header(frame: &PresentedFrame) -> Vec<u8> {
    let scene = SceneInfo::default();
    let (sender, _controls) = tokio::sync::mpsc::channel(1);
    let mut page = BrowserSink::new(&PageSettings { port: 0, ..PageSettings::default() }, sender, &scene).unwrap();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    let bytes = runtime.block_on(async {
        let url = format!("ws://{}/stream", page.local_address());
        let (mut socket, _) = tokio_tungstenite::connect_async(url).await.unwrap();
        loop {
            // A page that is not listening yet misses a frame.
            page.present(frame).unwrap();
            while let Ok(message) = tokio::time::timeout(AGAIN, socket.next()).await {
                if let Message::Binary(bytes) = message.unwrap().unwrap() {
                    return bytes.to_vec();
                }
            }
        }
    });
    Box::new(page).finish().unwrap();
    bytes
}

/// The messages that an OpenIGTLink client receives for `frame`: type and body.
fn openigtlink_messages(frame: &PresentedFrame) -> Vec<(String, Vec<u8>)> {
    let mut server = OpenIgtLink::new(IgtlSettings { port: 0, ..IgtlSettings::default() }, Probe::default()).unwrap();
    let mut stream = TcpStream::connect(server.address()).unwrap();
    stream.set_read_timeout(Some(AGAIN)).unwrap();
    // A client that is not listening yet misses a frame.
    let presented = (0..100).find(|_| {
        server.present(frame).unwrap();
        stream.peek(&mut [0]).is_ok()
    });
    assert!(presented.is_some(), "the client got nothing");
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let mut messages = Vec::new();
    while messages.last().is_none_or(|(kind, _)| kind != "IMAGE") {
        let mut head = [0; 58];
        stream.read_exact(&mut head).unwrap();
        let kind = String::from_utf8_lossy(&head[2..14]).trim_end_matches('\0').to_owned();
        let mut body = vec![0; u64::from_be_bytes(head[42..50].try_into().unwrap()) as usize];
        stream.read_exact(&mut body).unwrap();
        messages.push((kind, body));
    }
    Box::new(server).finish().unwrap();
    messages
}
