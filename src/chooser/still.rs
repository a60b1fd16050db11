//! Quality of stills within a time budget.

use std::fmt;

use super::candidates::own_quality;
use crate::measuring::{ErrorMeasure, ErrorTable, MeasuringError, timed};
use crate::pose::{Pose, ProbeSpeed};
use crate::render::{BackendError, Effect, Frame, FrameQuality, RenderError, Renderer};
use crate::settings::RenderSettings;
use crate::statistics::{sorted, upper_median};
use crate::transducer::Probe;

/// Timed frames of each quality, after one uncounted frame. Their median counts.
const FRAMES: usize = 3;

/// Quality chosen for stills, and the measured times behind the choice.
#[derive(Debug, Clone, PartialEq)]
pub struct StillQuality {
    /// Largest time of a frame, ms.
    pub frame_budget_ms: f64,
    /// The quality with the least error within the budget; if none keeps the budget, the one with the fewest paths.
    pub quality: FrameQuality,
    /// Expected error, grey levels. Stills without the effect `aperture` have the error of stills with it.
    pub error: f64,
    /// Which error that is.
    pub measure: ErrorMeasure,
    /// Median frame time of `quality`, ms; `None` if no valid time was measured.
    pub frame_ms: Option<f64>,
    /// First quality that exceeds the budget, and its time, ms. The time is `None` if the device lacks memory for the
    /// quality.
    pub beyond: Option<(FrameQuality, Option<f64>)>,
}

impl StillQuality {
    /// Whether the quality keeps the budget.
    pub fn fits(&self) -> bool {
        self.frame_ms.is_some_and(|ms| ms <= self.frame_budget_ms)
    }
}

impl fmt::Display for StillQuality {
    /// Writes the quality with its time and error, and the time of the next quality.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { frame_budget_ms, quality, error, measure, frame_ms, beyond } = self;
        let Some(ms) = frame_ms else {
            return write!(f, "{quality}, whose frames gave no time to hold against {frame_budget_ms} ms");
        };
        if !self.fits() {
            return write!(f, "nothing keeps {frame_budget_ms} ms here; {quality} is the least, and takes {ms:.1} ms");
        }
        write!(f, "{quality}, {ms:.1} ms of {frame_budget_ms}")?;
        // The table has no errors of stills without the effect `aperture`.
        if quality.aperture {
            write!(f, ", {error:.1} grey levels off the converged picture ({measure})")?;
        }
        match beyond {
            None => Ok(()),
            Some((next, Some(ms))) => write!(f, "; {next} takes {ms:.1} ms"),
            Some((next, None)) => write!(f, "; {next} is more than the device has room for"),
        }
    }
}

/// Chooses the quality of stills, and configures the renderer with `probe`, `settings` and that quality. Qualities come
/// from the shipped error table; angles, aperture and seed from `settings`.
///
/// Qualities are timed in order of their number of paths, until one takes more than `frame_budget_ms`. Their frames
/// cycle through `poses`. `scene` is the station's [`scene_name`](crate::measuring::scene_name).
///
/// # Errors
/// The table can't be read, or a frame can't be rendered. A quality beyond the device's memory only ends the search.
pub fn choose_still(
    renderer: &mut Renderer,
    scene: &str,
    probe: &Probe,
    settings: &RenderSettings,
    poses: &[Pose],
    frame_budget_ms: f64,
) -> Result<StillQuality, MeasuringError> {
    let own = own_quality(settings, probe);
    let expected = ErrorTable::shipped()?.expected(scene, probe);
    let mut points: Vec<(FrameQuality, f64)> = Vec::new();
    for known in expected.qualities().into_iter().filter(|quality| quality.aperture) {
        let quality = FrameQuality { rays: known.rays, layers: known.layers, ..own };
        let error = expected.of(FrameQuality { coarse: false, aperture: true, ..quality }, None, ProbeSpeed::AtRest);
        if let Some(error) = error
            && points.iter().all(|(point, _)| *point != quality)
        {
            points.push((quality, error));
        }
    }
    let aperture = settings.effects.of(Effect::Aperture);
    let mut poses = poses.iter().cycle();
    let mut frame = Frame::default();
    let first = points.first().map(|(quality, _)| *quality);
    let chosen = search(&points, expected.measure, own, frame_budget_ms, |quality| {
        match renderer.reconfigure(probe, &quality.apply(settings, aperture)) {
            Ok(()) => {}
            // The cheapest quality has to work.
            Err(RenderError::Backend(BackendError::Limit { .. } | BackendError::Memory { .. }))
                if Some(quality) != first =>
            {
                return Ok(None);
            }
            Err(error) => return Err(error),
        }
        let Some(pose) = poses.next() else { return Ok(None) };
        renderer.render(pose, &mut frame)?;
        Ok(Some(frame.times.total_ms))
    })?;
    renderer.reconfigure(probe, &chosen.quality.apply(settings, aperture))?;
    Ok(chosen)
}

