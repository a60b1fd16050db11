//! Needle stage: follows the tip through the scene, on a thread of its own, and reports what it does.

use std::collections::BTreeMap;
use std::io;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use serde::Serialize;

use super::clock::{Clock, NEVER, lock};
use super::events::Events;
use super::shutdown::{Joined, Thread, spawn};
use super::slot::{Slot, Taken};
use crate::exam::needle::{GaussianSlice, NeedleEvent, NeedleEventKind, NeedleWatch, Sample};
use crate::transducer::Probe;

/// Summary of the needle's tip in a session.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct NeedleSummary {
    /// Number of frames with a known needle, whose poses were offered.
    pub offered: u64,
    /// Number of poses replaced by newer ones. The tip is then followed in a straight line across them.
    pub dropped: u64,
    /// Number of events of each kind.
    pub events: BTreeMap<&'static str, u64>,
    /// Number of punctures of forbidden surfaces.
    pub forbidden: u64,
}

impl NeedleSummary {
    fn count(&mut self, event: &NeedleEvent) {
        *self.events.entry(event.kind.name()).or_default() += 1;
        self.forbidden += u64::from(event.is_forbidden_puncture());
    }
}

/// Poses of both tools in a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct ToFollow {
    /// Poses of both tools at the frame's scene time.
    pub(super) sample: Sample,
    /// Probe of the frame.
    pub(super) probe: Probe,
}

/// The running stage.
pub(super) struct NeedleStage {
    slot: Arc<Slot<ToFollow>>,
    counts: Arc<Mutex<NeedleSummary>>,
    pub(super) thread: Thread<()>,
}

impl NeedleStage {
    /// Starts the stage's thread.
    ///
    /// # Errors
    /// The system cannot start another thread.
    pub(super) fn start(mut watch: NeedleWatch, clock: &Arc<dyn Clock>, events: &Events) -> io::Result<Self> {
        let slot = Arc::new(Slot::new("needle", clock));
        let counts = Arc::<Mutex<NeedleSummary>>::default();
        let (from_renderer, counted, reported) = (slot.clone(), counts.clone(), events.clone());
        let follow = move || {
            let mut found = Vec::new();
            while let Taken::Item(ToFollow { sample, probe }) = from_renderer.take(NEVER) {
                watch.advance(&sample, &probe, &GaussianSlice(probe), &mut found);
                for event in found.drain(..) {
                    lock(&counted).count(&event);
                    reported.tip(&event);
                }
            }
        };
        Ok(Self { thread: spawn(clock, "needle", follow)?, slot, counts })
    }

    /// Slot for the poses of frames.
    pub(super) fn slot(&self) -> &Arc<Slot<ToFollow>> {
        &self.slot
    }

    /// Waits for the stage to end, until the time `until` at the latest. It finishes the pose that it has.
    pub(super) fn join(self, until: Duration) -> (NeedleSummary, Joined<()>) {
        let Self { slot, counts, thread } = self;
        slot.close();
        let joined = thread.join(until);
        slot.clear();
        let counts = lock(&counts).clone();
        (NeedleSummary { offered: slot.offered(), dropped: slot.dropped(), ..counts }, joined)
    }
}

/// Counts of events, in words.
pub(super) fn in_words(summary: &NeedleSummary) -> String {
    let count = |kind: NeedleEventKind| summary.events.get(kind.name()).copied().unwrap_or_default();
    let entries = count(NeedleEventKind::Entered) + count(NeedleEventKind::ReEntered);
    format!(
        "surfaces entered {entries} times ({} forbidden), target reached {} times, out of the slice {} times",
        summary.forbidden,
        count(NeedleEventKind::TargetReached),
        count(NeedleEventKind::OutOfSlice)
    )
}
