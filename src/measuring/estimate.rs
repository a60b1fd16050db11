//! Estimated duration of a sweep, and its remaining time.

use super::convergence::USUAL;
use super::harness::{Harness, pose_s};
use super::{Knobs, MeasuringError, Planned};
use crate::pose::Pose;

/// Estimated time of measuring one pose, s.
#[derive(Debug)]
pub(super) struct Estimate {
    pub(super) reference_s: f64,
    /// Times of the planned points.
    pub(super) points_s: Vec<f64>,
}

/// Frame time as a linear function of the number of paths.
struct Line {
    one_s: f64,
    path_s: f64,
}

impl Line {
    /// Fits the times of two frames: of 1 ray × 1 layer, and of 8 rays × 3 layers.
    fn of(harness: &mut Harness, base: Knobs, pose: &Pose) -> Result<Self, MeasuringError> {
        let one_s = harness.frame_s(&base.with(1, 1), pose)?;
        let middle_s = harness.frame_s(&base.with(8, 3), pose)?;
        Ok(Self { one_s, path_s: ((middle_s - one_s) / 23.0).max(0.0) })
    }

    fn frame_s(&self, paths: u32) -> f64 {
        self.one_s + self.path_s * f64::from(paths - 1)
    }
}

impl Estimate {
    /// Measures two frames with the station's effects, two with all effects, one frame of each generator, and one
    /// comparison.
    pub(super) fn measure(harness: &mut Harness, planned: &[Planned], pose: &Pose) -> Result<Self, MeasuringError> {
        let base = harness.base();
        let own = Line::of(harness, base, pose)?;
        let all = Line::of(harness, base.with_all_effects(), pose)?;
        let compare_s = harness.comparison_s(pose)?;
        let point_s = |p: &Planned| {
            let line = if p.knobs.all_effects { &all } else { &own };
            // A rolling picture needs one frame per angle before it is measured.
            pose_s(f64::from(p.knobs.angles) * line.frame_s(p.knobs.rays * p.knobs.layers), compare_s)
        };
        let points_s = planned.iter().map(|p| match p.generator {
            Some(index) => Ok(pose_s(harness.generated_s(index, pose)?, compare_s)),
            None => Ok(point_s(p)),
        });
        let points_s = points_s.collect::<Result<_, MeasuringError>>()?;
        let angles = f64::from(harness.reference_angles());
        Ok(Self {
            reference_s: angles * USUAL.iter().map(|&(rays, layers)| all.frame_s(rays * layers)).sum::<f64>(),
            points_s,
        })
    }

    /// Time of measuring all points and the reference at one pose, s.
    pub(super) fn pose_s(&self) -> f64 {
        self.reference_s + self.points_s.iter().sum::<f64>()
    }
}

/// Remaining time. The ratio of actual to estimated time so far corrects it.
#[derive(Default)]
pub(super) struct Remaining {
    left_s: f64,
    /// Estimated and actual time of the parts measured so far, s.
    estimated_s: f64,
    taken_s: f64,
}

impl Remaining {
    pub(super) fn new(total_s: f64) -> Self {
        Self { left_s: total_s, ..Self::default() }
    }

    /// Records that a part estimated at `estimate_s` took `taken_s`; `None` for a part read from the store.
    pub(super) fn done(&mut self, estimate_s: f64, taken_s: Option<f64>) {
        self.left_s = (self.left_s - estimate_s).max(0.0);
        if let Some(taken_s) = taken_s {
            self.estimated_s += estimate_s;
            self.taken_s += taken_s;
        }
    }

    /// Corrected remaining time, s.
    pub(super) fn left_s(&self) -> f64 {
        let slower = if self.estimated_s > 0.0 { self.taken_s / self.estimated_s } else { 1.0 };
        self.left_s * slower
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_remaining_time_corrects_itself() {
        let mut remaining = Remaining::new(100.0);
        assert_eq!(remaining.left_s(), 100.0);
        remaining.done(20.0, None);
        assert_eq!(remaining.left_s(), 80.0);
        remaining.done(30.0, Some(60.0));
        assert_eq!(remaining.left_s(), 100.0);
        remaining.done(60.0, Some(75.0));
        assert_eq!(remaining.left_s(), 0.0);
    }
}
