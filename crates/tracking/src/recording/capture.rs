//! Capture: a tracker's session, or a stream of its bytes, recorded while it runs.

use std::io::{self, ErrorKind, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use bytes::BytesMut;
use tokio::sync::oneshot::{self, error::TryRecvError};
use tokio_util::sync::CancellationToken;

use super::{RecorderHandle, event_of, spawn};
use crate::tracker::selection::{Selection, Verdict};
use crate::tracker::{
    Listener, Monitor, Protocol, Record, SensorName, SensorReport, SessionHandle, SessionSummary, Settings,
    TrackerError, TrackerEvent, TrackerReport, TrackerStream, Transport, host_time_ns,
};

/// Longest wait of a stream or a played recording for a slow disk. A live tracker never waits.
const PATIENCE: Duration = Duration::from_secs(10);

/// Largest number of bytes per read from a stream.
const PIECE: usize = 4096;

/// Source of tracker bytes and events that go into a recording.
pub struct Capture {
    tap: Tap,
    source: Source,
}

enum Source {
    Tracker(SessionHandle, CancellationToken),
    /// Receiver of the reason why the stream ended.
    Stream(oneshot::Receiver<String>),
}

impl Capture {
    /// Starts the session of `tracker`, or plays the recording that its settings name instead.
    ///
    /// # Errors
    /// The errors of [`spawn`].
    pub fn of_tracker(tracker: &Settings, recorder: RecorderHandle) -> Result<Self, TrackerError> {
        let waits = matches!(tracker.transport, Transport::Recording { .. });
        let tap = Tap::new(recorder, if waits { PATIENCE } else { Duration::ZERO });
        let cancel = CancellationToken::new();
        let session = spawn(tracker, Box::new(tap.clone()), cancel.clone())?;
        Ok(Self { tap, source: Source::Tracker(session, cancel) })
    }

    /// Reads bytes of `protocol` from `stream` on a separate thread. `sensor` and `needle` choose the tools. The thread
    /// is abandoned if the stream never ends.
    ///
    /// # Errors
    /// The thread can't be started.
    pub fn of_stream(
        stream: impl Read + Send + 'static,
        TrackerStream { protocol, sensor, needle }: TrackerStream,
        recorder: RecorderHandle,
    ) -> io::Result<Self> {
        let tap = Tap::new(recorder, PATIENCE);
        let (end, ended) = oneshot::channel();
        let reads = tap.clone();
        let read = move || {
            // The receiver is gone if the recording has already ended for another reason.
            let _ = end.send(reads.read(stream, protocol, Selection::new(sensor, needle)));
        };
        thread::Builder::new().name("tracker".to_owned()).spawn(read)?;
        Ok(Self { tap, source: Source::Stream(ended) })
    }

    /// Statistics since the last report.
    pub fn report(&self) -> TrackerReport {
        self.tap.monitor.report()
    }

    /// Number of bytes so far.
    pub fn bytes(&self) -> u64 {
        self.tap.bytes.load(Ordering::Relaxed)
    }

    /// Reason for the end of the source or of the recording; `None` while both continue.
    pub fn over(&mut self) -> Option<String> {
        if self.tap.recorder.failure().is_some() {
            return Some("the disk does not take it".to_owned());
        }
        match &mut self.source {
            Source::Tracker(session, _) => session.is_finished().then(|| "the tracker's session is over".to_owned()),
            Source::Stream(ended) => match ended.try_recv() {
                Ok(reason) => Some(reason),
                Err(TryRecvError::Empty) => None,
                Err(TryRecvError::Closed) => Some("the reader stopped".to_owned()),
            },
        }
    }

    /// Ends the capture. Returns the statistics since the last report, the statistics of each sensor since the start,
    /// and the totals of a tracker's session (`None` for a stream).
    pub fn end(self) -> (TrackerReport, Vec<SensorReport>, Option<SessionSummary>) {
        let summary = match self.source {
            Source::Tracker(session, cancel) => {
                cancel.cancel();
                Some(session.join())
            }
            Source::Stream(_) => None,
        };
        (self.tap.monitor.report(), self.tap.monitor.totals(), summary)
    }
}

/// Listener that records a tracker's bytes and counts its records.
#[derive(Clone)]
struct Tap {
    recorder: RecorderHandle,
    monitor: Monitor,
    bytes: Arc<AtomicU64>,
    /// Longest wait for the disk per received piece of bytes.
    patience: Duration,
}

impl Tap {
    fn new(recorder: RecorderHandle, patience: Duration) -> Self {
        Self { recorder, monitor: Monitor::default(), bytes: Arc::default(), patience }
    }

    /// Takes a record of any sensor.
    fn take(&mut self, now_ns: u64, mut record: Record, name: Option<&str>, selection: &mut Selection) {
        let before = selection.heard().len();
        let (verdict, at) = selection.judge(&mut record, name);
        if let Some(sensor) = at.and_then(|at| selection.heard().get(at)) {
            self.heard(now_ns, sensor, &record);
        }
        let is_new = selection.heard().len() > before;
        match verdict {
            Verdict::Probe => self.record(now_ns, &record),
            Verdict::Needle => self.needle_record(now_ns, &record),
            Verdict::Undecided if is_new => {
                self.event(now_ns, &TrackerEvent::Undecided { heard: selection.heard().to_vec() });
            }
            Verdict::Undecided | Verdict::Other => {}
        }
    }

    /// Reads a stream to its end. Returns the reason for the end.
    fn read(mut self, mut stream: impl Read, protocol: Protocol, mut selection: Selection) -> String {
        let (mut piece, mut decoder, mut buffer) = ([0; PIECE], protocol.decoder(), BytesMut::new());
        loop {
            match stream.read(&mut piece) {
                Ok(0) => return "the stream ended".to_owned(),
                Ok(read) => {
                    let now_ns = host_time_ns();
                    self.bytes(now_ns, &piece[..read]);
                    buffer.extend_from_slice(&piece[..read]);
                    loop {
                        match decoder.decode(&mut buffer) {
                            Ok(Some(record)) => {
                                self.take(now_ns, record, decoder.name_of(record.sensor), &mut selection)
                            }
                            Ok(None) => break,
                            Err(error) => self.event(now_ns, &TrackerEvent::DecodeError(error)),
                        }
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return format!("the stream broke: {error}"),
            }
        }
    }
}

impl Listener for Tap {
    fn bytes(&mut self, host_time_ns: u64, bytes: &[u8]) {
        self.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        self.recorder.raw_within(host_time_ns, bytes, self.patience);
    }

    fn heard(&mut self, host_time_ns: u64, sensor: &SensorName, record: &Record) {
        self.monitor.heard(host_time_ns, sensor, record);
    }

    fn record(&mut self, host_time_ns: u64, record: &Record) {
        self.monitor.record(host_time_ns, record);
    }

    fn needle_record(&mut self, host_time_ns: u64, record: &Record) {
        self.monitor.needle_record(host_time_ns, record);
    }

    fn event(&mut self, host_time_ns: u64, event: &TrackerEvent) {
        self.monitor.event(host_time_ns, event);
        if let Some(event) = event_of(host_time_ns, event) {
            self.recorder.event(event);
        }
    }
}
