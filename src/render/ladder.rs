//! Measurement of the best quality whose frames keep a budget on this machine.

use super::error::{BackendError, RenderError};
use super::frame::Frame;
use super::preset::QualityPoint;
use super::renderer::Renderer;
use crate::pose::Pose;
use crate::settings::RenderSettings;
use crate::statistics::upper_median;
use crate::transducer::Probe;

/// Rungs of the [`LADDER`].
pub const RUNGS: usize = 9;

/// Points that a budget chooses from, in rising cost: each has two or three times the paths of the one before. Layers
/// come before rays: they improve a frame more for their time (README).
pub const LADDER: [QualityPoint; RUNGS] = [
    QualityPoint::new(1, 1),
    QualityPoint::new(1, 3),
    QualityPoint::new(2, 3),
    QualityPoint::new(4, 3),
    QualityPoint::new(8, 3),
    QualityPoint::new(16, 3),
    QualityPoint::new(32, 3),
    QualityPoint::new(64, 3),
    QualityPoint::new(128, 3),
];

/// Timed frames per rung, after one that warms it up. Their median counts.
const FRAMES: usize = 3;

/// Result of climbing the quality ladder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Climbed {
    /// Time that a frame may take, ms.
    pub budget_ms: f64,
    /// The best rung within the budget; 0 if there is none.
    pub rung: usize,
    /// Median time of a frame of each rung, ms; None if it was not reached or the device refuses it.
    pub frame_ms: [Option<f64>; RUNGS],
}

impl Climbed {
    /// The point chosen.
    pub fn point(&self) -> QualityPoint {
        LADDER[self.rung.min(RUNGS - 1)]
    }

    /// Time of the chosen point's frames, ms.
    pub fn chosen_ms(&self) -> Option<f64> {
        self.frame_ms.get(self.rung).copied().flatten()
    }

    /// Whether the chosen point keeps the budget.
    pub fn fits(&self) -> bool {
        self.chosen_ms().is_some_and(|ms| ms <= self.budget_ms)
    }
}

/// Climbs the ladder up to the first rung over the budget. `frame_ms` renders a frame of a point and returns its time,
/// ms, or None if the device has no room for such frames. Times that are not finite are ignored.
///
/// # Errors
/// As `frame_ms`.
pub fn climb<E>(
    budget_ms: f64,
    mut frame_ms: impl FnMut(QualityPoint) -> Result<Option<f64>, E>,
) -> Result<Climbed, E> {
    let mut climbed = Climbed { budget_ms, rung: 0, frame_ms: [None; RUNGS] };
    for (rung, point) in LADDER.into_iter().enumerate() {
        let mut times = [f64::NAN; FRAMES];
        let mut known = 0;
        for frame in 0..=FRAMES {
            let Some(ms) = frame_ms(point)? else { return Ok(climbed) };
            if frame > 0 && ms.is_finite() {
                times[known] = ms;
                known += 1;
            }
        }
        times[..known].sort_by(f64::total_cmp);
        climbed.frame_ms[rung] = upper_median(&times[..known]);
        if !climbed.frame_ms[rung].is_some_and(|ms| ms <= budget_ms) {
            break;
        }
        climbed.rung = rung;
    }
    Ok(climbed)
}

