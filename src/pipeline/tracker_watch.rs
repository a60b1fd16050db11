//! Tracker state that a session shows while it runs: counts, news, and lasting trouble.

use std::sync::{Arc, Mutex};

use serde::Serialize;

use super::clock::lock;
use crate::tracker::TrackerEvent;

/// Totals of a session's tracker.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct TrackerSummary {
    /// Number of records of the probe's sensor.
    pub records: u64,
    /// Number of damaged pieces of the stream, and of errors that the device reports.
    pub damaged: u64,
    /// Number of records of the needle's sensor.
    #[serde(skip_serializing_if = "is_zero")]
    pub needle_records: u64,
    /// Number of records of sensors other than the tools'. While several sensors send and none is chosen, all records
    /// count here.
    pub other_sensors: u64,
    /// Number of datagrams from other senders, as last reported.
    pub other_senders: u64,
    /// Number of interruptions: lost connections and silences.
    pub interruptions: u64,
    /// Last fault that was reported, with its likely remedy; none if there was no fault.
    pub last_fault: Option<String>,
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// Text to show about a tracker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum TrackerNotice {
    /// News, reported once.
    News(String),
    /// Trouble that lasts, reported repeatedly.
    Trouble(String),
}

/// State of a tracker that its listener updates and the session shows. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct TrackerWatch(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    totals: TrackerSummary,
    /// Latest news, until they are shown. Earlier news are not kept, because the log has them all.
    news: Option<String>,
    trouble: Option<Trouble>,
}

/// Trouble that lasts until the next record.
#[derive(Debug)]
struct Trouble {
    text: String,
    /// Whether the trouble is a lost connection. A new connection ends such trouble, because a device at rest may send
    /// no record.
    is_lost_connection: bool,
}

impl TrackerWatch {
    /// Counts a record of any sensor under `other_sensors`, until [`Self::record`] counts it for the probe, or
    /// [`Self::needle_record`] for the needle.
    pub(super) fn heard(&self) {
        lock(&self.0).totals.other_sensors += 1;
    }

    /// Counts a record of the probe's sensor, which [`Self::heard`] counted under `other_sensors`. Ends trouble.
    pub(super) fn record(&self) {
        let mut state = lock(&self.0);
        state.totals.records += 1;
        state.totals.other_sensors = state.totals.other_sensors.saturating_sub(1);
        state.trouble = None;
    }

    /// Counts a record of the needle's sensor, which [`Self::heard`] counted under `other_sensors`. Trouble of the probe
    /// goes on.
    pub(super) fn needle_record(&self) {
        let mut state = lock(&self.0);
        state.totals.needle_records += 1;
        state.totals.other_sensors = state.totals.other_sensors.saturating_sub(1);
    }

    /// Takes an event of the tracker. Returns whether it is a fault that the user must see.
    pub(super) fn event(&self, event: &TrackerEvent) -> bool {
        let mut state = lock(&self.0);
        let State { totals, news, trouble } = &mut *state;
        let lasts = match event {
            TrackerEvent::DecodeError(_) => {
                totals.damaged += 1;
                return false;
            }
            TrackerEvent::Disconnected { .. } | TrackerEvent::Silent { .. } => {
                totals.interruptions += 1;
                true
            }
            TrackerEvent::Undecided { .. } | TrackerEvent::ProbeMissing { .. } => true,
            TrackerEvent::Damaged(damage) => damage.records == 0,
            TrackerEvent::OtherSender { left_out, .. } => {
                totals.other_senders = *left_out;
                false
            }
            TrackerEvent::OtherSensor { .. }
            | TrackerEvent::NeedleMissing { .. }
            | TrackerEvent::SenderChanged { .. }
            | TrackerEvent::Irregular(_) => false,
            TrackerEvent::Connected { .. } => {
                if trouble.as_ref().is_some_and(|trouble| trouble.is_lost_connection) {
                    *trouble = None;
                }
                return false;
            }
            // Events that need no notice: the end of the tracker, or a choice of sensor.
            _ => return false,
        };
        let text = format!("tracker: {event}");
        totals.last_fault = Some(event.to_string());
        if lasts {
            let is_lost_connection = matches!(event, TrackerEvent::Disconnected { .. });
            *trouble = Some(Trouble { text: text.clone(), is_lost_connection });
        }
        *news = Some(text);
        true
    }

