//! Runs the generator beside the renderer.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::clock::{Clock, NEVER, lock};
use super::events::Events;
use super::frames::Pool;
use super::parts::{Enhancer, Terminator};
use super::rendered::Rendered;
use super::slot::{Slot, Taken};
use super::summary::GeneratorSummary;
use crate::pose::Pose;
use crate::sink::live::LiveSettings;

/// Generated frames: one held by the presenter, one in the slot, one to fill.
const FRAMES: usize = 4;

/// Failures in a row after which the generator rests, and for how long at first and at most.
const FAILURES: u32 = 3;
const REST: (Duration, Duration) = (Duration::from_secs(1), Duration::from_secs(60));

/// A run that goes on for so long after it was told to end won't.
const GIVE_UP: Duration = Duration::from_secs(1);

/// Weight of the latest run in the estimate of their time.
const WEIGHT: f64 = 0.2;

/// A generated picture.
#[derive(Debug)]
pub(super) struct Generated {
    /// Number of the frame that it translates.
    pub(super) number: u64,
    /// Pose of that frame.
    pub(super) pose: Option<Pose>,
    /// Its settings.
    pub(super) settings: LiveSettings,
    /// Its size.
    pub(super) size: (u32, u32),
    /// Grey levels [height × width].
    pub(super) image: Vec<u8>,
    /// Start and end of the run.
    pub(super) run: (Duration, Duration),
    /// Deadline of that frame.
    pub(super) deadline: Duration,
    /// Tier that made it.
    pub(super) tier: String,
}

/// How far the watch over one run has gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Hang {
    /// It is not too long yet.
    #[default]
    No,
    /// It was told to end, or should have been, at this time.
    Told(Duration),
    /// It does not end. Nobody waits for it any more; should it come back, the generator goes on.
    GivenUp,
}

/// What the presenter knows of the generator while it runs.
#[derive(Debug, Default)]
pub(super) struct GeneratorState {
    /// The frame at work, and since when.
    pub(super) busy: Option<(u64, Duration)>,
    /// Time that a run takes, by the last ones; zero before the first.
    pub(super) estimate: Duration,
    /// What came of the run at work being too long.
    hang: Hang,
    pub(super) counts: GeneratorSummary,
}

/// Shared by the stage and the presenter.
pub(super) struct GeneratorLink {
    pub(super) state: Mutex<GeneratorState>,
    terminator: Option<Terminator>,
    hang: Duration,
    /// Whether it takes no frames: after failures, or while no tier keeps the budget.
    rests: AtomicBool,
}

impl GeneratorLink {
    pub(super) fn new(enhancer: &dyn Enhancer, hang: Duration) -> Self {
        Self { state: Mutex::default(), terminator: enhancer.terminator(), hang, rests: AtomicBool::new(false) }
    }

    /// Whether frames need maps for it.
    pub(super) fn reads_maps(&self) -> bool {
        !self.rests.load(Ordering::Relaxed)
    }

    /// When the picture of frame `number`, which the generator was given, may be expected.
    pub(super) fn expected(&self, number: u64, now: Duration) -> Option<Duration> {
        // What rests makes nothing.
        if self.rests.load(Ordering::Relaxed) {
            return None;
        }
        let state = lock(&self.state);
        // A run that hangs says nothing about when the next one is done.
        if state.estimate.is_zero() || state.hang != Hang::No {
            return None;
        }
        match state.busy {
            Some((busy, started)) if busy == number => Some(now.max(started + state.estimate)),
            Some((busy, started)) if busy < number => Some(now.max(started + state.estimate) + state.estimate),
            Some(_) => None,
            None => Some(now + state.estimate),
        }
    }

    /// When the run at work is to be looked at again, if one is at work that was not given up.
    pub(super) fn hangs_at(&self) -> Option<Duration> {
        let state = lock(&self.state);
        let (_, started) = state.busy?;
        match state.hang {
            Hang::No => Some(started.saturating_add(self.hang)),
            Hang::Told(at) => Some(at.saturating_add(GIVE_UP)),
            Hang::GivenUp => None,
        }
    }

    /// Ends a run that takes too long, and gives up one that doesn't end. Returns what to say about it.
    pub(super) fn watch(&self, now: Duration) -> Option<String> {
        let mut state = lock(&self.state);
        let (number, started) = state.busy?;
        let after_s = now.saturating_sub(started).as_secs_f64();
        match state.hang {
            Hang::No if now >= started.saturating_add(self.hang) => {
                state.hang = Hang::Told(now);
                state.counts.hung += 1;
                drop(state);
                let did = match &self.terminator {
                    Some(terminate) => {
                        terminate();
                        "and is told to end"
                    }
                    None => "and its provider cannot end it",
                };
                Some(format!(
                    "the generator hangs on frame {number} for {after_s:.1} s {did}; rendered frames are shown"
                ))
            }
            Hang::Told(at) if now >= at.saturating_add(GIVE_UP) => {
                state.hang = Hang::GivenUp;
                state.counts.given_up += 1;
                Some(format!(
                    "the generator does not come back from frame {number} after {after_s:.1} s and is given up; rendered frames are shown"
                ))
            }
            _ => None,
        }
    }

