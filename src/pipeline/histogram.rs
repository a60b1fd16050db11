//! Percentiles of durations, in constant memory.

use std::time::Duration;

use serde::Serialize;

use super::clock::ms;

/// Number of buckets per doubling of the duration; the relative error of a percentile is at most 1/32.
const STEPS: usize = 32;

/// Number of blocks of buckets: a linear block up to 32 µs, then one block per doubling, up to 19 hours.
const DOUBLINGS: usize = 32;

/// Histogram of durations: buckets of 1 µs up to 64 µs, then 32 buckets per doubling.
#[derive(Debug, Clone)]
pub(crate) struct Histogram {
    counts: Box<[u64]>,
    count: u64,
    max: Duration,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: vec![0; STEPS * DOUBLINGS].into(), count: 0, max: Duration::ZERO }
    }
}

impl Histogram {
    /// Adds a duration.
    pub(crate) fn push(&mut self, time: Duration) {
        let us = u64::try_from(time.as_micros()).unwrap_or(u64::MAX);
        if let Some(count) = self.counts.get_mut(bucket(us).min(STEPS * DOUBLINGS - 1)) {
            *count += 1;
        }
        self.count += 1;
        self.max = self.max.max(time);
    }

    /// Percentile `percent` (0..=100) of the durations by nearest rank, at most 1/32 above the exact value; none
    /// without durations.
    pub(crate) fn percentile(&self, percent: f64) -> Option<Duration> {
        let rank = ((percent / 100.0 * self.count as f64).ceil() as u64).clamp(1, self.count.max(1));
        let mut below = 0;
        let index = self.counts.iter().position(|count| {
            below += count;
            below >= rank
        })?;
        Some(Duration::from_micros(upper_bound(index)).min(self.max))
    }

    /// 50th, 95th and 99th percentiles and the maximum; none without durations.
    pub(crate) fn percentiles(&self) -> Option<Percentiles> {
        let at = |percent| self.percentile(percent).map(ms);
        Some(Percentiles {
            count: self.count,
            p50_ms: at(50.0)?,
            p95_ms: at(95.0)?,
            p99_ms: at(99.0)?,
            max_ms: ms(self.max),
        })
    }
}

/// Index of the bucket of a time in µs: linear up to 32 µs, then 32 buckets per doubling.
fn bucket(us: u64) -> usize {
    let steps = STEPS as u64;
    if us < steps {
        return us as usize;
    }
    let doubling = us.ilog2() - STEPS.ilog2();
    ((u64::from(doubling) + 1) * steps + (us >> doubling) - steps) as usize
}

/// Greatest time in bucket `index`, µs.
fn upper_bound(index: usize) -> u64 {
    let (doubling, step) = (index / STEPS, (index % STEPS) as u64);
    match doubling.checked_sub(1) {
        None => step,
        Some(doubling) => ((STEPS as u64 + step + 1) << doubling) - 1,
    }
}

/// Percentiles of durations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Percentiles {
    /// Number of durations.
    pub count: u64,
    /// Median, ms.
    pub p50_ms: f64,
    /// 95th percentile, ms.
    pub p95_ms: f64,
    /// 99th percentile, ms.
    pub p99_ms: f64,
    /// Maximum, ms.
    pub max_ms: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_join_without_gaps() {
        for index in 0..STEPS * DOUBLINGS - 1 {
            let upper = upper_bound(index);
            assert_eq!((bucket(upper), bucket(upper + 1)), (index, index + 1), "{upper}");
        }
    }

    #[test]
    fn percentiles_are_within_a_step() {
        let mut histogram = Histogram::default();
        for us in (1..=100_000).rev() {
            histogram.push(Duration::from_micros(us));
        }
        for percent in [1.0, 50.0, 95.0, 99.0] {
            let found = histogram.percentile(percent).unwrap().as_secs_f64() * 1e6;
            let expected = percent * 1000.0;
            assert!(found >= expected && found <= expected * (1.0 + 1.0 / 32.0), "{percent}: {found}");
        }
        assert_eq!(histogram.percentile(100.0), Some(Duration::from_millis(100)));
        assert_eq!(histogram.percentiles().unwrap().count, 100_000);
    }

    #[test]
    fn nothing_and_the_extremes_have_percentiles() {
        let mut histogram = Histogram::default();
        assert_eq!(histogram.percentiles(), None);
        histogram.push(Duration::MAX);
        histogram.push(Duration::ZERO);
        assert_eq!(histogram.percentile(50.0), Some(Duration::ZERO));
        assert!(histogram.percentile(100.0).unwrap() > Duration::from_secs(2000));
    }
}