    /// The latest news, or else the trouble that lasts; `None` without either. News are returned only once.
    pub(super) fn notice(&self) -> Option<TrackerNotice> {
        let mut state = lock(&self.0);
        let news = state.news.take().map(TrackerNotice::News);
        news.or_else(|| state.trouble.as_ref().map(|trouble| TrackerNotice::Trouble(trouble.text.clone())))
    }

    /// Totals so far.
    pub fn totals(&self) -> TrackerSummary {
        lock(&self.0).totals.clone()
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn trouble_lasts_until_the_next_record_and_news_are_shown_once() {
        let watch = TrackerWatch::default();
        assert!(!watch.event(&TrackerEvent::Connected { port: "x".into() }));
        let silent = TrackerEvent::Silent { for_: Duration::from_secs(2), attempt: 1, cause: Some("why".into()) };
        assert!(watch.event(&silent));
        let Some(TrackerNotice::News(text)) = watch.notice() else { panic!() };
        assert!(text.starts_with("tracker: no record") && text.ends_with(": why"), "{text}");
        assert_eq!(watch.notice(), Some(TrackerNotice::Trouble(text)));
        watch.heard();
        watch.record();
        assert_eq!(watch.notice(), None);
        watch.heard();
        watch.heard();
        let [from, to] = [1, 2].map(|host| ([10, 0, 0, host], 5).into());
        assert!(watch.event(&TrackerEvent::SenderChanged { from, to }));
        assert!(watch.notice().is_some() && watch.notice().is_none());
        let TrackerSummary { records, other_sensors, interruptions, last_fault, .. } = watch.totals();
        assert_eq!((records, other_sensors, interruptions), (1, 2, 1));
        assert!(last_fault.unwrap().contains("10.0.0.2:5"));
    }

    #[test]
    fn records_of_the_needle_are_counted_and_end_no_trouble_of_the_probe() {
        let watch = TrackerWatch::default();
        assert!(watch.event(&TrackerEvent::Silent { for_: Duration::from_secs(2), attempt: 1, cause: None }));
        watch.heard();
        watch.needle_record();
        assert!(watch.notice().is_some() && watch.notice().is_some(), "the trouble stays");
        let TrackerSummary { records, needle_records, other_sensors, .. } = watch.totals();
        assert_eq!((records, needle_records, other_sensors), (0, 1, 0));
    }

    #[test]
    fn a_new_connection_ends_a_lost_one_and_no_other_trouble() {
        let watch = TrackerWatch::default();
        let connected = TrackerEvent::Connected { port: "x".into() };
        let lost = TrackerEvent::Disconnected { reason: "the cable is out".into(), retry: Duration::from_secs(1) };
        let is_troubled = || {
            let _news = watch.notice();
            watch.notice().is_some()
        };
        assert!(watch.event(&lost) && is_troubled());
        // A device at rest sends no record.
        assert!(!watch.event(&connected) && !is_troubled());
        // A restarted device that says nothing is as silent as before.
        assert!(watch.event(&TrackerEvent::Silent { for_: Duration::from_secs(2), attempt: 2, cause: None }));
        assert!(!watch.event(&connected) && is_troubled());
        assert_eq!(watch.totals().interruptions, 2);
    }

    #[test]
    fn only_the_latest_news_are_shown() {
        let watch = TrackerWatch::default();
        let [from, to] = [1, 2].map(|host| ([10, 0, 0, host], 5).into());
        assert!(watch.event(&TrackerEvent::SenderChanged { from: to, to: from }));
        assert!(watch.event(&TrackerEvent::SenderChanged { from, to }));
        let Some(TrackerNotice::News(text)) = watch.notice() else { panic!() };
        assert!(text.ends_with("datagrams of 10.0.0.2:5 are used from now on"), "{text}");
        assert_eq!(watch.notice(), None);
    }
}
