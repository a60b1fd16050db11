//! Statistics of a tracker session: rate, jitter, losses, state.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use insonify_core::pose::Reading;
use serde::Serialize;

use super::{Listener, Record, SensorName, TrackerEvent, counter_step};

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

insonify_core::names::named!(SessionState {
    Disconnected = "disconnected",
    Connected = "connected",
    Streaming = "streaming",
    Silent = "silent",
    Ended = "ended",
});

/// Statistics of a session since the last report, and totals.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TrackerReport {
    /// State of the tracker.
    pub state: SessionState,
    /// Number of records since the last report.
    pub records: u64,
    /// Records per second, from the arrival times of their first bytes; `None` without an interval between records.
    pub rate_hz: Option<f64>,
    /// Standard deviation of the interval between records, ms; `None` without an interval.
    pub jitter_ms: Option<f64>,
    /// Longest interval between two records, ms; `None` without an interval.
    pub longest_ms: Option<f64>,
    /// Total number of missing records, according to the device's counter.
    pub missing: u64,
    /// Total number of records whose counter did not rise.
    pub reversals: u64,
    /// Total number of decode errors.
    pub decode_errors: u64,
    /// Latest record; `None` before the first.
    pub last: Option<Record>,
    /// Sensors received, in the order of their first records, including sensors that are left out.
    pub sensors: Vec<SensorReport>,
    /// Events since the last report, as text.
    pub events: Vec<String>,
    /// Number of events dropped since the last report.
    pub events_dropped: u64,
}

impl TrackerReport {
    /// At most `most` of the events since the last report, then the number of further events, if any.
    pub fn news(&self, most: usize) -> impl Iterator<Item = String> + '_ {
        let more = self.events_dropped + self.events.len().saturating_sub(most) as u64;
        let more = (more > 0).then(|| format!("and {more} more"));
        self.events.iter().take(most).cloned().chain(more)
    }
}

/// Statistics of one sensor, either since the last report or over the whole session.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SensorReport {
    /// Number of the Polhemus station, NDI port handle or tool.
    pub sensor: u16,
    /// Name of the tool, if the protocol has names.
    pub name: Option<String>,
    /// Number of records.
    pub records: u64,
    /// Records per second; `None` for fewer than two records.
    pub rate_hz: Option<f64>,
    /// Whether the last record has a measurement: the sensor is in view, and the tracker marks it as valid.
    pub is_valid: bool,
    /// Position in the last record, mm; `None` without a pose.
    pub position_mm: Option<[f64; 3]>,
    /// Whether the sensor is the probe; for a whole session, whether it was the probe at any time.
    pub is_probe: bool,
    /// Whether the sensor was the needle in any record.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_needle: bool,
}

/// Collector of the statistics of one session. Its clones share the statistics.
#[derive(Debug, Clone, Default)]
pub struct Monitor(Arc<Mutex<Figures>>);

#[derive(Debug, Default)]
struct Figures {
    report: TrackerReport,
    events: VecDeque<String>,
    last_ns: Option<u64>,
    sequence: Option<u32>,
    /// Intervals since the last report: count, sum (s) and sum of squares (s²).
    intervals: (u32, f64, f64),
    longest_s: f64,
    sensors: Vec<SensorFigures>,
}

/// Number of records, and number and sum of the intervals between them.
#[derive(Debug, Clone, Copy, Default)]
struct Count {
    records: u64,
    intervals: u64,
    /// Sum of the intervals, s.
    seconds: f64,
}

#[derive(Debug)]
struct SensorFigures {
    name: SensorName,
    last_ns: Option<u64>,
    reading: Reading,
    /// Counts since the last report.
    recent: Count,
    /// Counts since the start of the session.
    total: Count,
    /// Whether the sensor was the probe in any record.
    was_probe: bool,
    /// Whether the sensor was the needle in any record.
    was_needle: bool,
}

impl SensorFigures {
    fn new(name: SensorName, reading: Reading) -> Self {
        let (recent, total) = (Count::default(), Count::default());
        Self { name, last_ns: None, reading, recent, total, was_probe: false, was_needle: false }
    }

    fn push(&mut self, host_time_ns: u64, reading: Reading) {
        let last_ns = self.last_ns.replace(host_time_ns);
        let interval_s = last_ns.map(|last_ns| host_time_ns.saturating_sub(last_ns) as f64 * 1e-9);
        for count in [&mut self.recent, &mut self.total] {
            count.records += 1;
            if let Some(seconds) = interval_s {
                count.intervals += 1;
                count.seconds += seconds;
            }
        }
        self.reading = reading;
    }

    /// Statistics from `count`, and the last reading.
    fn report(&self, count: Count, is_probe: bool) -> SensorReport {
        let Count { records, intervals, seconds } = count;
        let position_mm = match self.reading {
            Reading::Pose(pose) => Some(pose.position_mm.to_array()),
            _ => None,
        };
        SensorReport {
            sensor: self.name.number,
            name: self.name.name.clone(),
            records,
            rate_hz: (seconds > 0.0).then(|| intervals as f64 / seconds),
            is_valid: self.reading != Reading::OutOfView,
            position_mm,
            is_probe,
            is_needle: self.was_needle,
        }
    }
}

