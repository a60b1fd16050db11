//! Operating points (a frame quality, with or without a generator) open to a station, with their errors and times.

use super::control::Candidate;
use super::times::Times;
use crate::generator::{Generator, Quality};
use crate::measuring::{ErrorMeasure, ExpectedErrors, GeneratorKey};
use crate::pose::BySpeed;
use crate::render::{Choice, Effect, FrameQuality};
use crate::settings::RenderSettings;
use crate::station::Station;
use crate::transducer::Probe;

/// Assumed ratio of output error to input error, for a generator without a known one.
const UNMEASURED: f64 = 0.9;
/// Training target for which a generator's own error ratio is comparable with the error table.
const TARGET: FrameQuality = FrameQuality { angles: 9, ..FrameQuality::new(32, 3) };

/// Properties of a generator that decide the choice.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Model {
    pub(super) key: GeneratorKey,
    /// Frame qualities that the generator takes.
    pub(super) lq: Vec<FrameQuality>,
    pub(super) reads_maps: bool,
    /// Ratio of output error to input error, from the PSNRs in its manifest. `None` if one is missing, or if its
    /// training target isn't [`TARGET`].
    pub(super) error_ratio: Option<f64>,
}

impl Model {
    pub(super) fn of(generator: &Generator) -> Self {
        let manifest = generator.manifest();
        let target = manifest.training.as_ref().and_then(|training| training.hq);
        let quality = manifest.quality.as_ref().filter(|_| target == Some(TARGET));
        Self {
            key: GeneratorKey::of(generator),
            lq: manifest.lq(),
            reads_maps: manifest.reads_maps(),
            error_ratio: quality.and_then(error_ratio),
        }
    }
}

/// Ratio of output error to input error from a manifest's PSNRs; `None` if the input's is missing or the ratio is
/// invalid.
fn error_ratio(quality: &Quality) -> Option<f64> {
    let ratio = 10f64.powf((quality.lq_psnr_db? - quality.psnr_db) / 20.0);
    (ratio.is_finite() && ratio > 0.0).then_some(ratio)
}

/// Frame quality that `settings` request. A probe that doesn't steer has one angle.
pub(super) fn own_quality(settings: &RenderSettings, probe: &Probe) -> FrameQuality {
    let own = FrameQuality::of(settings);
    FrameQuality { angles: if probe.kind.steers() { own.angles } else { 1 }, ..own }
}

/// Parts of the frame quality that a station leaves open, for the controller to choose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Open {
    /// Frame quality in the station's own settings.
    pub(super) own: FrameQuality,
    /// Whether the number of steering angles may be chosen.
    angles: bool,
    /// Whether samples may be coarse.
    coarse: bool,
    /// Whether the effect `aperture` may be omitted.
    aperture: bool,
}

impl Open {
    pub(super) fn of(station: &Station) -> Self {
        let own = own_quality(&station.settings, &station.probe);
        let steers = station.probe.kind.steers();
        let aperture = station.settings.effects.of(Effect::Aperture) != Choice::On;
        // A single angle of a fixed quality counts as open: the hint then compares the same points as with a budget.
        let angles = station.angles_open || (station.frame_budget_ms.is_none() && own.angles == 1);
        let coarse = station.probe.has_coarse_samples();
        Self { own, angles: angles && steers, coarse, aperture }
    }

    /// Returns a quality of the error table if the station allows it; `None` if the station fixes other values of
    /// angles, samples or aperture.
    fn here(&self, quality: FrameQuality) -> Option<FrameQuality> {
        let angles = self.angles || quality.angles == self.own.angles;
        let aperture = if quality.aperture { self.own.aperture } else { self.aperture || !self.own.aperture };
        let samples = self.coarse || !quality.coarse;
        (angles && samples && aperture).then_some(quality)
    }

    /// Quality that this station renders as input of a generator that takes `quality`. The effect `aperture` is
    /// omitted if the station has none. `None` if the station fixes another number of angles.
    fn below_generator(&self, quality: FrameQuality) -> Option<FrameQuality> {
        let angles = self.angles || quality.angles == self.own.angles;
        angles.then_some(FrameQuality { aperture: quality.aperture && self.own.aperture, ..quality })
    }

    /// Qualities to measure, by increasing number of paths: qualities of the error table that the station allows,
    /// inputs of generators, and the station's own quality.
    pub(super) fn qualities(&self, expected: &ExpectedErrors<'_>, models: &[Model]) -> Vec<FrameQuality> {
        let angles = |quality: FrameQuality| if self.angles { quality.angles } else { self.own.angles };
        let of_table =
            expected.qualities().into_iter().map(|quality| FrameQuality { angles: angles(quality), ..quality });
        let generated = models.iter().flat_map(|model| &model.lq).filter_map(|&quality| self.below_generator(quality));
        let mut qualities = Vec::new();
        for quality in of_table.filter_map(|quality| self.here(quality)).chain(generated).chain([self.own]) {
            if !qualities.contains(&quality) {
                qualities.push(quality);
            }
        }
        qualities.sort_by_key(|quality| (quality.paths(), quality.layers, quality.angles));
        qualities
    }

