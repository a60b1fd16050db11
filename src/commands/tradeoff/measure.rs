//! Measurement of one point: frame times, and errors against the reference.

use std::time::Instant;

use insonify::anatomy::Scene;
use insonify::chooser::GeneratorKey;
use insonify::generator::{Channel, Generator, Input, Manifest, load_generators};
use insonify::pose::Pose;
use insonify::quality::speckle::speckle;
use insonify::quality::structures::{contrast_lost, structures};
use insonify::quality::{ClassSpeckle, ClassStructure, Pair, Scores, level_difference, psnr_db};
use insonify::render::{Frame, FrameQuality, Quality, RenderSettings, Renderer};
use insonify::report::TimeTable;
use insonify::report::time_table::{OVERHEAD, WHOLE_FRAME};
use insonify::settings::ReceiverSettings;
use insonify::station::{Station, Track};
use insonify::statistics::{mean, median, percentile};
use insonify::tradeoff::{ClassError, Errors, Knobs, PassMs, Planned, Point, Time};
use insonify::transducer::Probe;

use super::super::{Classify, Failure};
use super::truth::Truth;

/// Seeds, unlike those of the reference. The error's difference between them is its noise.
const SEEDS: [u32; 2] = [0, 1];
const REPEATS: usize = 2;
/// Fewest steering angles of the reference.
const REFERENCE_ANGLES: u32 = 9;
/// Least time per pose and seed, s; fast points are repeated, at most `REPEATS_MAX` times.
const POSE_S: f64 = 0.25;
const REPEATS_MAX: usize = 8;

/// Time of a pose, s, if a frame takes `frame_s` and a comparison `compare_s`.
pub(super) fn pose_s(frame_s: f64, compare_s: f64) -> f64 {
    let repeats = (POSE_S / frame_s.max(1e-6)).ceil().clamp(REPEATS as f64, REPEATS_MAX as f64);
    SEEDS.len() as f64 * repeats * frame_s + compare_s
}

/// A renderer with the data to measure points.
pub(super) struct Bench {
    renderer: Renderer,
    probe: Probe,
    settings: RenderSettings,
    /// Tissue names from number 1.
    tissues: Vec<String>,
    generators: Vec<Generator>,
    frame: Frame,
}

/// One pose of a point.
struct PoseError {
    rmse: [f64; SEEDS.len()],
    level_rmse: [f64; SEEDS.len()],
    scores: Scores,
    speckle: Vec<ClassSpeckle>,
    structures: Vec<ClassStructure>,
}

/// Times of the frames of a point.
#[derive(Default)]
struct Times {
    table: TimeTable,
    /// Frame times per pose.
    ms: Vec<Vec<f64>>,
    generator_ms: Vec<f64>,
}

/// Name of a generator's point: on top of rendered frames, or of the maps alone if it takes no image.
fn enhanced(generator: &str, lq: FrameQuality, manifest: &Manifest) -> String {
    let from = lq.to_string();
    let from = if manifest.takes(Channel::Image) { from.as_str() } else { "maps" };
    format!("{from} + {generator}")
}

impl Bench {
    pub(super) fn new(renderer: Renderer, station: &Station, scene: &Scene) -> Result<Self, Failure> {
        let tissues = scene.tissues.names().to_vec();
        let loaded = load_generators(&station.generator, &tissues).input()?;
        for refused in &loaded.refused {
            tracing::warn!("{} is left out: {}", refused.path.display(), refused.error);
        }
        // Noise is no error, and differs with the seed. So low it is left out, also with all effects.
        let receiver = ReceiverSettings { noise_db: -400.0, ..station.settings.receiver };
        Ok(Self {
            renderer,
            probe: station.probe,
            settings: RenderSettings { maps: true, lines: false, receiver, ..station.settings },
            tissues,
            generators: loaded.generators,
            frame: Frame::default(),
        })
    }

    /// Names of the generators, in order; repeated names get their number.
    pub(super) fn generators(&self) -> Vec<String> {
        let names: Vec<&str> = self.generators.iter().map(|g| g.manifest().name.as_str()).collect();
        let unlike = |(index, name): (usize, &&str)| {
            if names[..index].contains(name) { format!("{name} ({})", index + 1) } else { (*name).to_owned() }
        };
        names.iter().enumerate().map(unlike).collect()
    }

    /// Identity of the models: their manifests, with checksums of the files that loading has checked.
    pub(super) fn models(&self) -> String {
        self.generators.iter().map(|g| format!("{:?}\n", g.manifest())).collect()
    }

