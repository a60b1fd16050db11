//! Overruns: frames or generator runs that exceed the budget.

use super::{Load, MINUTE_S, PointController, SETTLED, SUDDEN};

/// Time for which the 95th percentile may exceed the budget, s. The median shows a sudden load earlier, and predicts
/// times better.
const OFTEN_S: f64 = 3.0;
/// Number of frames without a finished generator run after which the generator counts as over its budget.
const FRAMES_WITHOUT_RUN: u32 = 16;

impl PointController {
    /// Whether recent frames or generator runs exceed the budget.
    pub(super) fn is_over(&self) -> bool {
        let sudden = self.busy.percentile(0.5, SUDDEN.0, SUDDEN.1).is_some_and(|ms| ms > self.limit_ms());
        let often = self.often_since.is_some_and(|since| self.last_s - since >= OFTEN_S);
        let runs = self.slow_runs_ms().is_some();
        sudden || often || runs || self.frames_without_run > FRAMES_WITHOUT_RUN
    }

    /// Median time of recent generator runs, ms, if it exceeds the budget of runs.
    fn slow_runs_ms(&self) -> Option<f64> {
        let load = self.runs.percentile(0.5, SUDDEN.0, SUDDEN.1)?;
        Some(load * self.point().run_ms).filter(|ms| *ms > self.budget.run_ms)
    }

    /// Description of the overrun, with times and limit.
    pub(super) fn overrun(&self, load: Load) -> String {
        let limit_ms = self.limit_ms();
        let ms = self.busy.percentile(0.5, SUDDEN.0, 1).unwrap_or_else(|| self.busy_ms(&self.point(), load));
        if self.frames_without_run > FRAMES_WITHOUT_RUN {
            return format!("no run has ended for {FRAMES_WITHOUT_RUN} frames");
        }
        if ms > limit_ms {
            return format!(
                "frames take {ms:.0} ms of {limit_ms:.0}, {:.1} times as long as at the start",
                self.slower(load)
            );
        }
        if let Some(run_ms) = self.slow_runs_ms() {
            return format!("runs take {run_ms:.0} ms of {:.0}", self.budget.run_ms);
        }
        let often_ms = self.busy.percentile(0.95, SETTLED.0, 1).unwrap_or(ms);
        format!("one frame in twenty takes {often_ms:.0} ms or more, of {limit_ms:.0}; half of them take {ms:.0}")
    }

    /// Description of an overrun at which no point would be faster than the present one. Returned once per overrun, and
    /// at most once a minute.
    pub(crate) fn over_at_least(&mut self, now_s: f64) -> Option<String> {
        let load = self.load(SUDDEN);
        let least = |load| self.least(now_s, load, self.busy_ms(&self.point(), load));
        let over = self.is_over() && load.and_then(least) == Some(self.current);
        let warn = over && !self.warned && now_s - self.warned_s >= MINUTE_S;
        // The warning ends when frames fit again. A change of the point alone doesn't end it.
        self.warned = warn || (self.warned && (over || self.busy.len() < SUDDEN.1));
        if !warn {
            return None;
        }
        self.warned_s = now_s;
        Some(self.overrun(load?))
    }
}