    /// All operating points with a known error and time.
    pub(super) fn candidates(
        &self,
        expected: &ExpectedErrors<'_>,
        qualities: &[FrameQuality],
        models: &[Model],
        times: &Times,
    ) -> Vec<Candidate> {
        let raw = qualities.iter().filter_map(|&quality| {
            let (error, render_ms) = (expected.by_speed(quality, None)?, times.render(quality, false)?);
            Some(Candidate { quality, generator: None, error, render_ms, run_ms: 0.0 })
        });
        let generated = models.iter().enumerate();
        let generated =
            generated.flat_map(|(index, model)| model.lq.iter().map(move |&trained_on| (index, model, trained_on)));
        let generated = generated.filter_map(|(index, model, trained_on)| {
            let quality = self.below_generator(trained_on)?;
            let known = expected.by_speed(trained_on, Some(&model.key));
            // Manifest and error table were measured on different frames, so only the manifest's ratio is comparable. It
            // is one of pixel errors, which says nothing about texture.
            let ratio = model.error_ratio.filter(|_| expected.measure == ErrorMeasure::Pixels).unwrap_or(UNMEASURED);
            let by_ratio = || Some(expected.by_speed(quality, None)?.times(ratio));
            let error = known.or_else(by_ratio)?;
            let (render_ms, run_ms) = (times.render(quality, model.reads_maps)?, times.run(&model.key)?);
            Some(Candidate { quality, generator: Some(index), error, render_ms, run_ms })
        });
        raw.chain(generated).collect()
    }

