//! Statistics of a tracker session: rate, jitter, losses, state.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::{Listener, Record, TrackerEvent, counter_step};

/// Capacity of the queue of unreported events; the oldest are dropped and counted.
const EVENT_CAPACITY: usize = 32;

/// State of a tracker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SessionState {
    /// The port isn't open.
    #[default]
    Disconnected,
    /// The port is open; no record has arrived yet.
    Connected,
    /// Records arrive.
    Streaming,
    /// Records are overdue.
    Silent,
    /// The recording ended.
    Ended,
}

crate::names::named!(SessionState {
    Disconnected = "disconnected",
    Connected = "connected",
    Streaming = "streaming",
    Silent = "silent",
    Ended = "ended",
});

/// Statistics since the last report, and totals.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Report {
    /// State of the tracker.
    pub state: SessionState,
    /// Records since the last report.
    pub records: u64,
    /// Record rate by the arrival of first bytes, Hz; `None` for fewer than two records.
    pub rate_hz: Option<f64>,
    /// Standard deviation of the interval between records, ms.
    pub jitter_ms: Option<f64>,
    /// Longest interval between two records, ms.
    pub longest_ms: Option<f64>,
    /// Total number of records missing by the device's counter.
    pub missing: u64,
    /// Total number of records whose counter does not rise.
    pub reversals: u64,
    /// Total number of decode errors.
    pub decode_errors: u64,
    /// Latest record.
    pub last: Option<Record>,
    /// Events since the last report, as text.
    pub events: Vec<String>,
    /// Events dropped since the last report.
    pub events_dropped: u64,
}

impl Report {
    /// At most `most` events since the last report, and the number of further ones if there are any.
    pub fn news(&self, most: usize) -> impl Iterator<Item = String> + '_ {
        let more = self.events_dropped + self.events.len().saturating_sub(most) as u64;
        let more = (more > 0).then(|| format!("and {more} more"));
        self.events.iter().take(most).cloned().chain(more)
    }
}

/// Collects the statistics of one session. Clones share them.
#[derive(Debug, Clone, Default)]
pub struct Monitor(Arc<Mutex<Figures>>);

#[derive(Debug, Default)]
struct Figures {
    report: Report,
    events: VecDeque<String>,
    last_ns: Option<u64>,
    sequence: Option<u32>,
    /// Intervals since the last report: count, sum (s) and sum of squares (s²).
    intervals: (u32, f64, f64),
    longest_s: f64,
}

impl Monitor {
    /// Statistics since the last report.
    pub fn report(&self) -> Report {
        let mut figures = self.figures();
        let (count, sum, squares) = std::mem::take(&mut figures.intervals);
        let longest_s = std::mem::take(&mut figures.longest_s);
        let mut report = figures.report.clone();
        if count > 0 {
            let mean = sum / f64::from(count);
            report.rate_hz = (mean > 0.0).then(|| 1.0 / mean);
            report.jitter_ms = Some((squares / f64::from(count) - mean * mean).max(0.0).sqrt() * 1e3);
            report.longest_ms = Some(longest_s * 1e3);
        }
        report.events = figures.events.drain(..).collect();
        (figures.report.records, figures.report.events_dropped) = (0, 0);
        report
    }

    fn figures(&self) -> MutexGuard<'_, Figures> {
        // The statistics stay consistent even if another thread panicked.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Listener for Monitor {
    fn bytes(&mut self, _: u64, _: &[u8]) {}

    fn record(&mut self, host_time_ns: u64, record: &Record) {
        let mut figures = self.figures();
        if let Some(last_ns) = figures.last_ns.replace(host_time_ns) {
            let seconds = host_time_ns.saturating_sub(last_ns) as f64 * 1e-9;
            let (count, sum, squares) = figures.intervals;
            figures.intervals = (count + 1, sum + seconds, squares + seconds * seconds);
            figures.longest_s = figures.longest_s.max(seconds);
        }
        let last = std::mem::replace(&mut figures.sequence, record.sequence);
        let report = &mut figures.report;
        let (missing, reversed) = counter_step(last, record.sequence);
        report.missing += missing;
        report.reversals += u64::from(reversed);
        report.records += 1;
        report.last = Some(*record);
        report.state = SessionState::Streaming;
    }

    fn event(&mut self, _: u64, event: &TrackerEvent) {
        let mut figures = self.figures();
        let report = &mut figures.report;
        match event {
            TrackerEvent::Connected { .. } => report.state = SessionState::Connected,
            TrackerEvent::Disconnected { .. } => report.state = SessionState::Disconnected,
            TrackerEvent::Silent { .. } => report.state = SessionState::Silent,
            TrackerEvent::Ended => report.state = SessionState::Ended,
            TrackerEvent::DecodeError(_) => report.decode_errors += 1,
            TrackerEvent::OtherSensor { .. } => {}
        }
        if matches!(event, TrackerEvent::Disconnected { .. } | TrackerEvent::Ended) {
            // The interruption is not jitter of the device.
            (figures.last_ns, figures.sequence) = (None, None);
        }
        if figures.events.len() == EVENT_CAPACITY {
            figures.events.pop_front();
            figures.report.events_dropped += 1;
        }
        figures.events.push_back(event.to_string());
    }
}

impl std::fmt::Display for TrackerEvent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let seconds = |time: &Duration| time.as_secs_f64();
        match self {
            Self::Connected { port } => write!(f, "connected to {port}"),
            Self::Disconnected { reason, retry } => write!(f, "{reason}; trying again in {:.2} s", seconds(retry)),
            Self::Silent { for_, attempt } => {
                write!(f, "no record for {:.1} s (attempt {attempt} to wake the tracker)", seconds(for_))
            }
            Self::DecodeError(error) => write!(f, "{error}"),
            Self::OtherSensor { sensor, used } => {
                write!(f, "sensor {sensor} also sends records, which are ignored; sensor {used} is the probe")
            }
            Self::Ended => write!(f, "the recording is at its end"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Pose;

    fn record(sequence: u32) -> Record {
        Record::pose(sequence, 0, Pose::from_components([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).unwrap())
    }

    #[test]
    fn rates_and_losses_are_counted() {
        let mut monitor = Monitor::default();
        assert_eq!(monitor.report(), Report::default());
        monitor.event(0, &TrackerEvent::Connected { port: "x".into() });
        // Intervals of 10, 30, 10 and 30 ms.
        for (time_ms, sequence) in [(0, 1), (10, 2), (40, 5), (50, 6), (80, 6)] {
            monitor.record(time_ms * 1_000_000, &record(sequence));
        }
        let report = monitor.report();
        assert_eq!(
            (report.state, report.records, report.missing, report.reversals),
            (SessionState::Streaming, 5, 2, 1)
        );
        assert!((report.rate_hz.unwrap() - 50.0).abs() < 1e-9);
        assert!((report.jitter_ms.unwrap() - 10.0).abs() < 1e-6 && (report.longest_ms.unwrap() - 30.0).abs() < 1e-9);
        assert_eq!(report.events, ["connected to x"]);
        let next = monitor.report();
        assert_eq!((next.records, next.rate_hz, next.missing), (0, None, 2));
        for _ in 0..40 {
            monitor.event(0, &TrackerEvent::Ended);
        }
        let report = monitor.report();
        assert_eq!((report.events.len(), report.events_dropped, report.state), (32, 8, SessionState::Ended));
    }
}
