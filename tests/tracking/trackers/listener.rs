//! Listener for tracker events on which a test can wait.

use std::sync::{Arc, Condvar, Mutex};
use std::time::Duration;

use insonify::tracker::{Listener, Record, SessionHandle, Settings, TrackerEvent, spawn};
use tokio_util::sync::CancellationToken;

/// Longest wait for an expected event; only failing tests reach it.
pub const LIMIT: Duration = Duration::from_secs(30);

#[derive(Debug, Default)]
pub struct Heard {
    pub bytes: Vec<u8>,
    pub records: Vec<(u64, Record)>,
    pub needle: Vec<(u64, Record)>,
    pub events: Vec<TrackerEvent>,
}

#[derive(Clone, Default)]
pub struct TrackerListener(Arc<(Mutex<Heard>, Condvar)>);

impl TrackerListener {
    fn change(&self, change: impl FnOnce(&mut Heard)) {
        change(&mut self.0.0.lock().unwrap());
        self.0.1.notify_all();
    }

    /// Waits until `done` returns a value, and returns that. `what` names it if the time is up.
    pub fn wait<T>(&self, what: &str, mut done: impl FnMut(&Heard) -> Option<T>) -> T {
        let heard = self.0.0.lock().unwrap();
        let (heard, timed_out) = self.0.1.wait_timeout_while(heard, LIMIT, |heard| done(heard).is_none()).unwrap();
        done(&heard).unwrap_or_else(|| {
            let count = heard.records.len();
            panic!("waited for {what} ({timed_out:?}); {count} records, events {:?}", heard.events)
        })
    }

    /// Waits for `count` more records and returns the last of them.
    pub fn more_records(&self, count: usize) -> Record {
        let before = self.0.0.lock().unwrap().records.len();
        self.wait("records", |heard| heard.records.get(before + count - 1).map(|(_, record)| *record))
    }

    /// Waits for event number `n`, from 1, of those that `kind` accepts.
    pub fn nth_event(&self, n: usize, kind: impl Fn(&TrackerEvent) -> bool) -> TrackerEvent {
        self.wait("an event", |heard| heard.events.iter().filter(|event| kind(event)).nth(n - 1).cloned())
    }
}

impl Listener for TrackerListener {
    fn bytes(&mut self, _: u64, bytes: &[u8]) {
        self.change(|heard| heard.bytes.extend(bytes));
    }

    fn record(&mut self, host_time_ns: u64, record: &Record) {
        self.change(|heard| heard.records.push((host_time_ns, *record)));
    }

    fn needle_record(&mut self, host_time_ns: u64, record: &Record) {
        self.change(|heard| heard.needle.push((host_time_ns, *record)));
    }

    fn event(&mut self, _: u64, event: &TrackerEvent) {
        self.change(|heard| heard.events.push(event.clone()));
    }
}

/// A tracker session that ends with its test.
pub struct Live {
    pub listener: TrackerListener,
    cancel: CancellationToken,
    session: Option<SessionHandle>,
}

impl Live {
    pub fn start(settings: &Settings) -> Self {
        let (listener, cancel) = (TrackerListener::default(), CancellationToken::new());
        let session = spawn(settings, Box::new(listener.clone()), cancel.clone()).unwrap();
        Self { listener, cancel, session: Some(session) }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.cancel.cancel();
        if let Some(session) = self.session.take() {
            session.join();
        }
    }
}

pub fn connected(event: &TrackerEvent) -> bool {
    matches!(event, TrackerEvent::Connected { .. })
}

pub fn disconnected(event: &TrackerEvent) -> bool {
    matches!(event, TrackerEvent::Disconnected { .. })
}

pub fn decode_error(event: &TrackerEvent) -> bool {
    matches!(event, TrackerEvent::DecodeError(_))
}
