//! The latest values of a measurement.

use crate::statistics::nearest_rank;

/// Number of values kept.
const KEPT: usize = 96;

/// Ring buffer of the latest values.
#[derive(Debug, Clone)]
pub(super) struct Recent {
    values: [f64; KEPT],
    pushed: usize,
}

impl Recent {
    pub(super) fn new() -> Self {
        Self { values: [0.0; KEPT], pushed: 0 }
    }

    pub(super) fn push(&mut self, value: f64) {
        self.values[self.pushed % KEPT] = value;
        self.pushed += 1;
    }

    pub(super) fn clear(&mut self) {
        self.pushed = 0;
    }

    /// Number of values, at most `KEPT`.
    pub(super) fn len(&self) -> usize {
        self.pushed.min(KEPT)
    }

    /// Nearest-rank percentile `part` (0 to 1) of the latest `count` values; `None` if there are fewer than `least`.
    pub(super) fn percentile(&self, part: f64, count: usize, least: usize) -> Option<f64> {
        let count = count.min(self.len());
        if count < least.max(1) {
            return None;
        }
        let mut latest = [0.0; KEPT];
        for (back, value) in latest[..count].iter_mut().enumerate() {
            *value = self.values[(self.pushed - 1 - back) % KEPT];
        }
        latest[..count].sort_unstable_by(f64::total_cmp);
        nearest_rank(&latest[..count], part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_of_the_latest_values() {
        let mut recent = Recent::new();
        assert_eq!(recent.percentile(0.5, 4, 1), None);
        (1..=1000).for_each(|n| recent.push(f64::from(n)));
        assert_eq!((recent.len(), recent.percentile(0.5, 3, 3)), (KEPT, Some(999.0)));
        assert_eq!(recent.percentile(1.0, 1000, 96), Some(1000.0));
        assert_eq!(recent.percentile(0.0, 1000, 96), Some(905.0));
        assert_eq!(recent.percentile(0.5, 1000, 97), None);
        recent.clear();
        assert_eq!((recent.len(), recent.percentile(0.5, 3, 0)), (0, None));
    }
}
