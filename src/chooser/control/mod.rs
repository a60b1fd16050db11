//! Operating points of a live session, and the controller that chooses among them.
//!
//! An operating point ("point") is a frame quality, with or without a generator applied to it. Its error is known from
//! a table, and its time was measured at the start. During the session, the controller compares present times with the
//! measured ones, for frames and for generator runs. From these ratios it predicts the time of every other point.

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

/// Number of latest frames that can show a sudden load, and least number needed for a decision.
const SUDDEN: (usize, usize) = (12, 8);
/// Number of latest frames whose 95th percentile must keep the budget, and least number needed for a decision.
const SETTLED: (usize, usize) = (96, 40);
/// Largest predicted share of the budget at which a point may be chosen.
const ROOM: f64 = 0.92;
/// Time for which a better point must be predicted to fit before it is chosen, s.
const RISE_S: f64 = 6.0;
/// Time after a change in which frames are ignored, s. Buffers are rebuilt meanwhile.
const REST_S: f64 = 1.0;
/// First and longest time for which a failed point is not chosen again, s. Each failure doubles the time.
const RETRY_S: [f64; 2] = [60.0, 3840.0];
/// Number of changes within [`MINUTE_S`] seconds after which better points have to wait.
const CHANGES: usize = 2;
const MINUTE_S: f64 = 60.0;

/// An operating point that may be chosen, with its error and times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Quality of the rendered frame.
    pub quality: FrameQuality,
    /// Index of the generator applied to the frame; `None` shows the rendered picture.
    pub generator: Option<usize>,
    /// Error against the converged reference by speed of the probe, grey levels; a rank if the quality is fixed.
    pub error: BySpeed,
    /// Median time of a rendered frame, ms; 0 if unknown.
    pub render_ms: f64,
    /// Median time of a generator run, ms; 0 without a generator.
    pub run_ms: f64,
}

/// Time limits of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameBudget {
    /// Largest time for rendering and generating a frame, ms; `None` limits only generator runs.
    pub frame_ms: Option<f64>,
    /// Largest time of a generator run, ms.
    pub run_ms: f64,
    /// Whether frames and runs use different hardware. If so, the longer of the two times counts, else their sum.
    pub apart: bool,
    /// Ratio of the 95th percentile of times to their median, as measured at the start.
    pub spread: f64,
}

/// Load of rendering and of generator runs: ratios of present times to the times measured at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Load {
    render: f64,
    run: f64,
}

impl Load {
    /// Load at the time of the measurement.
    const START: Self = Self { render: 1.0, run: 1.0 };
}

/// A change of the operating point.
#[derive(Debug, Clone, PartialEq)]
pub struct PointChange {
    /// Previous point.
    pub from: Candidate,
    /// New point.
    pub to: Candidate,
    /// Reason for the change, in words.
    pub reason: String,
}

/// Chooses the operating point of a session.
#[derive(Debug, Clone)]
pub struct PointController {
    candidates: Vec<Candidate>,
    /// Indices of the candidates by increasing error, for each speed of the probe.
    orders: [Vec<usize>; 3],
    /// Speed of the probe, and time of its last change of class, s.
    watch: SpeedWatch,
    moved_s: f64,
    /// Names of the generators.
    generators: Vec<String>,
    budget: FrameBudget,
    current: usize,
    /// Name of the first point.
    begun: String,
    /// Why the first point has a generator or none; `None` if no generator is loaded.
    generator_reason: Option<String>,
    /// Whether watchers want generated pictures, and whether they have just asked for them again.
    generate: bool,
    asked: bool,
    /// Whether a watcher set the quality.
    by_hand: bool,
    /// Busy times of the frames at this point, ms; see [`Self::busy_of`].
    busy: Recent,
    /// Ratios of times at this point to times measured at the start: for frames, and for generator runs.
    renders: Recent,
    runs: Recent,
    /// Last known ratio of run load to render load, and when it was seen, s.
    run_over_render: (f64, f64),
    /// Rendering time of the last frame, ms. The time of the generator run on it is added later.
    rendered_ms: f64,
    frames_without_run: u32,
    /// Time since which a better point has always been predicted to fit, s; `None` if none fits now.
    fits_since: Option<f64>,
    /// Time since which the 95th percentile has exceeded the budget, s; `None` if it doesn't now.
    often_since: Option<f64>,
    /// Frames until this time are ignored, s.
    rests_until: f64,
    /// Time of the last frame, s.
    last_s: f64,
    /// Time of the change to this point, s, if that was a rise.
    raised_at: Option<f64>,
    /// For each candidate: time at which its blocking ends, and duration of the block after its next failure, s.
    blocked_until: Vec<f64>,
    retry_s: Vec<f64>,
    /// Number of failed runs in a row of each generator, and the last reason.
    failures: Vec<(u32, String)>,
    /// Times of the latest changes that count for the limit per minute, and time of the last change, s.
    changes: [f64; CHANGES],
    changed_s: f64,
    /// Index of the point before the last change.
    before: usize,
    /// Whether the last change was to a cheaper point.
    fell: bool,
    /// Whether the warning that no point keeps the budget is active, and when it was last given, s.
    warned: bool,
    warned_s: f64,
    switches: Vec<Switch>,
    counts: summary::Counts,
}

