//! Renderer and generators that measure points: frame times, and errors against the reference.

use std::time::Instant;

use super::point_times::Times;
use super::pose_error::{PoseError, classes, rmse, summary};
use super::reference::Reference;
use super::{Knobs, MeasuringError, Planned, Point};
use crate::anatomy::Scene;
use crate::generator::{Channel, Generator, Input, Manifest, load_generators};
use crate::pose::Pose;
use crate::quality::level_difference;
use crate::render::{Frame, FrameQuality, Job, Quality, RenderSettings, Renderer};
use crate::settings::ReceiverSettings;
use crate::station::{Station, Track};
use crate::transducer::Probe;

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
#[derive(Debug)]
pub(crate) struct Harness {
    renderer: Renderer,
    probe: Probe,
    settings: RenderSettings,
    /// Tissue names from number 1.
    tissues: Vec<String>,
    generators: Vec<Generator>,
    frame: Frame,
}

/// Name of a generator's point: on top of raw frames, or of the maps alone if it takes no image.
fn generated(generator: &str, lq: FrameQuality, manifest: &Manifest) -> String {
    let from = lq.to_string();
    let from = if manifest.takes(Channel::Image) { from.as_str() } else { "maps" };
    format!("{from} + {generator}")
}

impl Harness {
    pub(crate) fn new(renderer: Renderer, station: &Station, scene: &Scene) -> Result<Self, MeasuringError> {
        let tissues = scene.tissues.names().to_vec();
        let loaded = load_generators(&station.generator, &tissues)?;
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
    pub(super) fn frame_s(&mut self, knobs: &Knobs, poses: &[Pose]) -> Result<f64, MeasuringError> {
        self.configure(knobs, 0)?;
        poses.iter().take(1).try_for_each(|pose| self.render(pose).map(drop))?;
        let started = Instant::now();
        poses.iter().try_for_each(|pose| self.render(pose).map(drop))?;
        Ok(started.elapsed().as_secs_f64() / poses.len().max(1) as f64)
    }

    /// Time of a frame of LQ with a generator, s; the first is not counted.
    pub(super) fn generated_s(&mut self, index: usize, poses: &[Pose]) -> Result<f64, MeasuringError> {
        self.configure(&self.base().with(Quality::LQ.rays, Quality::LQ.layers), 0)?;
        let Some(&at) = poses.first() else { return Ok(0.0) };
        let track = Track { at, before: Vec::new() };
        let mut image = Vec::new();
        self.shown(&track, Some(index), false, &mut image)?;
        Ok(1e-3 * self.shown(&track, Some(index), false, &mut image)?.iter().sum::<f64>())
    }

    /// Time of comparing a frame with its reference, s.
    pub(super) fn comparison_s(&mut self, poses: &[Pose]) -> Result<f64, MeasuringError> {
        let Some(pose) = poses.first() else { return Ok(0.0) };
        let range_db = self.settings.image.dynamic_range_db;
        let reference = Reference::of(self.render(pose)?, range_db)?;
        let started = Instant::now();
        self.compared(&reference.bmode, &reference)?;
        Ok(started.elapsed().as_secs_f64())
    }

    pub(super) fn settings(&self) -> &RenderSettings {
        &self.settings
    }

    /// The station's knobs, for one angle.
    pub(crate) fn base(&self) -> Knobs {
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

    pub(super) fn configure(&mut self, knobs: &Knobs, seed: u32) -> Result<(), MeasuringError> {
        let (probe, settings) = knobs.apply(&self.probe, &self.settings, seed);
        Ok(self.renderer.reconfigure(&probe, &settings)?)
    }

    pub(super) fn render(&mut self, pose: &Pose) -> Result<&Frame, MeasuringError> {
        self.renderer.set_image(true);
        self.renderer.render(pose, &mut self.frame)?;
        Ok(&self.frame)
    }

    /// Renders frames at `poses` with the seed of the settings, several at once; `each` receives them in order.
    pub(super) fn render_many(
        &mut self,
        poses: &[Pose],
        mut each: impl FnMut(&Frame) -> Result<(), MeasuringError>,
    ) -> Result<(), MeasuringError> {
        self.renderer.set_image(true);
        let seed = self.renderer.settings().quality.seed;
        let jobs = poses.iter().map(|&pose| Job { pose, time_s: 0.0, seed });
        self.renderer.render_many(jobs, |_, frame| each(frame))
    }

    /// Measures a point.
    pub(super) fn point(
        &mut self,
        planned: &Planned,
        references: &[Reference],
        tracks: &[Track],
    ) -> Result<Point, MeasuringError> {
        self.measure(planned, None, references, tracks)
    }

    /// Generators by index, each with every quality of frames that it takes.
    pub(crate) fn generated_points(&self) -> Vec<(FrameQuality, usize)> {
        let all = self.generators.iter().enumerate();
        all.flat_map(|(index, generator)| generator.manifest().lq().into_iter().map(move |lq| (lq, index))).collect()
    }

    /// Generator with an index.
    pub(crate) fn generator(&self, index: usize) -> Option<&Generator> {
        self.generators.get(index)
    }

    /// Error of a live frame with two seeds, grey levels.
    pub(crate) fn live_error(
        &mut self,
        quality: FrameQuality,
        generator: Option<usize>,
        reference: &Reference,
        track: &Track,
    ) -> Result<[f64; 2], MeasuringError> {
        let knobs = self.live_knobs(quality);
        let mut image = Vec::new();
        let mut errors = [0.0; SEEDS.len()];
        for (error, seed) in errors.iter_mut().zip(SEEDS) {
            self.configure(&knobs, seed)?;
            self.shown(track, generator, knobs.rolling, &mut image)?;
            *error = rmse(&image, reference)?;
        }
        Ok(errors)
    }

    /// Measures a generator on top of the frames that it was trained for.
    pub(super) fn generated(
        &mut self,
        (lq, index): (FrameQuality, usize),
        name: String,
        references: &[Reference],
        tracks: &[Track],
    ) -> Result<Point, MeasuringError> {
        let planned = Planned {
            name: self.generators.get(index).map_or_else(|| name.clone(), |g| generated(&name, lq, g.manifest())),
            sweep: "generator",
            against: Some(format!("{}x{}", lq.rays, lq.layers)),
            knobs: self.live_knobs(lq),
        };
        Ok(Point { generator: Some(name), ..self.measure(&planned, Some(index), references, tracks)? })
    }

    fn compared(&self, image: &[u8], reference: &Reference) -> Result<PoseError, MeasuringError> {
        Ok(PoseError::of(image, reference, self.settings.image.dynamic_range_db)?)
    }

    fn measure(
        &mut self,
        planned: &Planned,
        generator: Option<usize>,
        references: &[Reference],
        tracks: &[Track],
    ) -> Result<Point, MeasuringError> {
        let mut times = Times { ms: vec![Vec::new(); tracks.len()], ..Times::default() };
        let mut errors: Vec<PoseError> = Vec::new();
        let mut image = Vec::new();
        for (turn, seed) in SEEDS.into_iter().enumerate() {
            self.configure(&planned.knobs, seed)?;
            let rolling = planned.knobs.rolling;
            for (index, (track, reference)) in tracks.iter().zip(references).enumerate() {
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
                    errors.push(self.compared(&image, reference)?);
                }
                if let Some(error) = errors.get_mut(index) {
                    error.rmse[turn] = rmse(&image, reference)?;
                    error.level_rmse[turn] = level_difference(&reference.pair(&image)?)?[1];
                }
            }
        }
        let classes = classes(&self.tissues, &errors, references);
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
    ) -> Result<[f64; 2], MeasuringError> {
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
    fn roll(&mut self, track: &Track) -> Result<(), MeasuringError> {
        let angles = self.renderer.settings().look.odd_angles() as usize;
        let skipped = track.before.len().saturating_sub(angles - 1);
        let poses = track.before[skipped..].iter().chain([&track.at]);
        Ok(self.renderer.render_live(poses.map(|&pose| (0.0, pose)), &mut self.frame)?)
    }
}
