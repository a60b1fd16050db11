//! Operating points of a live session, and the controller that chooses among them.
//!
//! A point is a frame's quality and a generator on top of it. Its error is known from a table, its time is measured at the
//! start. During the session the controller follows the ratios of present times to these, for frames and for runs, and predicts
//! the time of every other point from them.

mod change;
mod manual;
mod overrun;
mod predict;
mod reason;
mod recent;
mod speed;
mod summary;
#[cfg(test)]
mod tests;

pub use summary::{PointSummary, Switch};

use self::predict::START_SPREAD_MAX;
use self::recent::Recent;
use self::speed::SpeedWatch;
use crate::pose::{BySpeed, ProbeSpeed};
use crate::render::FrameQuality;

/// Most recent frames that show a sudden load, and the least number of them that decides.
const SUDDEN: (usize, usize) = (12, 8);
/// Most recent frames whose 95th percentile must keep the budget, and the least number of them that decides.
const SETTLED: (usize, usize) = (96, 40);
/// Part of the budget that a point may be predicted to take when it is chosen.
const ROOM: f64 = 0.92;
/// Time for which a better point must fit before it is chosen, s.
const RISE_S: f64 = 6.0;
/// Time after a change in which frames are ignored, s: buffers are rebuilt.
const REST_S: f64 = 1.0;
/// First and longest time for which a point that failed is not chosen again, s; it doubles each time.
const RETRY_S: [f64; 2] = [60.0, 3840.0];
/// Changes within [`MINUTE_S`] after which a better point waits.
const CHANGES: usize = 2;
const MINUTE_S: f64 = 60.0;

/// A way to make a frame, with its error and its times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Rendering.
    pub quality: FrameQuality,
    /// Index of the generator on top; none: the rendered picture.
    pub generator: Option<usize>,
    /// Error against the converged reference by speed of the probe, grey levels.
    pub error: BySpeed,
    /// Median time of a rendered frame, ms; 0 if it is not known.
    pub render_ms: f64,
    /// Median time of a run of the generator, ms; 0 without one.
    pub run_ms: f64,
}

/// Time that a frame may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameBudget {
    /// Time for rendering and generating a frame, ms; none: only runs are limited.
    pub frame_ms: Option<f64>,
    /// Time of a run, ms.
    pub run_ms: f64,
    /// Whether frames and runs take different hardware, so that the longer of both counts.
    pub apart: bool,
    /// 95th percentile of times over their median, as measured at the start.
    pub spread: f64,
}

/// Loads: ratios of present times to the times measured at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Load {
    render: f64,
    run: f64,
}

impl Load {
    /// Load when the times were measured.
    const START: Self = Self { render: 1.0, run: 1.0 };
}

/// A change of the operating point.
#[derive(Debug, Clone, PartialEq)]
pub struct PointChange {
    /// The point before.
    pub from: Candidate,
    /// The point from now on.
    pub to: Candidate,
    /// Why, as text.
    pub reason: String,
}

/// Chooses the operating point of a session.
#[derive(Debug, Clone)]
pub struct PointController {
    candidates: Vec<Candidate>,
    /// Indices of the candidates by rising error, for each speed of the probe.
    orders: [Vec<usize>; 3],
    /// Speed of the probe, and when it last changed, s.
    watch: SpeedWatch,
    moved_s: f64,
    /// Names of the generators.
    generators: Vec<String>,
    budget: FrameBudget,
    current: usize,
    /// Name of the point at the start.
    begun: String,
    /// Why that point has a generator or none; `None` without generators.
    generator_reason: Option<String>,
    /// Whether watchers want generated pictures, and whether they have just asked for them again.
    generate: bool,
    asked: bool,
    /// Whether a watcher set the quality.
    by_hand: bool,
    /// Times of frames at this point, ms, with their runs; of runs alone if only those are limited.
    busy: Recent,
    /// Loads of the frames and runs at this point.
    renders: Recent,
    runs: Recent,
    /// Last known quotient of run load and frame load, and its time, s.
    run_over_render: (f64, f64),
    /// Rendering time of the last frame, ms; the time of its run is added to it.
    rendered_ms: f64,
    frames_without_run: u32,
    /// Time from which on a better point would fit, s.
    fits_since: Option<f64>,
    /// Time from which on the 95th percentile is over the budget, s.
    often_since: Option<f64>,
    /// Frames before this time are ignored, s.
    rests_until: f64,
    /// Time of the last frame, s.
    last_s: f64,
    /// Time at which this point was reached from a worse one, s.
    raised_at: Option<f64>,
    /// Time until which each point isn't chosen, s, and how long after its next failure.
    blocked_until: Vec<f64>,
    retry_s: Vec<f64>,
    /// Failures in a row of each generator, and the last reason.
    failures: Vec<(u32, String)>,
    /// Times of the latest changes that count, s, and of the latest at all.
    changes: [f64; CHANGES],
    changed_s: f64,
    /// The point before the last change.
    before: usize,
    /// Whether the last change was to a cheaper point.
    fell: bool,
    /// Whether the warning that no point keeps the budget is active, and when it was given, s.
    warned: bool,
    warned_s: f64,
    switches: Vec<Switch>,
    counts: summary::Counts,
}