impl PointController {
    /// Makes a controller of `candidates`. It starts at the best point that is predicted to keep the budget, else at
    /// one of the cheapest. `None` without valid candidates. `generators` are the names that candidates refer to by
    /// index.
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

    /// Operating point of the next frames.
    pub fn point(&self) -> Candidate {
        self.candidates[self.current]
    }

    /// Name of an operating point, such as `1x3 + fast_m`.
    pub fn name(&self, point: &Candidate) -> String {
        match point.generator.and_then(|index| self.generators.get(index)) {
            Some(generator) => format!("{} + {generator}", point.quality),
            None => point.quality.to_string(),
        }
    }

    /// Largest time of a frame, ms; of a generator run if frame times aren't limited.
    pub fn limit_ms(&self) -> f64 {
        self.budget.frame_ms.unwrap_or(self.budget.run_ms)
    }

    /// Whether the controller chooses the quality, not only the generator.
    pub fn chooses_quality(&self) -> bool {
        self.budget.frame_ms.is_some()
    }

    /// Time of a frame at this point, ms, from the times measured at the start.
    pub fn expected_ms(&self, point: &Candidate) -> f64 {
        self.busy_ms(point, Load::START)
    }

    /// Whether 95 % of the frames at this point keep the budget, by the times measured at the start.
    pub fn is_expected_to_fit(&self, point: &Candidate) -> bool {
        self.budget.spread * self.expected_ms(point) <= self.limit_ms()
    }

    /// Records that a frame of `quality` took `ms` and was done at `now_s`. Ignores frames of another quality, frames
    /// just after a change ([`Self::rest`]), and invalid times.
    pub fn rendered(&mut self, now_s: f64, quality: FrameQuality, ms: f64) {
        let point = self.point();
        if quality != point.quality || now_s < self.rests_until || !ms.is_finite() || ms < 0.0 {
            return;
        }
        if now_s - self.last_s > REST_S + 2e-3 * ms {
            // After a pause in rendering, the times before it say nothing about the load.
            self.forget();
        }
        self.last_s = now_s;
        self.rendered_ms = ms;
        // If the point's time is unknown, the render load counts as 1.
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

    /// Records a run of a generator that made a picture in `ms`.
    pub fn ran(&mut self, now_s: f64, generator: usize, ms: f64) {
        if let Some((failures, _)) = self.failures.get_mut(generator) {
            *failures = 0;
        }
        self.terminated(now_s, generator, ms);
    }

    /// Records a run of a generator that was stopped after `ms`.
    pub fn terminated(&mut self, now_s: f64, generator: usize, ms: f64) {
        let point = self.point();
        if point.generator != Some(generator) || now_s < self.rests_until || !ms.is_finite() || ms < 0.0 {
            return;
        }
        self.frames_without_run = 0;
        self.runs.push(ms / point.run_ms.max(1e-3));
        self.busy.push(self.busy_of(self.rendered_ms, ms));
    }

    /// Records a failed run of a generator.
    pub fn failed(&mut self, generator: usize, reason: &str) {
        if let Some((failures, last)) = self.failures.get_mut(generator) {
            *failures += 1;
            reason.clone_into(last);
        }
    }

    /// Forgets the recorded times, because the cost of frames changed at `now_s`, and ignores frames for
    /// `REST_S` seconds.
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
