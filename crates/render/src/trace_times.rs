//! Choice of a way to run `trace`, from measured times.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::trace_by::TraceBy;

/// Largest number of paths that counts as few: they leave most of a GPU idle.
const FEW_PATHS: u32 = 4096;

/// Largest ratio of the time by lanes to the time by threads at which lanes are chosen.
const WORTHWHILE: f64 = 1.0 / 1.05;

/// How to run `trace`, for batches of few and of many paths.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct TraceChoice {
    few: TraceBy,
    many: TraceBy,
}

impl From<TraceBy> for TraceChoice {
    fn from(by: TraceBy) -> Self {
        Self { few: by, many: by }
    }
}

impl TraceChoice {
    /// The way for a batch of `paths` paths.
    pub(super) fn of(&self, paths: u32) -> TraceBy {
        if paths <= FEW_PATHS { self.few } else { self.many }
    }
}

impl fmt::Display for TraceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (few, many) = (self.few.name(), self.many.name());
        if few == many { f.write_str(few) } else { write!(f, "{few} up to {FEW_PATHS} paths, {many} beyond") }
    }
}

/// Measured times of `trace` with few and with many paths, ms: by threads, then by lanes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct TraceTimes {
    pub(super) few_ms: [f64; 2],
    pub(super) many_ms: [f64; 2],
}

impl TraceTimes {
    /// Lanes where they are at least 5 % faster, else threads.
    pub(super) fn choice(&self) -> TraceChoice {
        let faster = |[path_ms, lanes_ms]: [f64; 2]| {
            if lanes_ms > 0.0 && lanes_ms <= WORTHWHILE * path_ms { TraceBy::Lanes } else { TraceBy::Path }
        };
        TraceChoice { few: faster(self.few_ms), many: faster(self.many_ms) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_are_chosen_where_they_are_faster_by_a_twentieth() {
        let choice = |few_ms, many_ms| TraceTimes { few_ms, many_ms }.choice();
        let lanes = choice([1.0, 0.9], [2.0, 1.7]);
        assert_eq!((lanes.of(256), lanes.of(24_832)), (TraceBy::Lanes, TraceBy::Lanes));
        assert_eq!(lanes.to_string(), "lanes");
        let mixed = choice([1.0, 0.5], [2.0, 1.96]);
        assert_eq!((mixed.of(256), mixed.of(4096), mixed.of(4097)), (TraceBy::Lanes, TraceBy::Lanes, TraceBy::Path));
        assert_eq!(mixed.to_string(), "lanes up to 4096 paths, path beyond");
        for slow in [[1.0, 0.96], [1.0, 2.0], [f64::NAN, 1.0], [1.0, f64::NAN], [1.0, 0.0]] {
            assert_eq!(choice(slow, slow), TraceChoice::from(TraceBy::Path), "{slow:?}");
        }
    }
}