/// Chooses among `points`: qualities with their errors in `measure`, by increasing number of paths. Without points it
/// chooses `own`. `frame_ms` renders a frame and returns its time, ms, or `None` if the device has no room for it.
/// Invalid times are ignored.
fn search<E>(
    points: &[(FrameQuality, f64)],
    measure: ErrorMeasure,
    own: FrameQuality,
    frame_budget_ms: f64,
    mut frame_ms: impl FnMut(FrameQuality) -> Result<Option<f64>, E>,
) -> Result<StillQuality, E> {
    let &(least, error) = points.first().unwrap_or(&(own, 0.0));
    let mut chosen = StillQuality { frame_budget_ms, quality: least, error, measure, frame_ms: None, beyond: None };
    for &(quality, error) in points {
        // `Err(None)` means that the device has no room.
        let frames = timed(1, FRAMES, || frame_ms(quality).map_err(Some)?.ok_or(None));
        let ms = match frames {
            Ok(ms) => upper_median(&sorted(ms.into_iter().filter(|ms| ms.is_finite()))),
            Err(Some(error)) => return Err(error),
            Err(None) => {
                chosen.beyond = Some((quality, None));
                return Ok(chosen);
            }
        };
        let fits = ms.is_some_and(|ms| ms <= frame_budget_ms);
        if quality == least || (fits && error < chosen.error) {
            (chosen.quality, chosen.error, chosen.frame_ms) = (quality, error, ms);
        }
        if !fits {
            chosen.beyond = (quality != least).then_some((quality, ms));
            break;
        }
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use ErrorMeasure::Pixels;

    use super::*;
    use crate::transducer::ProbeKind;

    /// Qualities of a table, with errors that fall as the number of paths grows.
    fn points() -> Vec<(FrameQuality, f64)> {
        let of = |(rays, layers): (u32, u32)| (FrameQuality::new(rays, layers), 20.0 / f64::from(rays * layers).sqrt());
        [(1, 1), (1, 3), (2, 3), (4, 3), (8, 3), (32, 3)].map(of).to_vec()
    }

    /// Result on a machine that takes 10 ms plus `per_path` ms per path, and the number of frames rendered.
    fn searched(points: &[(FrameQuality, f64)], frame_budget_ms: f64, per_path: f64) -> (StillQuality, usize) {
        let mut frames = 0;
        let found = search::<()>(points, Pixels, FrameQuality::LQ, frame_budget_ms, |quality| {
            frames += 1;
            // The first frame of each quality compiles shaders.
            let warm = if frames % 4 == 1 { 1000.0 } else { 0.0 };
            Ok(Some(10.0 + per_path * f64::from(quality.paths()) + warm))
        });
        (found.unwrap(), frames)
    }

    #[test]
    fn the_best_quality_within_the_budget_is_chosen_and_one_more_measured() {
        let (found, frames) = searched(&points(), 40.0, 2.0);
        assert_eq!((found.quality, found.frame_ms, found.fits()), (FrameQuality::new(4, 3), Some(34.0), true));
        assert_eq!((found.beyond, frames), (Some((FrameQuality::new(8, 3), Some(58.0))), 5 * 4));
    }

    #[test]
    fn all_may_fit_and_none_may() {
        let (all, _) = searched(&points(), 1e4, 2.0);
        assert_eq!((all.quality, all.beyond), (FrameQuality::new(32, 3), None));
        let (none, frames) = searched(&points(), 5.0, 2.0);
        assert_eq!((none.quality, none.fits(), none.beyond, frames), (FrameQuality::LQ, false, None, 4));
    }

    #[test]
    fn a_quality_of_more_paths_and_a_greater_error_is_not_chosen() {
        let mut points = points();
        points[3].1 = 2.0 * points[2].1;
        assert_eq!(searched(&points, 40.0, 2.0).0.quality, FrameQuality::new(2, 3));
    }

    #[test]
    fn times_that_are_no_number_are_left_out() {
        let mut frames = 0;
        let found = search::<()>(&points(), Pixels, FrameQuality::LQ, 40.0, |_| {
            frames += 1;
            Ok(Some(if frames % 4 == 2 { f64::NAN } else { 12.0 }))
        });
        assert_eq!(found.unwrap().frame_ms, Some(12.0));
        let found = search::<()>(&points(), Pixels, FrameQuality::LQ, 40.0, |_| Ok(Some(f64::INFINITY))).unwrap();
        assert_eq!((found.quality, found.fits(), found.frame_ms), (FrameQuality::LQ, false, None));
    }

    #[test]
    fn a_refused_quality_ends_the_search_and_a_fault_is_handed_on() {
        let found =
            search::<()>(&points(), Pixels, FrameQuality::LQ, 40.0, |q| Ok((q.rays < 4).then_some(5.0))).unwrap();
        assert_eq!((found.quality, found.fits()), (FrameQuality::new(2, 3), true));
        assert_eq!(found.beyond, Some((FrameQuality::new(4, 3), None)));
        assert_eq!(search(&points(), Pixels, FrameQuality::LQ, 40.0, |_| Err("gone")), Err("gone"));
    }

    #[test]
    fn the_shipped_table_knows_stills_of_every_probe() {
        let kinds = [
            ProbeKind::Convex { radius_mm: 40.0, fov_deg: 70.0 },
            ProbeKind::Linear { width_mm: 40.0 },
            ProbeKind::Phased { fov_deg: 90.0 },
        ];
        for (scene, kind) in ["obstetric", "unknown"].into_iter().flat_map(|scene| kinds.map(|kind| (scene, kind))) {
            let probe = Probe { kind, ..Probe::default() };
            let expected = ErrorTable::shipped().unwrap().expected(scene, &probe);
            let known = |rays| expected.qualities().contains(&FrameQuality::new(rays, if rays == 1 { 1 } else { 3 }));
            assert!([1, 2, 8, 32].into_iter().all(known), "{scene}, {kind:?}: {:?}", expected.qualities());
        }
    }
}
