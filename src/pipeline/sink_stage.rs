//! Sink stages. Each sink has its own thread, so a slow or failing sink does not affect the others.

use std::io;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::clock::{Clock, NEVER, lock, ms};
use super::events::Events;
use super::metrics::{count, counted};
use super::shutdown::{Joined, Thread, spawn};
use super::slot::{Slot, Taken};
use super::summary::SinkSummary;
use crate::presented::PresentedFrame;
use crate::sink::live::LiveSink;

/// Number of consecutive failures after which a sink is closed.
const FAILURES: u32 = 5;

/// A running sink.
pub(super) struct SinkStage {
    name: String,
    slot: Arc<Slot<Arc<PresentedFrame>>>,
    counts: Arc<Counts>,
    thread: Thread<()>,
}

#[derive(Debug, Default)]
struct Counts {
    taken: AtomicU64,
    failed: AtomicU64,
    error: Mutex<Option<String>>,
}

impl SinkStage {
    /// Starts the sink's thread.
    ///
    /// # Errors
    /// The system cannot start another thread.
    pub(super) fn start(sink: Box<dyn LiveSink>, clock: &Arc<dyn Clock>, events: &Events) -> io::Result<Self> {
        let name = sink.name().to_owned();
        let slot = Arc::new(Slot::new(name.clone(), clock));
        let counts = Arc::<Counts>::default();
        let work = Work { clock: clock.clone(), slot: slot.clone(), counts: counts.clone(), events: events.clone() };
        let thread = spawn(clock, &name, move || work.run(sink))?;
        Ok(Self { name, slot, counts, thread })
    }

    /// Slot for the sink's frames.
    pub(super) fn slot(&self) -> &Arc<Slot<Arc<PresentedFrame>>> {
        &self.slot
    }

    /// Closes the slot; the sink finishes the frames it has.
    pub(super) fn close(&self) {
        self.slot.close();
    }

    /// Waits for the sink's end, until the time `until` at the latest.
    pub(super) fn join(self, until: Duration) -> SinkSummary {
        let Self { name, slot, counts, thread } = self;
        let joined = thread.join(until);
        // A frame left in the slot of an ended or stuck sink counts as dropped.
        slot.clear();
        let error = lock(&counts.error).take();
        let error = match &joined {
            Joined::Panicked => Some("it panicked".to_owned()),
            _ => error,
        };
        SinkSummary {
            name,
            offered: slot.offered(),
            taken: counted(&counts.taken),
            dropped: slot.dropped(),
            waited: 0,
            failed: counted(&counts.failed) + u64::from(matches!(joined, Joined::Panicked)),
            error,
            stuck: matches!(joined, Joined::Stuck),
        }
    }
}

struct Work {
    clock: Arc<dyn Clock>,
    slot: Arc<Slot<Arc<PresentedFrame>>>,
    counts: Arc<Counts>,
    events: Events,
}

impl Work {
    fn run(self, mut sink: Box<dyn LiveSink>) {
        let mut failures = 0;
        while let Taken::Item(frame) = self.slot.take(NEVER) {
            let _span = tracing::debug_span!(
                "sink",
                name = self.slot.name(),
                frame = frame.info.number,
                presented_ms = ms(frame.info.timeline.presented),
                taken_ms = ms(self.clock.now())
            )
            .entered();
            match sink.present(&frame) {
                Ok(()) => {
                    count(&self.counts.taken);
                    failures = 0;
                }
                Err(error) => {
                    count(&self.counts.failed);
                    failures += 1;
                    if failures == 1 {
                        self.events.warn(format!("{}: {error}", self.slot.name()));
                    }
                    if failures == FAILURES {
                        self.slot.close();
                        let text =
                            format!("{} failed {FAILURES} times in a row and is closed: {error}", self.slot.name());
                        *lock(&self.counts.error) = Some(text.clone());
                        self.events.warn(text);
                        break;
                    }
                }
            }
        }
        self.slot.close();
        self.slot.clear();
        if let Err(error) = sink.finish() {
            let text = format!("{} could not finish: {error}", self.slot.name());
            self.events.warn(text.clone());
            lock(&self.counts.error).get_or_insert(text);
        }
    }
}

impl Drop for Work {
    fn drop(&mut self) {
        // A sink that panicked takes no more frames.
        self.slot.close();
    }
}
