//! Changes of the operating point: when one is due, and which points are blocked after it.

use super::predict::AHEAD;
use super::{CHANGES, Load, MINUTE_S, PointChange, PointController, RETRY_S, RISE_S, SUDDEN};

/// Time after a change to a better point (a rise) within which a fall marks the rise as failed, s.
const FAILED_WITHIN_S: f64 = 20.0;
/// Time within which two changes to cheaper points (falls) count as one change, s. The first may not suffice.
pub(super) const ONE_FALL_S: f64 = 5.0;
/// Failed runs in a row after which the controller stops using a generator.
const FAILURES: u32 = 3;

impl PointController {
    /// Changes the operating point if that is due at `now_s`, and returns the change.
    pub fn change(&mut self, now_s: f64) -> Option<PointChange> {
        let current = self.point();
        if let Some(index) = current.generator {
            if !self.generate {
                return self.switch_off(now_s);
            }
            if let Some((FAILURES.., reason)) = self.failures.get(index) {
                let name = self.generators.get(index).map_or("", String::as_str);
                let reason = format!("{name} failed {FAILURES} times in a row: {reason}");
                self.block_generator(now_s, index);
                return self.leave(now_s, reason);
            }
        } else if std::mem::take(&mut self.asked)
            && let Some(change) = self.switch_on(now_s)
        {
            return Some(change);
        }
        if self.is_over() {
            return self.fall(now_s);
        }
        self.follow_speed(now_s).or_else(|| self.rise(now_s))
    }

    /// Changes to a cheaper operating point, if there is one.
    fn fall(&mut self, now_s: f64) -> Option<PointChange> {
        let load = self.load(SUDDEN)?;
        let spread = self.spread(SUDDEN);
        let now_ms = self.busy_ms(&self.point(), load);
        // Excludes the present point, whose median time may fit although its 95th percentile doesn't.
        let to = self.best_below(now_s, load, spread, 1.0, now_ms);
        let to = to.or_else(|| self.least(now_s, load, now_ms)).filter(|&to| to != self.current)?;
        if self.raised_at.is_some_and(|at| now_s - at <= FAILED_WITHIN_S) {
            self.block_beyond(now_s);
        } else {
            self.retry_s[self.current] = RETRY_S[0];
        }
        let reason = self.overrun(load);
        Some(self.go(now_s, to, false, reason))
    }

    /// Changes to a better operating point if one has been predicted to fit for [`RISE_S`].
    fn rise(&mut self, now_s: f64) -> Option<PointChange> {
        if self.fits_since.is_none_or(|since| self.last_s - since < RISE_S) || now_s - self.changes[0] < MINUTE_S {
            return None;
        }
        let to = self.better(now_s)?;
        let ms = self.busy_ms(&self.candidates[to], self.load(AHEAD)?);
        let reason = format!("it is expected to take {ms:.0} ms of {:.0}", self.limit_ms());
        Some(self.go(now_s, to, true, reason))
    }

    /// Blocks the present point, and all points with at least about its time, for the present point's retry time.
    fn block_beyond(&mut self, now_s: f64) {
        let wait_s = self.retry_s[self.current];
        self.retry_s[self.current] = (2.0 * wait_s).min(RETRY_S[1]);
        let failed_ms = self.expected_ms(&self.point());
        for index in 0..self.candidates.len() {
            if self.expected_ms(&self.candidates[index]) >= 0.97 * failed_ms {
                self.blocked_until[index] = self.blocked_until[index].max(now_s + wait_s);
            }
        }
    }

    /// Blocks all points with a generator that failed, for the present point's retry time.
    fn block_generator(&mut self, now_s: f64, generator: usize) {
        let wait_s = self.retry_s[self.current];
        for index in 0..self.candidates.len() {
            if self.candidates[index].generator == Some(generator) {
                self.blocked_until[index] = now_s + wait_s;
                self.retry_s[index] = (2.0 * wait_s).min(RETRY_S[1]);
            }
        }
        self.failures[generator].0 = 0;
    }

    /// Changes to the best allowed point, because the present generator must stop. `None` if no other point is allowed.
    pub(super) fn leave(&mut self, now_s: f64, reason: String) -> Option<PointChange> {
        let load = self.load(SUDDEN).unwrap_or(Load::START);
        let to = self.best(now_s, load, self.spread(SUDDEN), 1.0);
        let to = to.or_else(|| self.least(now_s, load, f64::INFINITY))?;
        (to != self.current).then(|| self.go(now_s, to, false, reason))
    }

    /// Changes to the candidate with index `to`; `raised` tells whether it is better.
    pub(super) fn go(&mut self, now_s: f64, to: usize, raised: bool, reason: String) -> PointChange {
        let from = self.point();
        if let Some(Load { render, run }) = self.load(SUDDEN).filter(|_| from.generator.is_some()) {
            self.run_over_render = ((run / render.max(1e-3)).clamp(0.25, 4.0), now_s);
        }
        (self.before, self.current) = (self.current, to);
        self.raised_at = raised.then_some(now_s);
        let again = self.fell && !raised && now_s - self.changes[CHANGES - 1] < ONE_FALL_S;
        if !again {
            self.changes.rotate_left(1);
        }
        (self.changes[CHANGES - 1], self.changed_s) = (now_s, now_s);
        self.fell = !raised;
        self.rest(now_s);
        let change = PointChange { from, to: self.point(), reason };
        self.note(now_s, &change, raised);
        change
    }

    /// Undoes the last change, because the device lacks memory for that point. The point is never chosen again.
    pub fn refused(&mut self, now_s: f64) {
        self.blocked_until[self.current] = f64::INFINITY;
        (self.current, self.raised_at) = (self.before, None);
        self.undo_note();
        self.rest(now_s);
    }
}