    /// Mean frame time with `knobs` over `poses`, s, after one frame to warm up.
    pub(super) fn frame_s(&mut self, knobs: &Knobs, poses: &[Pose]) -> Result<f64, Failure> {
        self.configure(knobs, 0)?;
        poses.iter().take(1).try_for_each(|pose| self.render(pose).map(drop))?;
        let started = Instant::now();
        poses.iter().try_for_each(|pose| self.render(pose).map(drop))?;
        Ok(started.elapsed().as_secs_f64() / poses.len().max(1) as f64)
    }

    /// Time of a frame of LQ with a generator, s; the first is not counted.
    pub(super) fn generated_s(&mut self, index: usize, poses: &[Pose]) -> Result<f64, Failure> {
        self.configure(&self.base().with(Quality::LQ.rays, Quality::LQ.layers), 0)?;
        let Some(&at) = poses.first() else { return Ok(0.0) };
        let track = Track { at, before: Vec::new() };
        let mut image = Vec::new();
        self.shown(&track, Some(index), false, &mut image)?;
        Ok(1e-3 * self.shown(&track, Some(index), false, &mut image)?.iter().sum::<f64>())
    }

    /// Time of comparing a frame with its reference, s.
    pub(super) fn comparison_s(&mut self, poses: &[Pose]) -> Result<f64, Failure> {
        let Some(pose) = poses.first() else { return Ok(0.0) };
        let range_db = self.settings.image.dynamic_range_db;
        let truth = Truth::of(self.render(pose)?, range_db)?;
        let started = Instant::now();
        self.compare(&truth.bmode, &truth)?;
        Ok(started.elapsed().as_secs_f64())
    }

    pub(super) fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    /// The station's knobs, for one look.
    pub(super) fn base(&self) -> Knobs {
        Knobs::of(&self.probe, &self.settings).compounded(1, false)
    }

    /// Knobs of a live frame.
    pub(super) fn live_knobs(&self, quality: FrameQuality) -> Knobs {
        let knobs = self.base().with(quality.rays, quality.layers).compounded(quality.angles, quality.angles > 1);
        if quality.aperture { knobs } else { knobs.without_aperture() }
    }

    /// Steering angles of the reference.
    pub(super) fn reference_angles(&self) -> u32 {
        if self.probe.kind.steers() { self.settings.look.odd_angles().max(REFERENCE_ANGLES) } else { 1 }
    }

    pub(super) fn configure(&mut self, knobs: &Knobs, seed: u32) -> Result<(), Failure> {
        let (probe, settings) = knobs.apply(&self.probe, &self.settings, seed);
        Ok(self.renderer.reconfigure(&probe, &settings)?)
    }

    pub(super) fn render(&mut self, pose: &Pose) -> Result<&Frame, Failure> {
        self.renderer.set_image(true);
        self.renderer.render(pose, &mut self.frame)?;
        Ok(&self.frame)
    }

    /// Measures a point.
    pub(super) fn point(&mut self, planned: &Planned, truths: &[Truth], tracks: &[Track]) -> Result<Point, Failure> {
        self.measure(planned, None, truths, tracks)
    }

    /// Generators by index, each with every quality of frames that it takes.
    pub(super) fn generated_points(&self) -> Vec<(FrameQuality, usize)> {
        let all = self.generators.iter().enumerate();
        all.flat_map(|(index, generator)| generator.manifest().lq().into_iter().map(move |lq| (lq, index))).collect()
    }

    /// Identity of a generator.
    pub(super) fn key(&self, index: usize) -> Option<GeneratorKey> {
        self.generators.get(index).map(GeneratorKey::of)
    }

    /// Error of a live frame with two seeds, grey levels.
    pub(super) fn live_error(
        &mut self,
        quality: FrameQuality,
        generator: Option<usize>,
        truth: &Truth,
        track: &Track,
    ) -> Result<[f64; 2], Failure> {
        let knobs = self.live_knobs(quality);
        let mut image = Vec::new();
        let mut errors = [0.0; SEEDS.len()];
        for (error, seed) in errors.iter_mut().zip(SEEDS) {
            self.configure(&knobs, seed)?;
            self.shown(track, generator, knobs.rolling, &mut image)?;
            *error = rmse(&image, truth)?;
        }
        Ok(errors)
    }

