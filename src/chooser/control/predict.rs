//! Predicted times of operating points, and the best one that fits.

use super::{Candidate, Load, PointController, ROOM};

/// Number of latest frames from which a better point's time is predicted, and least number needed.
pub(super) const AHEAD: (usize, usize) = (48, 24);
/// Largest ratio of the chosen point's time to the least time, used if no point's 95th percentile fits.
pub(super) const OVER_LEAST_MAX: f64 = 1.2;
/// Largest ratio of a better point's error to the present error. A smaller gain isn't worth a change.
pub(super) const WORTH: f64 = 0.98;
/// Time constant with which the ratio of run load to render load decays to 1, s.
const RELAX_S: f64 = 30.0;
/// Upper limit of the spread (95th percentile over median) that live frames may show.
const SPREAD_MAX: f64 = 2.0;
/// Upper limit of the spread measured at the start, because that measurement may have been disturbed.
pub(super) const START_SPREAD_MAX: f64 = 1.3;

impl PointController {
    /// Index of the best point that is predicted to fit, if its error is small enough to be worth a change.
    pub(super) fn better(&self, now_s: f64) -> Option<usize> {
        let load = self.load(AHEAD)?;
        let best = self.best(now_s, load, self.spread(AHEAD), ROOM)?;
        (self.error(best) < WORTH * self.error(self.current)).then_some(best)
    }

    /// Index of the point with the least error that is predicted to keep the share `room` of the budget.
    pub(super) fn best(&self, now_s: f64, load: Load, spread: f64, room: f64) -> Option<usize> {
        self.best_below(now_s, load, spread, room, f64::INFINITY)
    }

    /// Returns [`Self::best`] among the points that are predicted to take less than `most_ms`.
    pub(super) fn best_below(&self, now_s: f64, load: Load, spread: f64, room: f64, most_ms: f64) -> Option<usize> {
        let fits = |candidate: &Candidate| {
            self.busy_ms(candidate, load) < most_ms && self.keeps(candidate, load, spread, room)
        };
        self.by_error().find(|&index| self.may_be_chosen(now_s, index) && fits(&self.candidates[index]))
    }

    /// Whether the point is predicted to keep the share `room` of the frame budget, and its generator runs their own
    /// budget.
    pub(super) fn keeps(&self, candidate: &Candidate, load: Load, spread: f64, room: f64) -> bool {
        spread * self.busy_ms(candidate, load) <= room * self.limit_ms()
            && spread * load.run * candidate.run_ms <= self.budget.run_ms
    }

    /// Index of the point to use when none fits, among points predicted to take at most `most_ms`. It has the least
    /// error of the points whose median fits and is at most [`OVER_LEAST_MAX`] times the least time. Without such
    /// points it is the fastest. If every point is blocked, all raw points are considered.
    pub(super) fn least(&self, now_s: f64, load: Load, most_ms: f64) -> Option<usize> {
        let ms = |index: usize| self.busy_ms(&self.candidates[index], load);
        let among = |open: &dyn Fn(usize) -> bool| {
            let open = || self.by_error().filter(|&index| open(index) && ms(index) <= most_ms);
            let least = open().min_by(|&a, &b| ms(a).total_cmp(&ms(b)))?;
            let limit_ms = (OVER_LEAST_MAX * ms(least)).min(ROOM * self.limit_ms());
            open().find(|&index| ms(index) <= limit_ms).or(Some(least))
        };
        let raw = |index: usize| self.candidates[index].generator.is_none();
        among(&|index| self.may_be_chosen(now_s, index)).or_else(|| among(&raw))
    }

    fn may_be_chosen(&self, now_s: f64, index: usize) -> bool {
        let generated = self.candidates[index].generator.is_some();
        now_s >= self.blocked_until[index] && (self.generate || !generated)
    }

    /// Load of the latest `count` frames and generator runs, as ratios to the measured times. `None` with fewer than
    /// `least` frames. Without recent runs, the run load follows the render load.
    pub(super) fn load(&self, (count, least): (usize, usize)) -> Option<Load> {
        let render = self.renders.percentile(0.5, count, least)?;
        let run = self.runs.percentile(0.5, count, least.min(count / 4));
        let (ratio, seen_s) = self.run_over_render;
        // The last known ratio of run load to render load decays towards 1.
        let ratio = || 1.0 + (ratio - 1.0) * (-(self.last_s - seen_s).max(0.0) / RELAX_S).exp();
        Some(Load { render, run: run.unwrap_or_else(|| render * ratio()) })
    }

    /// Ratio of the present point's time under `load` to its measured time.
    pub(super) fn slower(&self, load: Load) -> f64 {
        self.busy_ms(&self.point(), load) / self.expected_ms(&self.point()).max(1e-3)
    }

    /// Ratio of the latest frames' 95th percentile to their median, at least the spread at the start.
    pub(super) fn spread(&self, (count, least): (usize, usize)) -> f64 {
        let of = |part| self.busy.percentile(part, count, least);
        let found = of(0.95).zip(of(0.5)).map_or(1.0, |(p95, p50)| p95 / p50.max(1e-3));
        found.clamp(self.budget.spread, SPREAD_MAX)
    }

    /// Predicted busy time of a frame under `load`, ms.
    pub(super) fn busy_ms(&self, candidate: &Candidate, load: Load) -> f64 {
        self.busy_of(load.render * candidate.render_ms, load.run * candidate.run_ms)
    }

    /// Busy time of a frame, which the budget limits, ms: sum of rendering and generator run, or the longer of the two
    /// on different hardware. If frames aren't limited, the run alone.
    pub(super) fn busy_of(&self, render_ms: f64, run_ms: f64) -> f64 {
        match (self.budget.frame_ms, self.budget.apart) {
            (None, _) => run_ms,
            (Some(_), true) => render_ms.max(run_ms),
            (Some(_), false) => render_ms + run_ms,
        }
    }
}