    /// Ends the run at work, for the session's end.
    pub(super) fn terminate(&self) {
        if lock(&self.state).busy.is_some()
            && let Some(terminate) = &self.terminator
        {
            terminate();
        }
    }
}

/// What the stage is put together from.
pub(super) struct GenerateStage {
    pub(super) clock: Arc<dyn Clock>,
    pub(super) events: Events,
    pub(super) enhancer: Box<dyn Enhancer>,
    pub(super) link: Arc<GeneratorLink>,
    pub(super) from_renderer: Arc<Slot<Arc<Rendered>>>,
    pub(super) to_presenter: Arc<Slot<Arc<Generated>>>,
}

/// How the runs went lately.
struct Health {
    failures: u32,
    rest: Duration,
    resting_until: Duration,
}

impl GenerateStage {
    /// Translates the newest frame again and again until the slot is closed.
    pub(super) fn run(mut self) {
        let mut pool: Option<Pool<Generated>> = None;
        let mut health = Health { failures: 0, rest: REST.0, resting_until: Duration::ZERO };
        while let Taken::Item(rendered) = self.from_renderer.take(NEVER) {
            let rests = self.clock.now() < health.resting_until || !self.enhancer.ready();
            self.link.rests.store(rests, Ordering::Relaxed);
            // The first frames after a rest were rendered without the maps that it reads.
            if rests || !rendered.maps {
                lock(&self.link.state).counts.dropped += 1;
                continue;
            }
            let settings = rendered.settings;
            let pool = pool.get_or_insert_with(|| Pool::new(FRAMES, move || Generated::empty(settings)));
            self.translate(&rendered, pool, &mut health);
        }
        self.to_presenter.close();
    }

    fn translate(&mut self, rendered: &Arc<Rendered>, pool: &mut Pool<Generated>, health: &mut Health) {
        let _span = tracing::debug_span!("generate", number = rendered.number).entered();
        let started = self.clock.now();
        {
            let mut state = lock(&self.link.state);
            (state.busy, state.hang) = (Some((rendered.number, started)), Hang::No);
        }
        let filled = pool.fill(|generated| {
            let frame = rendered.frame.read().unwrap_or_else(PoisonError::into_inner);
            generated.image.clear();
            let result = self.enhancer.enhance(&frame, &mut generated.image).map_err(|e| e.to_string());
            let (found, expected) = (generated.image.len(), frame.bmode.len());
            if result.is_ok() && found != expected {
                return Err(format!("it gave {found} pixels for a frame of {expected}"));
            }
            generated.number = rendered.number;
            generated.pose = rendered.pose;
            generated.settings = rendered.settings;
            generated.size = (frame.width, frame.height);
            generated.deadline = rendered.deadline;
            generated.run = (started, self.clock.now());
            generated.tier.clear();
            generated.tier.push_str(self.enhancer.tier());
            result
        });
        let ended = self.clock.now();
        let mut state = lock(&self.link.state);
        state.busy = None;
        if std::mem::take(&mut state.hang) == Hang::GivenUp {
            let after_s = ended.saturating_sub(started).as_secs_f64();
            self.events.info(&format!("the generator that was given up is back after {after_s:.1} s"));
        }
        match filled {
            Some((generated, Ok(()))) => {
                let took = ended.saturating_sub(started);
                state.estimate = match state.estimate {
                    Duration::ZERO => took,
                    estimate => estimate.mul_f64(1.0 - WEIGHT) + took.mul_f64(WEIGHT),
                };
                state.counts.done += 1;
                state.counts.late += u64::from(ended > generated.deadline);
                drop(state);
                (health.failures, health.rest) = (0, REST.0);
                self.to_presenter.put(generated);
            }
            Some((_, Err(reason))) => {
                state.counts.failed += 1;
                drop(state);
                self.failed(&reason, health);
            }
            None => state.counts.dropped += 1,
        }
    }

    /// A run failed: after some in a row the generator rests, longer each time.
    fn failed(&self, reason: &str, health: &mut Health) {
        health.failures += 1;
        let tier = self.enhancer.tier();
        if health.failures < FAILURES {
            if health.failures == 1 {
                self.events.warn(format!("generator {tier} failed: {reason}; the rendered frame is shown"));
            }
            return;
        }
        let rest_s = health.rest.as_secs_f64();
        self.events.warn(format!(
            "generator {tier} failed {FAILURES} times in a row and rests for {rest_s:.0} s: {reason}; rendered frames are shown"
        ));
        health.resting_until = self.clock.now().saturating_add(health.rest);
        health.rest = (2 * health.rest).min(REST.1);
        health.failures = 0;
    }
}

impl Generated {
    fn empty(settings: LiveSettings) -> Self {
        Self {
            number: 0,
            pose: None,
            settings,
            size: (0, 0),
            image: Vec::new(),
            run: (Duration::ZERO, Duration::ZERO),
            deadline: Duration::ZERO,
            tier: String::new(),
        }
    }
}