    /// Measures a generator on top of the frames that it was trained for.
    pub(super) fn generated(
        &mut self,
        (lq, index): (FrameQuality, usize),
        name: String,
        truths: &[Truth],
        tracks: &[Track],
    ) -> Result<Point, Failure> {
        let planned = Planned {
            name: self.generators.get(index).map_or_else(|| name.clone(), |g| enhanced(&name, lq, g.manifest())),
            sweep: "generator",
            against: Some(format!("{}x{}", lq.rays, lq.layers)),
            knobs: self.live_knobs(lq),
        };
        Ok(Point { generator: Some(name), ..self.measure(&planned, Some(index), truths, tracks)? })
    }

    fn measure(
        &mut self,
        planned: &Planned,
        generator: Option<usize>,
        truths: &[Truth],
        tracks: &[Track],
    ) -> Result<Point, Failure> {
        let mut times = Times { ms: vec![Vec::new(); tracks.len()], ..Times::default() };
        let mut errors: Vec<PoseError> = Vec::new();
        let mut image = Vec::new();
        for (turn, seed) in SEEDS.into_iter().enumerate() {
            self.configure(&planned.knobs, seed)?;
            let rolling = planned.knobs.rolling;
            for (index, (track, truth)) in tracks.iter().zip(truths).enumerate() {
                if turn == 0 && index == 0 {
                    // Not counted: includes uploads for the new settings.
                    self.shown(track, generator, rolling, &mut image)?;
                }
                let (mut done, mut spent_s) = (0, 0.0);
                while done < REPEATS || (spent_s < POSE_S && done < REPEATS_MAX) {
                    let [render_ms, generator_ms] = self.shown(track, generator, rolling, &mut image)?;
                    times.table.push(&self.frame.times);
                    times.ms[index].push(render_ms + generator_ms);
                    times.generator_ms.push(generator_ms);
                    spent_s += 1e-3 * (render_ms + generator_ms);
                    done += 1;
                }
                if turn == 0 {
                    errors.push(self.compare(&image, truth)?);
                }
                if let Some(error) = errors.get_mut(index) {
                    error.rmse[turn] = rmse(&image, truth)?;
                    error.level_rmse[turn] = level_difference(&truth.pair(&image)?)?[1];
                }
            }
        }
        let classes = self.classes(&errors, truths);
        Ok(Point {
            name: planned.name.clone(),
            sweep: planned.sweep.to_owned(),
            against: planned.against.clone(),
            knobs: planned.knobs,
            generator: None,
            time: times.time(),
            error: summary(&errors, &classes),
            classes,
            on_front: false,
            time_is_noise: false,
            error_is_noise: false,
        })
    }

    /// Renders, without the image if the generator takes none, and runs the generator if given. With `rolling` the frames
    /// before come first, and the last one's time counts. Returns both times, ms.
    fn shown(
        &mut self,
        track: &Track,
        generator: Option<usize>,
        rolling: bool,
        image: &mut Vec<u8>,
    ) -> Result<[f64; 2], Failure> {
        let needed =
            generator.and_then(|index| self.generators.get(index)).is_none_or(|g| g.manifest().takes(Channel::Image));
        self.renderer.set_image(needed);
        if rolling {
            self.roll(track)?;
        } else {
            self.renderer.render(&track.at, &mut self.frame)?;
        }
        let started = Instant::now();
        match generator.and_then(|index| self.generators.get_mut(index)) {
            Some(generator) => generator.run(&Input::from(&self.frame), image)?,
            None => {
                image.clone_from(&self.frame.bmode);
                return Ok([self.frame.times.total_ms, 0.0]);
            }
        }
        Ok([self.frame.times.total_ms, 1e3 * started.elapsed().as_secs_f64()])
    }

    /// The frame of a live session that came this way.
    fn roll(&mut self, track: &Track) -> Result<(), Failure> {
        let angles = self.renderer.settings().look.odd_angles() as usize;
        let skipped = track.before.len().saturating_sub(angles - 1);
        let poses = track.before[skipped..].iter().chain([&track.at]);
        Ok(self.renderer.render_live(poses.map(|&pose| (0.0, pose)), &mut self.frame)?)
    }

    fn compare(&self, image: &[u8], truth: &Truth) -> Result<PoseError, Failure> {
        let range_db = self.settings.image.dynamic_range_db;
        Ok(PoseError {
            rmse: [0.0; SEEDS.len()],
            level_rmse: [0.0; SEEDS.len()],
            scores: Scores::of(&truth.pair(image)?),
            speckle: speckle(image, &truth.segmentation, truth.size, range_db)?,
            structures: structures(image, &truth.bmode, &truth.segmentation, truth.size)?,
        })
    }