    /// Operating points at the station's own quality: generators in their order, then the raw frame. Their `error` is
    /// only a rank, from 1.
    pub(super) fn fixed(&self, models: &[Model], times: &Times) -> Vec<Candidate> {
        let quality = self.own;
        // 0 means an unknown time; the controller then assumes a render load of 1.
        let render_ms = times.render(quality, true).unwrap_or(0.0);
        let of = |(rank, model): (usize, &Model)| {
            let (error, run_ms) = (BySpeed::all(1.0 + rank as f64), times.run(&model.key)?);
            Some(Candidate { quality, generator: Some(rank), error, render_ms, run_ms })
        };
        let error = BySpeed::all(1.0 + models.len() as f64);
        let raw = Candidate { quality, generator: None, error, render_ms, run_ms: 0.0 };
        models.iter().enumerate().filter_map(of).chain([raw]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measuring::{ErrorTable, PointError, StationErrors};
    use crate::transducer::{Probe, ProbeKind};

    const ROLLING: FrameQuality = FrameQuality { angles: 9, ..FrameQuality::new(2, 3) };

    fn model(name: &str, sha256: &str, lq: FrameQuality, error_ratio: Option<f64>) -> Model {
        let key = GeneratorKey { name: name.into(), sha256: sha256.into() };
        Model { key, lq: vec![lq], reads_maps: false, error_ratio }
    }

    /// Times that grow with the number of paths, and 20 ms for each generator run.
    fn times(qualities: &[FrameQuality], models: &[Model]) -> Times {
        let mut times = Times::default();
        for quality in qualities {
            times.insert([quality.rays, quality.layers], Some(20.0 + 2.0 * f64::from(quality.paths())));
        }
        models.iter().for_each(|model| times.insert_run(&model.key, 20.0));
        times.insert_differences(4.0, 3.0, 0.7);
        times
    }

    /// Qualities to measure at a station, and its candidates on a machine with [`times`].
    fn found(open: &Open, expected: &ExpectedErrors<'_>, models: &[Model]) -> (Vec<FrameQuality>, Vec<Candidate>) {
        let qualities = open.qualities(expected, models);
        let found = open.candidates(expected, &qualities, models, &times(&qualities, models));
        (qualities, found)
    }

    fn open(angles: u32, angles_open: bool) -> Open {
        let own = FrameQuality { angles, ..FrameQuality::LQ };
        Open { own, angles: angles_open, coarse: true, aperture: true }
    }

    #[test]
    fn angles_that_the_table_lacks_have_the_errors_of_the_nearest() {
        let expected = ErrorTable::shipped().unwrap().expected("obstetric", &Probe::default());
        for (angles, like) in [(7, 9), (5, 3), (15, 9), (1, 1)] {
            let open = open(angles, false);
            let (qualities, found) = found(&open, &expected, &[]);
            assert!(qualities.len() > 5 && qualities.iter().all(|quality| quality.angles == angles), "{qualities:?}");
            assert_eq!(found.len(), qualities.len());
            let known = expected.by_speed(FrameQuality { angles: like, ..FrameQuality::LQ }, None);
            let lq = found.iter().find(|c| c.quality == open.own).unwrap();
            assert_eq!(Some(lq.error), known, "{angles} angles");
        }
    }

    #[test]
    fn probes_that_do_not_steer_have_points_of_one_angle() {
        let phased = Probe { kind: ProbeKind::Phased { fov_deg: 90.0 }, ..Probe::default() };
        let expected = ErrorTable::shipped().unwrap().expected("lung", &phased);
        assert!(!found(&open(1, false), &expected, &[]).1.is_empty());
    }

    #[test]
    fn fixed_angles_and_effects_hold_for_generators_and_frames() {
        let expected = ErrorTable::shipped().unwrap().expected("obstetric", &Probe::default());
        let rolling = [model("rolling", "ab", ROLLING, None)];
        let of = |open: Open| found(&open, &expected, &rolling).1;
        assert!(of(open(1, false)).iter().all(|c| c.quality.angles == 1 && c.generator.is_none()));
        assert!(of(open(9, false)).iter().any(|c| c.quality == ROLLING && c.generator == Some(0)));
        assert!(of(open(1, true)).iter().any(|c| c.generator == Some(0)));
        assert!(of(open(1, true)).iter().any(|c| !c.quality.aperture));
        let kept = Open { aperture: false, ..open(1, true) };
        assert!(of(kept).iter().all(|c| c.quality.aperture));
        let without = Open { own: FrameQuality { aperture: false, ..FrameQuality::LQ }, ..open(1, true) };
        assert!(of(without).iter().all(|c| !c.quality.aperture));
        assert!(of(open(1, true)).iter().any(|c| c.quality.coarse));
        assert!(of(Open { coarse: false, ..open(1, true) }).iter().all(|c| !c.quality.coarse));
    }

    #[test]
    fn a_generator_nobody_has_measured_is_a_little_better_than_its_input() {
        for (seen, gain) in [(None, 0.8), (Some(6.0), UNMEASURED)] {
            let point = PointError::fixture(ROLLING, None, 20.0);
            let point = seen.map_or(point.clone(), |whole| point.with_seen(whole));
            let station = StationErrors::fixture("obstetric", "convex", vec![point]);
            let table = ErrorTable { stations: vec![station], ..ErrorTable::new(String::new()) };
            a_generators_error_is_estimated(&table.expected("obstetric", &Probe::default()), gain);
        }
    }

    /// Checks the errors of two generators that the table lacks, one of them with a manifest's ratio of 0.8. The latter
    /// has the error of its input times `gain`.
    fn a_generators_error_is_estimated(expected: &ExpectedErrors<'_>, gain: f64) {
        let open = open(1, true);
        let models = [model("own", "ab", ROLLING, None), model("compounded", "cd", ROLLING, Some(0.8))];
        let (qualities, found) = found(&open, expected, &models);
        let error = |generator| found.iter().find(|c| c.quality == ROLLING && c.generator == generator).unwrap().error;
        assert_eq!([error(Some(0)), error(Some(1))], [error(None).times(UNMEASURED), error(None).times(gain)]);
        // Without a measured run, the generator is no candidate.
        let mut half = times(&qualities, &models[..1]);
        half.insert([2, 3], Some(30.0));
        assert!(open.candidates(expected, &qualities, &models, &half).iter().all(|c| c.generator != Some(1)));
    }

    #[test]
    fn a_models_own_figures_count_as_their_ratio() {
        let quality = |lq_psnr_db| Quality { psnr_db: 30.0, ssim: 0.9, lq_psnr_db, pkl: None, fid: None };
        // The generator's data set is easier than the table's scenes: 30 dB are 8 grey levels.
        let ratio = error_ratio(&quality(Some(28.0))).unwrap();
        assert!((ratio - 10f64.powf(-0.1)).abs() < 1e-12, "{ratio}");
        assert_eq!([error_ratio(&quality(None)), error_ratio(&quality(Some(f64::NAN)))], [None; 2]);
    }

    #[test]
    fn a_fixed_quality_ranks_the_generators_as_the_station_does() {
        let models = [model("first", "ab", FrameQuality::LQ, None), model("second", "cd", FrameQuality::LQ, None)];
        let open = Open { own: FrameQuality::new(32, 3), ..open(1, false) };
        let known = open.fixed(&models, &times(&[open.own], &models));
        assert_eq!(
            known.iter().map(|c| (c.generator, c.error.at_rest)).collect::<Vec<_>>(),
            [(Some(0), 1.0), (Some(1), 2.0), (None, 3.0)]
        );
        assert_eq!(known[0].render_ms, 20.0 + 2.0 * 96.0 + 4.0);
        let unknown = open.fixed(&models, &times(&[], &models));
        assert!(unknown.iter().all(|c| c.render_ms == 0.0));
    }
}
