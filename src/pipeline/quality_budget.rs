//! Quality controller: adapts the quality of a running session to its machine.

use serde::Serialize;

use crate::render::{Climbed, LADDER, QualityPoint, RUNGS};
use crate::statistics::nearest_rank;

/// Frames considered in a decision.
const WINDOW: usize = 32;
/// Fewest frames for a decision, so that single slow frames have no effect.
const FRAMES_MIN: usize = 8;
/// Time over the budget after which quality falls, s.
const OVER_S: f64 = 3.0;
/// Time for which the next rung must fit before quality rises, s.
const UNDER_S: f64 = 10.0;
/// Largest part of the budget that the next rung may be predicted to take.
const ROOM: f64 = 0.8;
/// Time after a change in which frames are ignored, s: buffers and passes are rebuilt.
const REST_S: f64 = 2.0;
/// Time after a rise within which a fall counts as a failure of the rung, s.
const SOON_S: f64 = 30.0;
/// First and longest wait before a failed rung is tried again, s; the wait doubles each time.
const RETRY_S: [f64; 2] = [60.0, 3840.0];

/// Summary of the quality controller's actions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct QualitySummary {
    /// Time budget per frame, ms.
    pub budget_ms: f64,
    /// Rays × layers at the start.
    pub begun: String,
    /// Rays × layers at the end.
    pub ended: String,
    /// Number of times quality fell.
    pub lowered: u64,
    /// Number of times quality rose.
    pub raised: u64,
    /// Number of times the device had no memory for the next rung.
    pub refused: u64,
    /// Whether a watcher set the quality by hand, which ended the control.
    pub by_hand: bool,
}

/// A change of quality.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QualityChange {
    /// Quality before the change.
    pub from: QualityPoint,
    /// Quality after the change.
    pub to: QualityPoint,
    /// 75th percentile of recent frame times, ms.
    pub frame_ms: f64,
}

/// A slow controller: takes frame times, and decides when to move to another rung of the [`LADDER`].
///
/// One rung down when the 75th percentile of recent frame times exceeds the budget for 3 s. One rung up when that time
/// × the next rung's measured cost ratio stays within 0.8 of the budget for 10 s. A rung that is left within 30 s of
/// a rise is not tried again for 1 min, then 2 min, up to 64 min.
#[derive(Debug, Clone)]
pub struct QualityBudget {
    budget_ms: f64,
    begun: usize,
    rung: usize,
    /// Cost of each rung relative to the one below.
    ratios: [f64; RUNGS],
    /// Ring of recent frame times of this rung, ms.
    times: [f64; WINDOW],
    pushed: usize,
    /// Times since which frames have been over the budget, and since which the next rung would fit, s.
    over_since: Option<f64>,
    under_since: Option<f64>,
    /// Whether the warning that even the lowest rung exceeds the budget is active.
    told: bool,
    /// Time of the last such warning, s.
    told_s: f64,
    /// Completion time of the last counted frame, s.
    last_s: f64,
    /// Frames before this time are ignored, s.
    rests_until: f64,
    /// The rung before the last change.
    before: usize,
    /// Time at which this rung was reached from below, s.
    raised_at: Option<f64>,
    /// Time at which each rung may be tried again, and its wait after the next failure, s.
    retry_at: [f64; RUNGS],
    retry_s: [f64; RUNGS],
    lowered: u64,
    raised: u64,
    refused: u64,
}

