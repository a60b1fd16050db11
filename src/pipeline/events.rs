//! Events of a session: logged, shown on the frames, and recorded.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::clock::{Clock, lock};
use crate::exam::needle::NeedleEvent;
use crate::needle::NeedleEstimate;
use crate::pose::Estimate;
use crate::settings::{Control, LiveSettings};

/// Time for which a notice stays on the frames.
const NOTICE_TIME: Duration = Duration::from_secs(5);

/// Number of the tip's latest events that viewers see.
const TIP_EVENTS: usize = 8;

/// Observer of a session, called on the threads of its stages. It must not block, and must count dropped calls.
pub trait Observer: Send + Sync {
    /// An event at `unix_ns`, ns since 1970 (UTC).
    fn event(&self, unix_ns: u64, text: &str);

    /// A pose of the probe was estimated for a frame.
    fn pose(&self, unix_ns: u64, estimate: &Estimate);

    /// A pose of the needle was estimated for the same frame. Called only in sessions with a needle.
    fn needle(&self, _unix_ns: u64, _estimate: &NeedleEstimate) {}

    /// An event of the needle's tip at `unix_ns`, ns since 1970 (UTC). Called only in sessions with a needle.
    fn tip(&self, _unix_ns: u64, _event: &NeedleEvent) {}

    /// Settings that apply from `unix_ns` on.
    fn settings(&self, unix_ns: u64, settings: &LiveSettings);

    /// A watcher set or removed marks ([`Control::Mark`], [`Control::Unmark`]) in a session that began at
    /// `start_unix_ns`, ns since 1970 (UTC).
    fn marks(&self, _unix_ns: u64, _start_unix_ns: u64, _control: &Control) {}
}

/// Destination of a session's events; clones share it.
#[derive(Clone)]
pub(super) struct Events {
    clock: Arc<dyn Clock>,
    observer: Option<Arc<dyn Observer>>,
    notice: Arc<Mutex<Option<(String, Duration)>>>,
    /// Fault that is shown until it ends, while no other notice is shown.
    lasting: Arc<Mutex<Option<String>>>,
    /// Latest events of the needle's tip, a line each, oldest first.
    tip: Arc<Mutex<Arc<[String]>>>,
}

impl Events {
    pub(super) fn new(clock: &Arc<dyn Clock>, observer: Option<Arc<dyn Observer>>) -> Self {
        Self { clock: clock.clone(), observer, notice: Arc::default(), lasting: Arc::default(), tip: Arc::default() }
    }

    /// Reports a fault: logs it, shows it on the frames for 5 s, and records it.
    pub(super) fn warn(&self, text: String) {
        tracing::warn!("{text}");
        self.record(&text);
        self.show(text);
    }

    /// Shows a text on the frames for 5 s, without logging and recording it.
    pub(super) fn show(&self, text: String) {
        *lock(&self.notice) = Some((text, self.clock.now().saturating_add(NOTICE_TIME)));
    }

    /// Shows a text as [`Self::show`] does, unless another notice is still within its 5 s.
    pub(super) fn show_if_free(&self, text: String) {
        let (mut notice, now) = (lock(&self.notice), self.clock.now());
        if notice.as_ref().is_none_or(|(shown, until)| now >= *until || *shown == text) {
            *notice = Some((text, now.saturating_add(NOTICE_TIME)));
        }
    }

    /// Reports a fault: logs it, records it, and shows it on the frames until [`Self::end_lasting`]. A newer notice
    /// hides it for 5 s.
    pub(super) fn warn_while_it_lasts(&self, text: String) {
        tracing::warn!("{text}");
        self.record(&text);
        *lock(&self.lasting) = Some(text);
    }

    /// Ends the fault that [`Self::warn_while_it_lasts`] reported.
    pub(super) fn end_lasting(&self) {
        *lock(&self.lasting) = None;
    }

    /// Reports a regular event: logs and records it.
    pub(super) fn info(&self, text: &str) {
        tracing::info!("{text}");
        self.record(text);
    }

    fn record(&self, text: &str) {
        if let Some(observer) = &self.observer {
            observer.event(self.clock.unix_ns(), text);
        }
    }

    /// Reports an event of the needle's tip: logs, records and lists it. The puncture of a forbidden surface is also
    /// shown on the frames for 5 s.
    pub(super) fn tip(&self, event: &NeedleEvent) {
        let text = format!("needle: {event}");
        if event.is_forbidden_puncture() {
            tracing::warn!("{text}");
            self.show(text);
        } else {
            tracing::info!("{text}");
        }
        if let Some(observer) = &self.observer {
            let since_start_ns = (event.time_s.max(0.0) * 1e9) as u64;
            observer.tip(self.clock.start_unix_ns().saturating_add(since_start_ns), event);
        }
        let mut tip = lock(&self.tip);
        let line = format!("{:.1} s: {event}", event.time_s);
        let kept = tip.len().saturating_sub(TIP_EVENTS - 1);
        *tip = tip.iter().skip(kept).cloned().chain([line]).collect();
    }

    /// Latest events of the needle's tip, a line each, oldest first.
    pub(super) fn tip_events(&self) -> Arc<[String]> {
        lock(&self.tip).clone()
    }

    /// Passes on the estimates of probe and needle for a frame.
    pub(super) fn poses(&self, estimate: &Estimate, needle: Option<&NeedleEstimate>) {
        if let Some(observer) = &self.observer {
            let unix_ns = self.clock.unix_ns();
            observer.pose(unix_ns, estimate);
            needle.into_iter().for_each(|needle| observer.needle(unix_ns, needle));
        }
    }

    pub(super) fn settings(&self, settings: &LiveSettings) {
        if let Some(observer) = &self.observer {
            observer.settings(self.clock.unix_ns(), settings);
        }
    }

    pub(super) fn marks(&self, control: &Control) {
        if let Some(observer) = &self.observer {
            observer.marks(self.clock.unix_ns(), self.clock.start_unix_ns(), control);
        }
    }

    /// Writes the current notice into `notice`. Allocates only for a new notice.
    pub(super) fn notice_into(&self, notice: &mut Option<String>) {
        let mut current = lock(&self.notice);
        if current.as_ref().is_some_and(|(_, until)| self.clock.now() >= *until) {
            *current = None;
        }
        let lasting = lock(&self.lasting);
        match (current.as_ref().map(|(text, _)| text).or(lasting.as_ref()), notice) {
            (Some(text), Some(notice)) => notice.clone_from(text),
            (text, notice) => *notice = text.cloned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::clock::Signal;
    use super::super::simulated::SimulatedClock;
    use super::*;

    #[test]
    fn a_repeated_text_leaves_newer_notices_their_time() {
        let clock: Arc<dyn Clock> = Arc::new(SimulatedClock::new());
        let (events, signal) = (Events::new(&clock, None), Signal::default());
        let shown_at = |s: u64| {
            clock.wait(&signal, signal.generation(), Duration::from_secs(s));
            let mut notice = None;
            events.notice_into(&mut notice);
            notice
        };
        events.show_if_free("silent".to_owned());
        assert_eq!(shown_at(4).as_deref(), Some("silent"));
        // The same text again stays for another 5 s.
        events.show_if_free("silent".to_owned());
        assert_eq!(shown_at(8).as_deref(), Some("silent"));
        events.show("saved".to_owned());
        events.show_if_free("silent".to_owned());
        assert_eq!(shown_at(12).as_deref(), Some("saved"));
        assert_eq!(shown_at(13), None);
        events.show_if_free("silent".to_owned());
        assert_eq!(shown_at(14).as_deref(), Some("silent"));
    }
}
