//! Time budget of a generator, and durations of its runs.

use std::collections::VecDeque;
use std::time::Duration;

use crate::statistics::nearest_rank;

/// Limits derived from the time allowed for one run. Times are those of the session's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    /// Time that one run may take.
    pub run: Duration,
    /// Duration after which a run is stopped. Longer than `run`, so a slightly late run still gives its image.
    pub stop_after: Duration,
    /// Number of latest runs in the 95th percentile.
    pub window: usize,
    /// Number of runs from which the 95th percentile counts. With fewer than 20 it equals the slowest.
    pub settle: usize,
    /// Consecutive runs over the budget after which a tier steps down at once.
    pub overshoots: u32,
    /// A tier steps up only while its 95th percentile is below this part of the budget.
    pub headroom: f64,
    /// Least time between a step and the next step up. It doubles with each failed step up to a tier.
    pub hold: Duration,
    /// Greatest time between two attempts to step up to a tier.
    pub longest_hold: Duration,
}

impl Budget {
    /// The budget for runs of that duration.
    pub fn new(run: Duration) -> Self {
        Self {
            run,
            stop_after: run * 2,
            window: 64,
            settle: 20,
            overshoots: 3,
            headroom: 0.8,
            hold: Duration::from_secs(5),
            longest_hold: Duration::from_secs(80),
        }
    }
}

/// The latest durations of a tier's runs.
#[derive(Debug, Clone)]
pub struct RunTimes {
    latest: VecDeque<Duration>,
    window: usize,
    sorted: Vec<Duration>,
}

impl RunTimes {
    /// No durations yet; keeps the latest `window`, at least 1.
    pub fn new(window: usize) -> Self {
        let window = window.max(1);
        Self { latest: VecDeque::with_capacity(window), window, sorted: Vec::with_capacity(window) }
    }

    /// Adds one; it replaces the oldest if the window is full.
    pub fn push(&mut self, time: Duration) {
        if self.latest.len() == self.window {
            self.latest.pop_front();
        }
        self.latest.push_back(time);
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.latest.clear();
    }

    /// Number of durations.
    pub fn len(&self) -> usize {
        self.latest.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.latest.is_empty()
    }

    /// Nearest-rank percentile: the least duration that at least `part` (0..=1) of the runs did not exceed. None if
    /// empty.
    pub fn percentile(&mut self, part: f64) -> Option<Duration> {
        self.sorted.clear();
        self.sorted.extend(&self.latest);
        self.sorted.sort_unstable();
        nearest_rank(&self.sorted, part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(n: u64) -> Duration {
        Duration::from_millis(n)
    }

    #[test]
    fn percentiles_are_nearest_ranks_of_the_window() {
        let mut times = RunTimes::new(20);
        assert_eq!((times.percentile(0.95), times.is_empty()), (None, true));
        times.push(ms(7));
        assert_eq!(times.percentile(0.95), Some(ms(7)));
        (1..=20).for_each(|n| times.push(ms(n)));
        assert_eq!(times.len(), 20);
        assert_eq!([0.0, 0.5, 0.95, 1.0].map(|p| times.percentile(p).unwrap()), [1, 10, 19, 20].map(ms));
        times.push(ms(100));
        assert_eq!(times.percentile(1.0), Some(ms(100)), "the oldest has left");
        times.clear();
        assert_eq!(times.percentile(0.5), None);
    }
}
