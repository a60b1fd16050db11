//! Frame times after a warm-up, variants of a frame measured in turns, and differences of their frame times.

use std::fmt;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::anatomy::Scene;
use crate::pose::Pose;
use crate::render::{Backend, RenderSettings};
use crate::statistics::{median, percentile};
use crate::transducer::Probe;

/// Number of rounds in which variants are measured.
const ROUNDS: usize = 7;
/// Time after which no further round starts, once `ROUNDS_MIN` are done: slow devices measure fewer rounds.
const LONG: Duration = Duration::from_secs(30);
const ROUNDS_MIN: usize = 3;

/// A frame whose time is measured.
#[derive(Debug, Clone)]
pub struct TimedFrame<'a> {
    /// Backend that renders the frame.
    pub backend: &'a Backend,
    /// Scene.
    pub scene: &'a Scene,
    /// Probe.
    pub probe: Probe,
    /// Render settings, with the effects chosen by the plan.
    pub settings: RenderSettings,
    /// Pose of the probe.
    pub pose: Pose,
}

/// Frame time added by an effect or a post-processing step.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Cost {
    /// Median over rounds of the frame time with the effect or step minus the time without, ms.
    cost_ms: f64,
    /// Half the interquartile range of the differences, ms.
    spread_ms: f64,
}

impl Cost {
    /// Cost from the difference of frame times in each round, ms; `None` without a round.
    pub(super) fn of(differences_ms: &[f64]) -> Option<Self> {
        let quartile = |part| percentile(differences_ms, part);
        let spread_ms = 0.5 * (quartile(0.75)? - quartile(0.25)?);
        Some(Self { cost_ms: median(differences_ms)?, spread_ms })
    }

    /// Cost and its spread, ms.
    pub fn ms(self) -> [f64; 2] {
        [self.cost_ms, self.spread_ms]
    }
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let noise = if self.cost_ms.abs() <= self.spread_ms { " noise" } else { "" };
        write!(f, "{:.1} ± {:.1} ms{noise}", self.cost_ms, self.spread_ms)
    }
}

/// Times of `count` frames, ms, after `warm_up` uncounted frames. `frame` makes one frame and returns its time, ms.
///
/// # Errors
/// The first error of `frame`.
pub fn timed<E>(warm_up: usize, count: usize, mut frame: impl FnMut() -> Result<f64, E>) -> Result<Vec<f64>, E> {
    (0..warm_up).try_for_each(|_| frame().map(drop))?;
    (0..count).map(|_| frame()).collect()
}

/// Time that `work` takes, ms.
pub(super) fn elapsed_ms<E>(work: impl FnOnce() -> Result<(), E>) -> Result<f64, E> {
    let started = Instant::now();
    work()?;
    Ok(started.elapsed().as_secs_f64() * 1e3)
}

/// Frame times of one variant, ms.
#[derive(Debug, Clone, Default)]
pub(super) struct VariantTimes {
    /// Median of each round.
    pub(super) rounds_ms: Vec<f64>,
    /// Times of all frames.
    pub(super) all_ms: Vec<f64>,
}

impl VariantTimes {
    /// Frame time of this variant minus that of `other`, ms, by round.
    pub(super) fn over(&self, other: &Self) -> Vec<f64> {
        self.rounds_ms.iter().zip(&other.rounds_ms).map(|(own, other)| own - other).collect()
    }
}

/// Measures `count` variants in turns, round by round. `frames` returns the times of some frames of the variant with
/// the given index, ms.
pub(super) fn in_turns<E>(
    count: usize,
    progress: &dyn Fn(usize, usize),
    mut frames: impl FnMut(usize) -> Result<Vec<f64>, E>,
) -> Result<Vec<VariantTimes>, E> {
    let mut variants = vec![VariantTimes::default(); count];
    let began = Instant::now();
    for round in 0..ROUNDS {
        if round >= ROUNDS_MIN && began.elapsed() > LONG {
            break;
        }
        for (index, variant) in variants.iter_mut().enumerate() {
            let mut frames_ms = frames(index)?;
            variant.rounds_ms.extend(median(&frames_ms));
            variant.all_ms.append(&mut frames_ms);
            progress(round * count + index + 1, ROUNDS * count);
        }
    }
    Ok(variants)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_frames_do_not_count() {
        let mut frames = 0;
        let times = timed(2, 3, || {
            frames += 1;
            Ok::<_, ()>(f64::from(frames))
        });
        assert_eq!(times, Ok(vec![3.0, 4.0, 5.0]));
        assert_eq!(timed(0, 2, || Err::<f64, _>("gone")), Err("gone"));
    }

    #[test]
    fn variants_are_compared_round_by_round() {
        let times = in_turns(2, &|_, _| (), |index| Ok::<_, ()>(vec![1.0, 2.0 + index as f64, 9.0])).unwrap();
        assert_eq!(times[1].over(&times[0]), [1.0; ROUNDS]);
        assert_eq!((times[0].all_ms.len(), times[0].rounds_ms[0]), (3 * ROUNDS, 2.0));
    }
}