impl Renderer {
    /// Measures which point of the [`LADDER`] keeps the budget at `poses`, in turn, and switches to `probe` and
    /// `settings` with that quality. The seed is kept. Frames are timed one by one, from submission until they are in
    /// memory.
    ///
    /// # Errors
    /// As [`Renderer::reconfigure`] and [`Renderer::render`], except that a rung without room
    /// ends the ladder.
    pub fn choose_quality(
        &mut self,
        probe: &Probe,
        settings: &RenderSettings,
        poses: &[Pose],
        budget_ms: f64,
    ) -> Result<Climbed, RenderError> {
        let of = |point: QualityPoint| RenderSettings { quality: point.with_seed(settings.quality.seed), ..*settings };
        let mut poses = poses.iter().cycle();
        let mut frame = Frame::default();
        let climbed = climb(budget_ms, |point| {
            match self.reconfigure(probe, &of(point)) {
                Ok(()) => {}
                // The cheapest point must work.
                Err(RenderError::Backend(BackendError::Limit { .. } | BackendError::Memory { .. }))
                    if point != LADDER[0] =>
                {
                    return Ok(None);
                }
                Err(error) => return Err(error),
            }
            let Some(pose) = poses.next() else { return Ok(None) };
            self.render(pose, &mut frame)?;
            Ok(Some(frame.times.total_ms))
        })?;
        self.reconfigure(probe, &of(climbed.point()))?;
        Ok(climbed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::preset::Preset;
    use crate::settings::Quality;

    /// Climbs on a machine that takes 10 ms plus `per_path` ms per path.
    fn climbed(budget_ms: f64, per_path: f64) -> (Climbed, usize) {
        let mut frames = 0;
        let climbed = climb::<()>(budget_ms, |point| {
            frames += 1;
            // The first of each rung compiles.
            let warm = if frames % 4 == 1 { 1000.0 } else { 0.0 };
            Ok(Some(10.0 + per_path * f64::from(point.paths()) + warm))
        });
        (climbed.unwrap(), frames)
    }

    #[test]
    fn paths_double_or_triple_from_rung_to_rung() {
        assert!(LADDER.windows(2).all(|w| (2..=3).contains(&(w[1].paths() / w[0].paths()))));
        assert!(LADDER.windows(2).all(|w| w[1].paths() % w[0].paths() == 0));
    }

    #[test]
    fn presets_are_points_of_the_ladder_in_rising_cost() {
        let rungs: Vec<_> = Preset::ALL.map(|preset| LADDER.iter().position(|point| *point == preset.point())).into();
        assert!(rungs.iter().all(Option::is_some) && rungs.is_sorted(), "{rungs:?}");
        assert_eq!(Preset::Fast.point().with_seed(0), Quality::LQ);
        assert_eq!(Preset::Accurate.point().with_seed(0), Quality::HQ);
    }

    #[test]
    fn the_best_rung_within_the_budget_is_chosen_and_one_more_measured() {
        let (found, frames) = climbed(40.0, 2.0);
        assert_eq!((found.point(), found.chosen_ms(), found.fits()), (QualityPoint::new(4, 3), Some(34.0), true));
        assert_eq!((found.frame_ms[4], found.frame_ms[5], frames), (Some(58.0), None, 5 * 4));
    }

    #[test]
    fn the_whole_ladder_may_fit_and_none_may() {
        assert_eq!(climbed(1e4, 2.0).0.point(), QualityPoint::new(128, 3));
        let (none, frames) = climbed(5.0, 2.0);
        assert_eq!((none.point(), none.fits(), frames), (QualityPoint::new(1, 1), false, 4));
    }

    #[test]
    fn times_that_are_no_number_are_left_out() {
        let mut frames = 0;
        let found = climb::<()>(40.0, |_| {
            frames += 1;
            Ok(Some(if frames % 4 == 2 { f64::NAN } else { 12.0 }))
        });
        assert_eq!(found.unwrap().frame_ms, [Some(12.0); RUNGS]);
        let found = climb::<()>(40.0, |_| Ok(Some(f64::INFINITY))).unwrap();
        assert_eq!((found.rung, found.fits(), found.chosen_ms()), (0, false, None));
    }

    #[test]
    fn a_refused_rung_ends_the_ladder_and_a_fault_is_handed_on() {
        let found = climb::<()>(40.0, |point| Ok((point.rays < 4).then_some(5.0))).unwrap();
        assert_eq!((found.point(), found.fits()), (QualityPoint::new(2, 3), true));
        assert_eq!(climb(40.0, |_| Err("gone")), Err("gone"));
    }
}