impl PointController {
    /// A controller of `candidates`, which starts at the best that is predicted to keep the budget, else at the cheapest.
    /// None without candidates. `generators` are the names that candidates refer to.
    pub fn new(mut candidates: Vec<Candidate>, generators: Vec<String>, budget: FrameBudget) -> Option<Self> {
        let is_finite = |error: BySpeed| ProbeSpeed::ALL.iter().all(|speed| error.at(*speed).is_finite());
        candidates.retain(|candidate| is_finite(candidate.error) && candidate.render_ms.is_finite());
        let spread = if budget.spread.is_finite() { budget.spread.clamp(1.0, START_SPREAD_MAX) } else { 1.0 };
        let count = candidates.len();
        let mut controller = Self {
            failures: vec![(0, String::new()); generators.len()],
            candidates,
            orders: Default::default(),
            watch: SpeedWatch::default(),
            moved_s: f64::NEG_INFINITY,
            generators,
            budget: FrameBudget { spread, ..budget },
            current: 0,
            begun: String::new(),
            generator_reason: None,
            generate: true,
            asked: false,
            by_hand: false,
            busy: Recent::new(),
            renders: Recent::new(),
            runs: Recent::new(),
            run_over_render: (1.0, 0.0),
            rendered_ms: 0.0,
            frames_without_run: 0,
            fits_since: None,
            often_since: None,
            rests_until: f64::NEG_INFINITY,
            last_s: f64::NEG_INFINITY,
            raised_at: None,
            blocked_until: vec![f64::NEG_INFINITY; count],
            retry_s: vec![RETRY_S[0]; count],
            changes: [f64::NEG_INFINITY; CHANGES],
            changed_s: f64::NEG_INFINITY,
            before: 0,
            fell: false,
            warned: false,
            warned_s: f64::NEG_INFINITY,
            switches: Vec::new(),
            counts: summary::Counts::default(),
        };
        controller.sort();
        let first = controller.best(f64::NEG_INFINITY, Load::START, controller.budget.spread, ROOM);
        let least = || controller.least(f64::NEG_INFINITY, Load::START, f64::INFINITY);
        controller.current = first.or_else(least)?;
        controller.before = controller.current;
        controller.begun = controller.name(&controller.point());
        controller.generator_reason = controller.reason_now();
        Some(controller)
    }

    /// The point of the next frames.
    pub fn point(&self) -> Candidate {
        self.candidates[self.current]
    }

    /// Name of a point.
    pub fn name(&self, point: &Candidate) -> String {
        match point.generator.and_then(|index| self.generators.get(index)) {
            Some(generator) => format!("{} + {generator}", point.quality),
            None => point.quality.to_string(),
        }
    }

    /// Time that a frame may take, or a run where frames aren't limited, ms.
    pub fn limit_ms(&self) -> f64 {
        self.budget.frame_ms.unwrap_or(self.budget.run_ms)
    }

    /// Whether the quality is chosen, not only the generator.
    pub fn chooses_quality(&self) -> bool {
        self.budget.frame_ms.is_some()
    }

    /// Time of a frame of the point as measured at the start, ms.
    pub fn expected_ms(&self, point: &Candidate) -> f64 {
        self.busy_ms(point, Load::START)
    }

    /// Whether the point was measured to keep the budget, with its spread.
    pub fn is_expected_to_fit(&self, point: &Candidate) -> bool {
        self.budget.spread * self.expected_ms(point) <= self.limit_ms()
    }

    /// Records that a frame of `quality` took `ms` and was done at `now_s`. Ignores frames of another quality, frames
    /// during a rest, and times that are no duration.
    pub fn rendered(&mut self, now_s: f64, quality: FrameQuality, ms: f64) {
        let point = self.point();
        if quality != point.quality || now_s < self.rests_until || !ms.is_finite() || ms < 0.0 {
            return;
        }
        if now_s - self.last_s > REST_S + 2e-3 * ms {
            // A pause in rendering is no measure of times.
            self.forget();
        }
        self.last_s = now_s;
        self.rendered_ms = ms;
        // Without a time to compare with, frames say nothing about runs.
        self.renders.push(if point.render_ms > 0.0 { ms / point.render_ms } else { 1.0 });
        if point.generator.is_some() {
            self.frames_without_run += 1;
        } else {
            self.busy.push(self.busy_of(ms, 0.0));
        }
        let since = |holds: bool, since: Option<f64>| if holds { since.or(Some(now_s)) } else { None };
        self.fits_since = since(self.better(now_s).is_some(), self.fits_since);
        let p95_ms = self.busy.percentile(0.95, SETTLED.0, SETTLED.1);
        self.often_since = since(p95_ms.is_some_and(|ms| ms > self.limit_ms()), self.often_since);
    }

    /// Records a run of a generator that gave a picture after `ms`.
    pub fn ran(&mut self, now_s: f64, generator: usize, ms: f64) {
        if let Some((failures, _)) = self.failures.get_mut(generator) {
            *failures = 0;
        }
        self.terminated(now_s, generator, ms);
    }

    /// Records a run of a generator that was terminated after `ms`.
    pub fn terminated(&mut self, now_s: f64, generator: usize, ms: f64) {
        let point = self.point();
        if point.generator != Some(generator) || now_s < self.rests_until || !ms.is_finite() || ms < 0.0 {
            return;
        }
        self.frames_without_run = 0;
        self.runs.push(ms / point.run_ms.max(1e-3));
        self.busy.push(self.busy_of(self.rendered_ms, ms));
    }

    /// Records that a run of a generator failed.
    pub fn failed(&mut self, generator: usize, reason: &str) {
        if let Some((failures, last)) = self.failures.get_mut(generator) {
            *failures += 1;
            reason.clone_into(last);
        }
    }

    /// Forgets the times so far and rests: the cost of frames changed at `now_s`.
    pub fn rest(&mut self, now_s: f64) {
        self.forget();
        self.rests_until = now_s + REST_S;
    }

    fn forget(&mut self) {
        self.busy.clear();
        self.renders.clear();
        self.runs.clear();
        (self.frames_without_run, self.fits_since, self.often_since) = (0, None, None);
    }
}
