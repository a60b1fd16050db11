//! Statistics of a generator's run times.

use std::fmt;

use serde::Serialize;

use super::{Generator, GeneratorError};
use crate::statistics::{nearest_rank, sorted};

/// Run times on frames of one size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RunTimes {
    /// Width of the frames, pixels.
    pub width: u32,
    /// Height of the frames, pixels.
    pub height: u32,
    /// Number of timed runs.
    pub runs: usize,
    /// Shortest run time, ms.
    pub min_ms: f64,
    /// Median run time, ms.
    pub p50_ms: f64,
    /// 95th percentile of the run times, ms.
    pub p95_ms: f64,
}

impl Generator {
    /// Statistics of `runs` runs that [`Generator::measure`] times; `None` if `runs` is 0.
    ///
    /// # Errors
    /// Errors of [`Generator::run`].
    pub fn times(&mut self, width: u32, height: u32, runs: usize) -> Result<Option<RunTimes>, GeneratorError> {
        let measured = self.measure(width, height, runs)?;
        let times = sorted(measured.into_iter().map(|time| time.as_secs_f64() * 1e3));
        let ms = |part| nearest_rank(&times, part);
        let [Some(min_ms), Some(p50_ms), Some(p95_ms)] = [0.0, 0.5, 0.95].map(ms) else { return Ok(None) };
        Ok(Some(RunTimes { width, height, runs, min_ms, p50_ms, p95_ms }))
    }
}

impl fmt::Display for RunTimes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width, height, runs, min_ms, p50_ms, p95_ms } = self;
        write!(f, "{width} x {height}: p50 {p50_ms:.1} ms, p95 {p95_ms:.1} ms, least {min_ms:.1} ms of {runs} runs")
    }
}
