//! Renderer and generators that measure points: frame times, and errors against the reference.

use std::time::Instant;

use super::point_times::Times;
use super::pose_error::{PoseError, classes, rmse, summary};
use super::reference::Reference;
use super::timing::{elapsed_ms, timed};
use super::{Knobs, MeasuringError, Planned, Point};
use crate::anatomy::Scene;
use crate::generator::{Channel, Generator, Input, load_generators};
use crate::pose::Pose;
use crate::quality::level_difference;
use crate::render::{Frame, FrameQuality, Job, Quality, RenderSettings, Renderer};
use crate::settings::ReceiverSettings;
use crate::station::{Station, Track};
use crate::transducer::Probe;

/// Seeds of the frames, other than the reference's seeds. The error's difference between them is its noise.
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

/// Names, of which repeated ones get their number.
pub(super) fn distinct(names: &[&str]) -> Vec<String> {
    let distinct = |(index, name): (usize, &&str)| match names[..index].contains(name) {
        true => format!("{name} ({})", index + 1),
        false => (*name).to_owned(),
    };
    names.iter().enumerate().map(distinct).collect()
}

/// Time of the second of two frames, s, of which `frame` returns ms.
fn second(frame: impl FnMut() -> Result<f64, MeasuringError>) -> Result<f64, MeasuringError> {
    Ok(1e-3 * timed(1, 1, frame)?.iter().sum::<f64>())
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

    /// Identity of the models: their manifests, with checksums of the files that loading has checked.
    pub(super) fn models(&self) -> String {
        self.generators.iter().map(|g| format!("{:?}\n", g.manifest())).collect()
    }

    /// Time of a frame with `knobs`, s.
    pub(super) fn frame_s(&mut self, knobs: &Knobs, pose: &Pose) -> Result<f64, MeasuringError> {
        self.configure(knobs, 0)?;
        second(|| elapsed_ms(|| self.render(pose).map(drop)))
    }

    /// Time of a frame of LQ with a generator, s.
    pub(super) fn generated_s(&mut self, index: usize, pose: &Pose) -> Result<f64, MeasuringError> {
        self.configure(&self.base().with(Quality::LQ.rays, Quality::LQ.layers), 0)?;
        let track = Track { at: *pose, before: Vec::new() };
        let mut image = Vec::new();
        second(|| Ok(self.shown(&track, Some(index), false, &mut image)?.iter().sum()))
    }

    /// Time of comparing a frame with its reference, s.
    pub(super) fn comparison_s(&mut self, pose: &Pose) -> Result<f64, MeasuringError> {
        let range_db = self.settings.image.dynamic_range_db;
        let reference = Reference::of(self.render(pose)?, range_db)?;
        Ok(1e-3 * elapsed_ms(|| self.compared(&reference.bmode, &reference).map(drop))?)
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

    /// Points of the generators on top of the frames that they were trained for.
    pub(super) fn planned_generators(&self) -> Vec<Planned> {
        let names = self.names();
        let planned = |(lq, index): (FrameQuality, usize)| {
            let takes_image = self.generators[index].manifest().takes(Channel::Image);
            let from = if takes_image { lq.to_string() } else { "maps".to_owned() };
            Planned {
                name: format!("{from} + {}", names[index]),
                sweep: "generator",
                against: Some(format!("{}x{}", lq.rays, lq.layers)),
                knobs: self.live_knobs(lq),
                generator: Some(index),
            }
        };
        self.generated_points().into_iter().map(planned).collect()
    }

    /// Distinct names of the generators.
    fn names(&self) -> Vec<String> {
        distinct(&self.generators.iter().map(|g| g.manifest().name.as_str()).collect::<Vec<_>>())
    }

    fn compared(&self, image: &[u8], reference: &Reference) -> Result<PoseError, MeasuringError> {
        Ok(PoseError::of(image, reference, self.settings.image.dynamic_range_db)?)
    }

    /// Measures a point.
    pub(super) fn point(
        &mut self,
        planned: &Planned,
        references: &[Reference],
        tracks: &[Track],
    ) -> Result<Point, MeasuringError> {
        let mut times = Times { ms: vec![Vec::new(); tracks.len()], ..Times::default() };
        let mut errors: Vec<PoseError> = Vec::new();
        let mut image = Vec::new();
        let generator = planned.generator;
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
            generator: generator.and_then(|index| self.names().into_iter().nth(index)),
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

    /// The frame of a live session whose probe moved along the track.
    fn roll(&mut self, track: &Track) -> Result<(), MeasuringError> {
        let angles = self.renderer.settings().look.odd_angles() as usize;
        let skipped = track.before.len().saturating_sub(angles - 1);
        let poses = track.before[skipped..].iter().chain([&track.at]);
        Ok(self.renderer.render_live(poses.map(|&pose| (0.0, pose)), &mut self.frame)?)
    }
}
