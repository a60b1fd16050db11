//! Sessions with simulated devices behind a pipe.

use insonify_core::pose::Reading;
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};

use super::*;
use crate::tracker::transport::pipe::PipePort;
use crate::tracker::{DecodeError, Record};

#[path = "../../../../../../tests/tracking/trackers/polhemus.rs"]
#[allow(clippy::unwrap_used, clippy::panic, missing_docs, unreachable_pub, dead_code)]
mod polhemus;
use polhemus::{Kind, Polhemus};

/// Port to a simulated device; `play` runs the device's side of one connection.
pub(super) fn pipe<F: Future<Output = ()> + Send + 'static>(
    mut play: impl FnMut(DuplexStream) -> F + Send + 'static,
) -> Port {
    Port::Pipe(PipePort::new(Box::new(move || {
        let (host, far) = tokio::io::duplex(4096);
        tokio::spawn(play(far));
        Ok(host)
    })))
}

/// A device behind a pipe.
type Device = Arc<Mutex<Polhemus>>;

/// Runs the device's side of one connection until the host disconnects.
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
            // The host has disconnected; its earlier bytes must still be read.
            if stream.write_all(&record).await.is_err() {
                break;
            }
        }
    }
}

fn piped(device: &Device, protocol: Protocol, reset_delay: Duration) -> (Session, Shared, CancellationToken) {
    let mut settings = Settings { protocol, ..Settings::default() };
    settings.device.reset_delay = reset_delay;
    let (mut session, calls, cancel) = session(&settings);
    let (device, epoch) = (device.clone(), Instant::now());
    session.port = pipe(move |far| play(device.clone(), far, epoch));
    (session, calls, cancel)
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
        // An earlier program left the device streaming in another format.
        device.lock().unwrap().state.streaming = true;
        let (session, calls, cancel) = piped(&device, protocol, Duration::from_secs(20));
        run_for(session, cancel, Duration::from_secs(3)).await;
        sleep(Duration::from_millis(50)).await;
        assert!(!device.lock().unwrap().state.streaming, "it is told to stop");
        let (device, calls) = (device.lock().unwrap(), calls.lock().unwrap());
        assert_eq!((device.resets, device.refused.as_slice()), (0, [].as_slice()), "{protocol:?}");
        assert_eq!(device.state.hemisphere.as_deref(), Some("0,0,1"));
        assert!(device.state.station_on && device.state.centimetres);
        assert!(calls.records.len() > 200, "{protocol:?}: {} records, {:?}", calls.records.len(), names(&calls));
        let Reading::Pose(pose) = calls.records.last().unwrap().1.reading else { panic!() };
        assert!((pose.position_mm.y + 200.0).abs() < 1e-3 && (pose.position_mm.z - 300.0).abs() < 1e-3, "{pose:?}");
        assert!((pose.orientation * glam::DVec3::X).distance(glam::DVec3::Y) < 1e-3);
        assert!(!names(&calls).contains(&"silent"));
    }
}

#[tokio::test(start_paused = true)]
async fn a_hung_device_is_restarted_with_growing_force_until_its_reset() {
    for (kind, protocol) in POLHEMUS {
        let device = Device::new(Mutex::new(Polhemus::new(kind)));
        device.lock().unwrap().hung = true;
        let (session, calls, cancel) = piped(&device, protocol, Duration::from_secs(20));
        run_for(session, cancel, Duration::from_secs(60)).await;
        let (device, calls) = (device.lock().unwrap(), calls.lock().unwrap());
        // First the commands alone, then with a preceding carriage return, then with a reset on a reopened port.
        assert_eq!(names(&calls), ["connected", "silent", "silent", "disconnected", "connected"], "{protocol:?}");
        assert_eq!((device.resets, device.lost), (1, 0), "{protocol:?}");
        assert!(calls.records.len() > 1000, "{protocol:?}: {}", calls.records.len());
    }
}

#[tokio::test(start_paused = true)]
async fn commands_during_a_reset_are_lost() {
    let device = Device::new(Mutex::new(Polhemus::new(Kind::Liberty)));
    device.lock().unwrap().hung = true;
    // The driver expects a reset to take 5 s, but it takes 15 s.
    let (session, calls, cancel) = piped(&device, Protocol::Liberty, Duration::from_secs(5));
    run_for(session, cancel, Duration::from_secs(20)).await;
    assert!(device.lock().unwrap().lost > 0 && calls.lock().unwrap().records.is_empty());
}

#[tokio::test(start_paused = true)]
async fn another_sensor_is_ignored_and_reported_once() {
    let mut settings = Settings { protocol: Protocol::FastrakAscii, ..Settings::default() };
    settings.device.sensor = Some(1);
    let (mut session, calls, cancel) = session(&settings);
    session.port = pipe(|mut far| async move {
        for station in ['1', '2', '1', '2', '3', '1'] {
            let line = format!("0{station}   10.50 -20.25  30.12  90.00   0.00   0.00\r\n");
            far.write_all(line.as_bytes()).await.unwrap();
            sleep(Duration::from_millis(10)).await;
        }
        far.write_all(b"01   10.5").await.unwrap();
    });
    let summary = run_for(session, cancel, Duration::from_millis(200)).await;
    let calls = calls.lock().unwrap();
    assert_eq!((summary.records, summary.other_sensor), (3, 3));
    // The port is lost in the middle of a record.
    assert_eq!(names(&calls), ["connected", "other sensor", "other sensor", "decode error", "damaged", "disconnected"]);
    let [sensor, used] = [2, 1].map(|number| SensorName { number, name: None });
    assert_eq!(calls.events[1].1, TrackerEvent::OtherSensor { sensor, used: Some(used) });
    let text = format!("{:?}", calls.events[3].1);
    assert!(text.contains("Incomplete { length: 9 }"), "{text}");
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
    let (mut session, calls, cancel) = session(&Settings::default());
    session.driver = Box::<NeverAnswers>::default();
    // The far end stays open until the test's runtime ends.
    session.port = pipe(|far| async move {
        let _far = far;
        std::future::pending::<()>().await;
    });
    run_for(session, cancel, Duration::from_millis(21_200)).await;
    // First request at 3 s. The device counts as silent at the request at 8 s, then, after twice the limit, at 21 s.
    assert_eq!(names(&calls.lock().unwrap()), ["connected", "silent", "silent", "disconnected"]);
}
