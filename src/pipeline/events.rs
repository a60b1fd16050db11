//! Events of a session: logged, shown on the frames, and recorded.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::clock::{Clock, lock};
use crate::pose::Estimate;
use crate::settings::LiveSettings;

/// Time for which a notice stays on the frames.
const NOTICE_TIME: Duration = Duration::from_secs(5);

/// Observer of a session, called on the threads of its stages. It must not block, and must count dropped calls.
pub trait Observer: Send + Sync {
    /// An event at `unix_ns`, ns since 1970 (UTC).
    fn event(&self, unix_ns: u64, text: &str);

    /// A pose was estimated for a frame.
    fn pose(&self, unix_ns: u64, estimate: &Estimate);

    /// The settings from `unix_ns` on.
    fn settings(&self, unix_ns: u64, settings: &LiveSettings);
}

/// Destination of a session's events; clones share it.
#[derive(Clone)]
pub(super) struct Events {
    clock: Arc<dyn Clock>,
    observer: Option<Arc<dyn Observer>>,
    notice: Arc<Mutex<Option<(String, Duration)>>>,
}

impl Events {
    pub(super) fn new(clock: &Arc<dyn Clock>, observer: Option<Arc<dyn Observer>>) -> Self {
        Self { clock: clock.clone(), observer, notice: Arc::default() }
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

    pub(super) fn pose(&self, estimate: &Estimate) {
        if let Some(observer) = &self.observer {
            observer.pose(self.clock.unix_ns(), estimate);
        }
    }

    pub(super) fn settings(&self, settings: &LiveSettings) {
        if let Some(observer) = &self.observer {
            observer.settings(self.clock.unix_ns(), settings);
        }
    }

    /// Writes the current notice into `notice`. Allocates only for a new notice.
    pub(super) fn notice_into(&self, notice: &mut Option<String>) {
        let mut current = lock(&self.notice);
        if current.as_ref().is_some_and(|(_, until)| self.clock.now() >= *until) {
            *current = None;
        }
        match (&*current, notice) {
            (Some((text, _)), Some(notice)) => notice.clone_from(text),
            (current, notice) => *notice = current.as_ref().map(|(text, _)| text.clone()),
        }
    }
}
