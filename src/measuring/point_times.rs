//! Frame times of an operating point.

use super::{PassMs, Time};
use crate::report::TimeTable;
use crate::report::time_table::{HOST_STAGES, OVERHEAD, WHOLE_FRAME};
use crate::statistics::{median, percentile};

/// Times of the frames of an operating point.
#[derive(Default)]
pub(super) struct Times {
    pub(super) table: TimeTable,
    /// Frame times of each pose, ms.
    pub(super) ms: Vec<Vec<f64>>,
    pub(super) generator_ms: Vec<f64>,
}

impl Times {
    pub(super) fn time(&self) -> Time {
        let all = self.ms.concat();
        let part = |part| percentile(&all, part).unwrap_or(f64::NAN);
        // Differences between poses are not noise.
        let less_median = |pose: &Vec<f64>| {
            let median = median(pose).unwrap_or(0.0);
            pose.iter().map(|ms| ms - median).collect::<Vec<_>>()
        };
        let rest = self.ms.iter().flat_map(less_median).collect::<Vec<_>>();
        let rest = |part| percentile(&rest, part).unwrap_or(f64::NAN);
        let is_pass = |stage: &str| ![OVERHEAD, WHOLE_FRAME].contains(&stage) && !HOST_STAGES.contains(&stage);
        let stages = self.table.stages().into_iter().filter(|s| is_pass(s.stage));
        let mut passes: Vec<PassMs> =
            stages.map(|s| PassMs { name: s.stage.to_owned(), median_ms: s.p50_ms }).collect();
        let generator = median(&self.generator_ms).filter(|ms| *ms > 0.0);
        passes.extend(generator.map(|median_ms| PassMs { name: "generator".to_owned(), median_ms }));
        Time { frames: all.len(), median_ms: part(0.5), p95_ms: part(0.95), spread_ms: rest(0.75) - rest(0.25), passes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_is_that_of_repeats_and_not_of_poses() {
        let times = Times { ms: vec![vec![10.0, 11.0, 12.0], vec![100.0, 101.0, 102.0]], ..Times::default() };
        let time = times.time();
        assert_eq!((time.frames, time.median_ms, time.spread_ms), (6, 56.0, 1.5));
    }
}
