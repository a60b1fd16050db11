//! Predicted times of operating points, and the best one that fits.

use super::{Candidate, Load, PointController, ROOM};

/// Most recent frames that predict a better point's time, and the least number of them that decides.
pub(super) const AHEAD: (usize, usize) = (48, 24);
/// Largest time of a point over the least one, where no point's 95th percentile fits.
pub(super) const OVER_LEAST_MAX: f64 = 1.2;
/// Largest part of the present error that a better point may have: less isn't worth a change.
pub(super) const WORTH: f64 = 0.98;
/// Time constant with which the quotient of run ratio and render ratio decays to 1, s.
const RELAX_S: f64 = 30.0;
/// Largest spread that is believed of live frames: 95th percentile over median.
const SPREAD_MAX: f64 = 2.0;
/// Largest spread that is believed of the start, which may have been disturbed.
pub(super) const START_SPREAD_MAX: f64 = 1.3;

impl PointController {
    /// The best point that is worth a change and predicted to fit.
    pub(super) fn better(&self, now_s: f64) -> Option<usize> {
        let load = self.load(AHEAD)?;
        let best = self.best(now_s, load, self.spread(AHEAD), ROOM)?;
        (self.error(best) < WORTH * self.error(self.current)).then_some(best)
    }

    /// The point with the least error that is predicted to keep `room` of the budget.
    pub(super) fn best(&self, now_s: f64, load: Load, spread: f64, room: f64) -> Option<usize> {
        self.best_below(now_s, load, spread, room, f64::INFINITY)
    }

    /// [`Self::best`] of the points that are predicted to take less than `most_ms`.
    pub(super) fn best_below(&self, now_s: f64, load: Load, spread: f64, room: f64, most_ms: f64) -> Option<usize> {
        let fits = |candidate: &Candidate| {
            self.busy_ms(candidate, load) < most_ms && self.keeps(candidate, load, spread, room)
        };
        self.by_error().find(|&index| self.may_be_chosen(now_s, index) && fits(&self.candidates[index]))
    }

    /// Whether the candidate is predicted to keep `room` of the budget, and its runs theirs.
    pub(super) fn keeps(&self, candidate: &Candidate, load: Load, spread: f64, room: f64) -> bool {
        spread * self.busy_ms(candidate, load) <= room * self.limit_ms()
            && spread * load.run * candidate.run_ms <= self.budget.run_ms
    }

    /// The point to run where none fits. It is the best one whose median fits and whose time is at most
    /// [`OVER_LEAST_MAX`] times the least. Without such a point it is the fastest. Points that are predicted to take more than
    /// `most_ms` don't count.
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

    /// Slow-down of the latest frames and generator runs, as ratios to the measured times. Without recent runs, the run ratio
    /// follows the render ratio.
    pub(super) fn load(&self, (count, least): (usize, usize)) -> Option<Load> {
        let render = self.renders.percentile(0.5, count, least)?;
        let run = self.runs.percentile(0.5, count, least.min(count / 4));
        let (ratio, seen_s) = self.run_over_render;
        // The last known quotient of both ratios decays towards 1.
        let ratio = || 1.0 + (ratio - 1.0) * (-(self.last_s - seen_s).max(0.0) / RELAX_S).exp();
        Some(Load { render, run: run.unwrap_or_else(|| render * ratio()) })
    }

    /// How many times as long the present point takes as measured.
    pub(super) fn slower(&self, load: Load) -> f64 {
        self.busy_ms(&self.point(), load) / self.expected_ms(&self.point()).max(1e-3)
    }

    /// 95th percentile of the latest frames over their median, at least the spread at the start.
    pub(super) fn spread(&self, (count, least): (usize, usize)) -> f64 {
        let of = |part| self.busy.percentile(part, count, least);
        let found = of(0.95).zip(of(0.5)).map_or(1.0, |(p95, p50)| p95 / p50.max(1e-3));
        found.clamp(self.budget.spread, SPREAD_MAX)
    }

    /// Predicted time of a frame, ms.
    pub(super) fn busy_ms(&self, candidate: &Candidate, load: Load) -> f64 {
        self.busy_of(load.render * candidate.render_ms, load.run * candidate.run_ms)
    }

    /// Time of a frame that counts: both parts, the longer one, or the run alone.
    pub(super) fn busy_of(&self, render_ms: f64, run_ms: f64) -> f64 {
        match (self.budget.frame_ms, self.budget.apart) {
            (None, _) => run_ms,
            (Some(_), true) => render_ms.max(run_ms),
            (Some(_), false) => render_ms + run_ms,
        }
    }
}