impl QualityBudget {
    /// A controller that starts at the rung measured at the session's start.
    pub fn new(climbed: &Climbed) -> Self {
        let mut ratios = [f64::INFINITY; RUNGS];
        for (rung, ratio) in ratios.iter_mut().enumerate().skip(1) {
            // Without a measurement: time grows at most in proportion to the paths.
            let paths = f64::from(LADDER[rung].paths()) / f64::from(LADDER[rung - 1].paths());
            let measured = climbed.frame_ms[rung].zip(climbed.frame_ms[rung - 1]).map(|(this, below)| this / below);
            *ratio = measured.filter(|found| found.is_finite() && *found > 0.0).unwrap_or(paths).max(1.0);
        }
        let rung = climbed.rung.min(RUNGS - 1);
        Self {
            budget_ms: climbed.budget_ms,
            begun: rung,
            rung,
            ratios,
            times: [0.0; WINDOW],
            pushed: 0,
            over_since: None,
            under_since: None,
            told: false,
            told_s: f64::NEG_INFINITY,
            last_s: f64::NEG_INFINITY,
            rests_until: f64::NEG_INFINITY,
            before: rung,
            raised_at: None,
            retry_at: [f64::NEG_INFINITY; RUNGS],
            retry_s: [RETRY_S[0]; RUNGS],
            lowered: 0,
            raised: 0,
            refused: 0,
        }
    }

    /// Quality point for the next frames.
    pub fn point(&self) -> QualityPoint {
        LADDER[self.rung]
    }

    /// Time budget per frame, ms.
    pub fn budget_ms(&self) -> f64 {
        self.budget_ms
    }

    /// Records that a frame of `point` was done at `now_s` and took `ms`. Ignores frames of other points, frames during
    /// a rest, and negative or non-finite times.
    pub fn frame(&mut self, now_s: f64, point: QualityPoint, ms: f64) {
        if point != self.point() || now_s < self.rests_until || !ms.is_finite() || ms < 0.0 {
            return;
        }
        if now_s - self.last_s > REST_S + 2e-3 * ms {
            // A pause in rendering is no measure of frame times.
            (self.over_since, self.under_since, self.pushed) = (None, None, 0);
        }
        self.last_s = now_s;
        self.times[self.pushed % WINDOW] = ms;
        self.pushed += 1;
        let Some(frame_ms) = self.p75_ms() else { return };
        let since = |holds: bool, since: Option<f64>| if holds { since.or(Some(now_s)) } else { None };
        self.over_since = since(frame_ms > self.budget_ms, self.over_since);
        let next_ms = self.ratios.get(self.rung + 1).map(|ratio| frame_ms * ratio);
        self.under_since = since(next_ms.is_some_and(|ms| ms <= ROOM * self.budget_ms), self.under_since);
    }

    /// Makes the change that is due at `now_s`, if any, and returns it.
    pub fn change(&mut self, now_s: f64) -> Option<QualityChange> {
        let frame_ms = self.p75_ms()?;
        let from = self.point();
        self.before = self.rung;
        if self.lasted(self.over_since, OVER_S) && self.rung > 0 {
            if self.raised_at.is_some_and(|at| now_s - at <= SOON_S) {
                self.failed(now_s);
            } else {
                self.retry_s[self.rung] = RETRY_S[0];
            }
            (self.rung, self.raised_at) = (self.rung - 1, None);
            self.lowered += 1;
        } else if self.lasted(self.under_since, UNDER_S)
            && self.retry_at.get(self.rung + 1).is_some_and(|retry_at| now_s >= *retry_at)
        {
            (self.rung, self.raised_at) = (self.rung + 1, Some(now_s));
            self.raised += 1;
        } else {
            return None;
        }
        self.rest(now_s);
        Some(QualityChange { from, to: self.point(), frame_ms })
    }

    /// The 75th percentile of frame times, ms, if even the lowest rung exceeds the budget; returned once per overrun
    /// and at most once per minute.
    pub fn over_at_least(&mut self) -> Option<f64> {
        let over = self.rung == 0 && self.lasted(self.over_since, OVER_S);
        let tell = over && !self.told && self.last_s - self.told_s >= RETRY_S[0];
        // The warning ends when frames fit again, not by a rest.
        self.told = tell || (self.told && self.rung == 0 && (over || self.pushed < FRAMES_MIN));
        if !tell {
            return None;
        }
        self.told_s = self.last_s;
        self.p75_ms()
    }

    /// Undoes the last change, for which the device had no memory at `now_s`. A rung reached by a rise is never tried
    /// again.
    pub fn refused(&mut self, now_s: f64) {
        self.refused += 1;
        if self.rung > self.before {
            self.retry_at[self.rung] = f64::INFINITY;
            self.raised -= 1;
        } else if self.rung < self.before {
            self.lowered -= 1;
        }
        (self.rung, self.raised_at) = (self.before, None);
        self.rest(now_s);
        self.rests_until = now_s + RETRY_S[0];
    }