impl Monitor {
    /// Statistics since the last report.
    pub fn report(&self) -> TrackerReport {
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
        let probe = report.last.filter(|_| report.records > 0).map(|record| record.sensor);
        let recent = |sensor: &mut SensorFigures| {
            let count = std::mem::take(&mut sensor.recent);
            sensor.report(count, probe == Some(sensor.name.number))
        };
        report.sensors = figures.sensors.iter_mut().map(recent).collect();
        (figures.report.records, figures.report.events_dropped) = (0, 0);
        report
    }

    /// Statistics of each sensor since the start.
    pub fn totals(&self) -> Vec<SensorReport> {
        let figures = self.figures();
        figures.sensors.iter().map(|sensor| sensor.report(sensor.total, sensor.was_probe)).collect()
    }

    fn figures(&self) -> MutexGuard<'_, Figures> {
        // The statistics stay consistent even if another thread panicked.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Listener for Monitor {
    fn bytes(&mut self, _: u64, _: &[u8]) {}

    fn heard(&mut self, host_time_ns: u64, sensor: &SensorName, record: &Record) {
        let mut figures = self.figures();
        let at = figures.sensors.iter().position(|known| known.name == *sensor);
        let at = at.unwrap_or_else(|| {
            figures.sensors.push(SensorFigures::new(sensor.clone(), record.reading));
            figures.sensors.len() - 1
        });
        if let Some(known) = figures.sensors.get_mut(at) {
            known.push(host_time_ns, record.reading);
        }
    }

    fn record(&mut self, host_time_ns: u64, record: &Record) {
        let mut figures = self.figures();
        if let Some(last_ns) = figures.last_ns.replace(host_time_ns) {
            let seconds = host_time_ns.saturating_sub(last_ns) as f64 * 1e-9;
            let (count, sum, squares) = figures.intervals;
            figures.intervals = (count + 1, sum + seconds, squares + seconds * seconds);
            figures.longest_s = figures.longest_s.max(seconds);
        }
        if let Some(probe) = figures.sensors.iter_mut().find(|sensor| sensor.name.number == record.sensor) {
            probe.was_probe = true;
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

    fn needle_record(&mut self, _: u64, record: &Record) {
        let mut figures = self.figures();
        if let Some(needle) = figures.sensors.iter_mut().find(|sensor| sensor.name.number == record.sensor) {
            needle.was_needle = true;
        }
    }

    fn event(&mut self, _: u64, event: &TrackerEvent) {
        let mut figures = self.figures();
        let report = &mut figures.report;
        match event {
            TrackerEvent::Connected { .. } => report.state = SessionState::Connected,
            TrackerEvent::Disconnected { .. } => report.state = SessionState::Disconnected,
            TrackerEvent::Silent { .. } => report.state = SessionState::Silent,
            TrackerEvent::Ended => report.state = SessionState::Ended,
            // Decode errors are counted and reported by `Damaged`, not one by one.
            TrackerEvent::DecodeError(_) => {
                report.decode_errors += 1;
                return;
            }
            TrackerEvent::Damaged(_)
            | TrackerEvent::OtherSensor { .. }
            | TrackerEvent::OnlyTool { .. }
            | TrackerEvent::Undecided { .. }
            | TrackerEvent::ProbeMissing { .. }
            | TrackerEvent::NeedleMissing { .. }
            | TrackerEvent::OtherSender { .. }
            | TrackerEvent::SenderChanged { .. }
            | TrackerEvent::Irregular(_) => {}
        }
        if matches!(event, TrackerEvent::Disconnected { .. } | TrackerEvent::Ended) {
            // The interruption must not count as jitter of the device.
            (figures.last_ns, figures.sequence) = (None, None);
            figures.sensors.iter_mut().for_each(|sensor| sensor.last_ns = None);
        }
        if figures.events.len() == EVENT_CAPACITY {
            figures.events.pop_front();
            figures.report.events_dropped += 1;
        }
        figures.events.push_back(event.to_string());
    }
}

#[cfg(test)]
mod tests {
    use insonify_core::pose::Pose;

    use super::*;

    fn record(sequence: u32) -> Record {
        Record::pose(sequence, 0, Pose::from_components([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).unwrap())
    }

    #[test]
    fn rates_and_losses_are_counted() {
        let mut monitor = Monitor::default();
        assert_eq!(monitor.report(), TrackerReport::default());
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

    #[test]
    fn totals_of_each_sensor_go_on_over_the_reports() {
        let mut monitor = Monitor::default();
        let [stylus, probe] = [0, 1].map(|number| SensorName { number, name: None });
        for n in 0..100_u32 {
            let time_ns = u64::from(n) * 10_000_000;
            monitor.heard(time_ns, &stylus, &record(n));
            // The probe is in view for a while.
            if (40..60).contains(&n) {
                let of_probe = Record { sensor: 1, ..record(n) };
                monitor.heard(time_ns, &probe, &of_probe);
                monitor.record(time_ns, &of_probe);
            }
            if n % 25 == 24 {
                let sensors = monitor.report().sensors;
                assert_eq!(sensors[0].records, 25, "a report counts from the last one");
            }
        }
        assert!(!monitor.report().sensors[1].is_probe);
        let totals = monitor.totals();
        let [stylus, probe] = &totals[..] else { panic!("{totals:?}") };
        assert_eq!((stylus.records, stylus.is_probe, probe.records, probe.is_probe), (100, false, 20, true));
        for rate_hz in [stylus.rate_hz, probe.rate_hz] {
            assert!((rate_hz.unwrap() - 100.0).abs() < 1e-6, "{rate_hz:?}");
        }
    }
}
