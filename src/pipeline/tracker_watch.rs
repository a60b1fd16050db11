//! What a session tells of its tracker while it runs: counts, news, and trouble that lasts.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use serde::Serialize;

use super::clock::lock;
use crate::tracker::TrackerEvent;

/// Most news that wait to be shown; the oldest are dropped, since the log has them all.
const NEWS_LIMIT: usize = 4;

/// Totals of a session's tracker.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct TrackerSummary {
    /// Records of the probe.
    pub records: u64,
    /// Pieces of the stream that are no record, and errors that the device reports.
    pub damaged: u64,
    /// Records of other sensors, and of several of which none was chosen.
    pub other_sensors: u64,
    /// Datagrams of other senders, as last reported.
    pub other_senders: u64,
    /// Interruptions: lost connections and silences.
    pub interruptions: u64,
    /// The last fault that was told, with its likely remedy.
    pub last_fault: Option<String>,
}

/// Text to show about a tracker.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum TrackerNotice {
    /// News, told once.
    News(String),
    /// Trouble that lasts, told again and again.
    Trouble(String),
}

/// State of a tracker that its listener updates and the session shows. Clones share it.
#[derive(Debug, Clone, Default)]
pub struct TrackerWatch(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    state: Mutex<State>,
    /// Whether there is trouble that the next record ends.
    troubled: AtomicBool,
}

#[derive(Debug, Default)]
struct State {
    totals: TrackerSummary,
    news: VecDeque<String>,
    trouble: Option<String>,
}

impl TrackerWatch {
    /// Counts a record of any sensor.
    pub(super) fn heard(&self) {
        lock(&self.0.state).totals.other_sensors += 1;
    }

    /// Counts a record of the probe, which was also counted as heard, and ends trouble.
    pub(super) fn record(&self) {
        let mut state = lock(&self.0.state);
        state.totals.records += 1;
        state.totals.other_sensors = state.totals.other_sensors.saturating_sub(1);
        if self.0.troubled.swap(false, Ordering::Relaxed) {
            state.trouble = None;
        }
    }

    /// Takes an event. Returns whether it is a fault that the user must see.
    pub(super) fn event(&self, event: &TrackerEvent) -> bool {
        let mut state = lock(&self.0.state);
        let totals = &mut state.totals;
        // Trouble lasts until the next record.
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
            TrackerEvent::OtherSensor { .. } | TrackerEvent::SenderChanged { .. } | TrackerEvent::Irregular(_) => false,
            // Connected, ended, or a choice that is only noted.
            _ => return false,
        };
        let text = format!("tracker: {event}");
        totals.last_fault = Some(event.to_string());
        if lasts {
            state.trouble = Some(text.clone());
            self.0.troubled.store(true, Ordering::Relaxed);
        }
        if state.news.len() == NEWS_LIMIT {
            state.news.pop_front();
        }
        state.news.push_back(text);
        true
    }

    /// The latest news, else the trouble that lasts.
    pub(super) fn notice(&self) -> Option<TrackerNotice> {
        let mut state = lock(&self.0.state);
        let news = state.news.drain(..).next_back();
        news.map(TrackerNotice::News).or_else(|| state.trouble.clone().map(TrackerNotice::Trouble))
    }

    /// Totals so far.
    pub fn totals(&self) -> TrackerSummary {
        lock(&self.0.state).totals.clone()
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
}