    /// Errors by tissue: means over poses, grey differences weighted by pixels.
    fn classes(&self, errors: &[PoseError], truths: &[Truth]) -> Vec<ClassError> {
        let of = |number: usize, tissue: &String| {
            let is = |class: u8| usize::from(class) == number;
            let structures: Vec<&ClassStructure> =
                errors.iter().flat_map(|e| &e.structures).filter(|s| is(s.class)).collect();
            let pixels: usize = structures.iter().map(|s| s.pixels).sum();
            let snr = |all: &mut dyn Iterator<Item = &ClassSpeckle>| {
                mean(all.filter(|s| is(s.class)).filter_map(|s| s.envelope_snr))
            };
            (pixels > 0).then(|| ClassError {
                tissue: tissue.clone(),
                pixels,
                grey_difference: structures.iter().map(|s| s.grey_difference * s.pixels as f64).sum::<f64>()
                    / pixels as f64,
                envelope_snr: snr(&mut errors.iter().flat_map(|e| &e.speckle)),
                reference_snr: snr(&mut truths.iter().flat_map(|t| &t.speckle)),
                contrast_lost: mean(structures.iter().filter_map(|s| s.contrast_lost)),
            })
        };
        self.tissues.iter().enumerate().filter_map(|(index, tissue)| of(index + 1, tissue)).collect()
    }
}

impl Times {
    fn time(&self) -> Time {
        let all = self.ms.concat();
        let part = |part| percentile(&all, part).unwrap_or(f64::NAN);
        // Differences between poses are not noise.
        let less_median = |pose: &Vec<f64>| {
            let median = median(pose).unwrap_or(0.0);
            pose.iter().map(|ms| ms - median).collect::<Vec<_>>()
        };
        let rest = self.ms.iter().flat_map(less_median).collect::<Vec<_>>();
        let rest = |part| percentile(&rest, part).unwrap_or(f64::NAN);
        let stages = self.table.stages().into_iter().filter(|s| ![OVERHEAD, WHOLE_FRAME].contains(&s.stage));
        let mut passes: Vec<PassMs> =
            stages.map(|s| PassMs { name: s.stage.to_owned(), median_ms: s.p50_ms }).collect();
        let generator = median(&self.generator_ms).filter(|ms| *ms > 0.0);
        passes.extend(generator.map(|median_ms| PassMs { name: "generator".to_owned(), median_ms }));
        Time { frames: all.len(), median_ms: part(0.5), p95_ms: part(0.95), spread_ms: rest(0.75) - rest(0.25), passes }
    }
}

fn summary(errors: &[PoseError], classes: &[ClassError]) -> Errors {
    let over = |of: &dyn Fn(&PoseError) -> f64| mean(errors.iter().map(of)).unwrap_or(f64::NAN);
    let pixels_of = [0, 1].map(|turn| over(&|e| e.rmse[turn]));
    let levels_of = [0, 1].map(|turn| over(&|e| e.level_rmse[turn]));
    let middle = |[first, second]: [f64; 2]| 0.5 * (first + second);
    let spread = |[first, second]: [f64; 2]| (first - second).abs();
    let finite = errors.iter().map(|e| e.scores.psnr_db).filter(|db| db.is_finite());
    let pixels: usize = classes.iter().map(|c| c.pixels).sum();
    let grey: f64 = classes.iter().map(|c| c.grey_difference.abs() * c.pixels as f64).sum();
    Errors {
        level_rmse: middle(levels_of),
        level_rmse_spread: spread(levels_of),
        rmse: middle(pixels_of),
        rmse_spread: spread(pixels_of),
        psnr_db: mean(finite).unwrap_or(f64::INFINITY),
        identical: errors.iter().filter(|e| e.scores.psnr_db.is_infinite()).count(),
        ssim: over(&|e| e.scores.ssim),
        pkl: mean(errors.iter().filter_map(|e| e.scores.pkl)),
        snr_difference: mean(classes.iter().filter_map(|c| Some(c.envelope_snr? - c.reference_snr?))),
        grey_difference: grey / pixels.max(1) as f64,
        contrast_lost: mean(errors.iter().filter_map(|e| contrast_lost(&e.structures))),
    }
}

fn rmse(image: &[u8], truth: &Truth) -> Result<f64, Failure> {
    let pair: Pair<'_> = truth.pair(image)?;
    Ok(255.0 * 10f64.powf(-psnr_db(&pair) / 20.0))
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