    /// Discards the frame times so far and rests: the cost of frames changed at `now_s`.
    pub fn rest(&mut self, now_s: f64) {
        (self.over_since, self.under_since, self.pushed) = (None, None, 0);
        self.rests_until = now_s + REST_S;
    }

    /// Summary of the actions so far.
    pub fn summary(&self, by_hand: bool) -> QualitySummary {
        QualitySummary {
            budget_ms: self.budget_ms,
            begun: LADDER[self.begun].to_string(),
            ended: self.point().to_string(),
            lowered: self.lowered,
            raised: self.raised,
            refused: self.refused,
            by_hand,
        }
    }

    /// Whether a condition that has held since `since` lasted `time_s` up to the last frame.
    fn lasted(&self, since: Option<f64>, time_s: f64) -> bool {
        since.is_some_and(|since| self.last_s - since >= time_s)
    }

    fn failed(&mut self, now_s: f64) {
        let wait_s = self.retry_s[self.rung];
        self.retry_at[self.rung] = now_s + wait_s;
        self.retry_s[self.rung] = (2.0 * wait_s).min(RETRY_S[1]);
    }

    /// 75th percentile of recent frame times, ms; none if there are too few.
    fn p75_ms(&self) -> Option<f64> {
        let known = self.pushed.min(WINDOW);
        if known < FRAMES_MIN {
            return None;
        }
        let mut times = self.times;
        let times = &mut times[..known];
        times.sort_unstable_by(f64::total_cmp);
        nearest_rank(times, 0.75)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::climb;

    /// 8 ms plus 1.5 ms per path: 1x1 9.5, 1x3 12.5, 2x3 17, 4x3 26, 8x3 44 ms.
    fn cost_ms(point: QualityPoint) -> f64 {
        8.0 + 1.5 * f64::from(point.paths())
    }

    fn budget(budget_ms: f64) -> QualityBudget {
        QualityBudget::new(&climb::<()>(budget_ms, |point| Ok(Some(cost_ms(point)))).unwrap())
    }

    /// Runs `budget` at 20 frames per second from `from_s` on; frames take `ms`. Returns time and point of each change.
    fn run(
        budget: &mut QualityBudget,
        from_s: f64,
        seconds: f64,
        mut ms: impl FnMut(QualityPoint) -> f64,
    ) -> Vec<(f64, String)> {
        let mut changes = Vec::new();
        for frame in 0..(20.0 * seconds) as u32 {
            let now_s = from_s + f64::from(frame) / 20.0;
            let point = budget.point();
            budget.frame(now_s, point, ms(point));
            if let Some(change) = budget.change(now_s) {
                assert_eq!((change.from, change.to), (point, budget.point()));
                changes.push((now_s, change.to.to_string()));
            }
        }
        changes
    }

    fn points(changes: &[(f64, String)]) -> Vec<&str> {
        changes.iter().map(|(_, point)| point.as_str()).collect()
    }

    #[test]
    fn a_budget_that_is_met_changes_nothing() {
        let mut budget = budget(40.0);
        assert_eq!(budget.point().to_string(), "4x3");
        assert_eq!(run(&mut budget, 0.0, 600.0, cost_ms), []);
        // Occasional slow frames and a slow second change nothing.
        let mut frame = 0;
        let hiccups = run(&mut budget, 600.0, 600.0, |point| {
            frame += 1;
            cost_ms(point) + if frame % 10 == 0 || frame % 2000 < 20 { 200.0 } else { 0.0 }
        });
        assert_eq!(hiccups, []);
        let summary = budget.summary(false);
        assert_eq!((summary.begun, summary.ended, summary.lowered + summary.raised), ("4x3".into(), "4x3".into(), 0));
    }

    #[test]
    fn quality_falls_with_a_slow_machine_and_comes_back_with_it() {
        let mut budget = budget(40.0);
        // 4x3 takes 78 ms, 2x3 51, 1x3 37.5.
        let down = run(&mut budget, 0.0, 60.0, |point| 3.0 * cost_ms(point));
        assert_eq!(points(&down), ["2x3", "1x3"]);
        assert!(down[0].0 >= OVER_S && down[1].0 - down[0].0 >= REST_S + OVER_S, "{down:?}");
        let up = run(&mut budget, 60.0, 120.0, cost_ms);
        assert_eq!(points(&up), ["2x3", "4x3"]);
        assert!(up[0].0 - 60.0 >= UNDER_S && up[1].0 - up[0].0 >= REST_S + UNDER_S, "{up:?}");
        assert_eq!((budget.summary(false).lowered, budget.summary(true).raised), (2, 2));
        assert!(budget.summary(true).by_hand);
    }

    #[test]
    fn a_rung_that_fails_is_tried_more_and_more_seldom() {
        let mut budget = budget(40.0);
        // From the start, 4x3 costs more than its measured ratio.
        let cost = |point: QualityPoint| if point.paths() == 12 { 60.0 } else { cost_ms(point) };
        let changes = run(&mut budget, 0.0, 2000.0, cost);
        let tries: Vec<f64> = changes.iter().filter(|(_, to)| to == "4x3").map(|(at, _)| *at).collect();
        assert!((4..=6).contains(&tries.len()), "{tries:?}");
        let gaps: Vec<f64> = tries.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(gaps[0] >= RETRY_S[0] && gaps.windows(2).all(|w| w[1] > 1.5 * w[0]), "{gaps:?}");
    }

    #[test]
    fn nothing_below_the_least_rung() {
        let mut budget = budget(5.0);
        assert_eq!(budget.point(), LADDER[0]);
        let mut told = Vec::new();
        for frame in 0..2000 {
            let now_s = f64::from(frame) / 20.0;
            // Within the budget from 60 s to 70 s.
            budget.frame(now_s, LADDER[0], if (1200..1400).contains(&frame) { 4.5 } else { 10.0 });
            assert_eq!(budget.change(now_s), None);
            told.extend(budget.over_at_least().map(|ms| (now_s, ms)));
        }
        assert!(matches!(told[..], [(first, 10.0), (second, 10.0)] if first < 4.0 && second > 70.0), "{told:?}");
    }

    #[test]
    fn times_that_are_not_of_the_point_do_not_count() {
        let mut budget = budget(40.0);
        let wrong = [f64::NAN, f64::INFINITY, -1.0];
        let mut frame = 0;
        let changes = run(&mut budget, 0.0, 60.0, |point| {
            frame += 1;
            // Three of four times are invalid.
            wrong.get(frame % 4).copied().unwrap_or(cost_ms(point))
        });
        assert_eq!(changes, []);
        for frame in 0..200 {
            budget.frame(60.0 + f64::from(frame), LADDER[8], 1000.0);
            assert_eq!(budget.change(60.0 + f64::from(frame)), None);
        }
    }

    #[test]
    fn a_pause_is_no_time() {
        let mut budget = budget(40.0);
        assert_eq!(run(&mut budget, 0.0, 2.0, |_| 100.0), []);
        assert_eq!(run(&mut budget, 100.0, 2.0, |_| 100.0), [], "2 s over the budget, 100 s apart");
    }

    #[test]
    fn a_rung_that_the_device_refuses_is_not_asked_for_again() {
        let mut budget = budget(40.0);
        assert_eq!(points(&run(&mut budget, 0.0, 5.0, |_| 100.0)), ["2x3"]);
        let mut tries = 0;
        for frame in 0..20_000 {
            let now_s = 5.0 + f64::from(frame) / 20.0;
            budget.frame(now_s, budget.point(), 5.0);
            if budget.change(now_s).is_some() {
                budget.refused(now_s);
                tries += 1;
            }
        }
        assert_eq!((tries, budget.point().to_string().as_str()), (1, "2x3"));
        let summary = budget.summary(false);
        assert_eq!((summary.lowered, summary.raised, summary.refused), (1, 0, 1));
    }
}
