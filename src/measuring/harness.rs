//! Renderer and generators that measure operating points: their frame times, and their errors against the reference.

use serde::{Deserialize, Serialize};

use super::point_times::Times;
use super::pose_error::{PoseError, classes, rmse, summary};
use super::reference::Reference;
use super::timing::{elapsed_ms, timed};
use super::{Knobs, MeasuringError, Planned, Point, timed_needle};
use crate::anatomy::Scene;
use crate::generator::{Channel, Generator, Input, load_generators};
use crate::pose::Pose;
use crate::quality::{SeenError, seen_error};
use crate::render::{Frame, FrameQuality, Job, Quality, RenderSettings, Renderer};
use crate::settings::ReceiverSettings;
use crate::station::{Station, Track};
use crate::transducer::Probe;

/// Seeds of measured frames, which the reference does not use. The noise of an error is its difference between them.
const SEEDS: [u32; 2] = [0, 1];
const REPEATS: usize = 2;
/// Fewest steering angles of the reference.
const REFERENCE_ANGLES: u32 = 9;
/// Least measuring time per pose and seed, s. Fast frames are repeated, at most `REPEATS_MAX` times.
const POSE_S: f64 = 0.25;
const REPEATS_MAX: usize = 8;

/// Time to measure one pose, s, if a frame takes `frame_s` and a comparison `compare_s`.
pub(super) fn pose_s(frame_s: f64, compare_s: f64) -> f64 {
    let repeats = (POSE_S / frame_s.max(1e-6)).ceil().clamp(REPEATS as f64, REPEATS_MAX as f64);
    SEEDS.len() as f64 * repeats * frame_s + compare_s
}

/// Errors of a live frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct LiveError {
    /// RMS difference of pixels, grey levels.
    pub(crate) rmse: f64,
    /// Error that an eye sees.
    pub(crate) seen: SeenError,
}

/// A renderer with the data to measure points.
#[derive(Debug)]
pub(crate) struct Harness {
    renderer: Renderer,
    probe: Probe,
    settings: RenderSettings,
    /// Tissue names, from class number 1.
    tissues: Vec<String>,
    generators: Vec<Generator>,
    frame: Frame,
}

/// `names` made unique: a repeated name gets its position in the list, such as `fast (2)`.
pub(super) fn distinct(names: &[&str]) -> Vec<String> {
    let distinct = |(index, name): (usize, &&str)| match names[..index].contains(name) {
        true => format!("{name} ({})", index + 1),
        false => (*name).to_owned(),
    };
    names.iter().enumerate().map(distinct).collect()
}

/// Time of the second of two calls of `frame`, s. `frame` returns its time in ms.
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
        // Receiver noise differs with the seed and must not count as an error. At −400 dB it is never simulated, not
        // even with all effects.
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

    /// Identity of the generators: their manifests, with checksums of the files that loading has checked.
    pub(super) fn models(&self) -> String {
        self.generators.iter().map(|g| format!("{:?}\n", g.manifest())).collect()
    }

    /// Time of a frame with `knobs`, s.
    pub(super) fn frame_s(&mut self, knobs: &Knobs, pose: &Pose) -> Result<f64, MeasuringError> {
        self.configure(knobs, 0)?;
        second(|| elapsed_ms(|| self.render(pose).map(drop)))
    }

    /// Time of an LQ frame with the generator of this index, s.
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

    /// The station's knobs (quality settings), but with one steering angle.
    pub(crate) fn base(&self) -> Knobs {
        Knobs::of(&self.probe, &self.settings).compounded(1, false)
    }

    /// Whether coarse samples are fewer than the probe's own.
    pub(super) fn takes_coarse_samples(&self) -> bool {
        self.probe.has_coarse_samples()
    }

    /// Knobs of a live frame of this quality. Several angles are compounded over successive frames.
    pub(super) fn live_knobs(&self, quality: FrameQuality) -> Knobs {
        let knobs = self.base().with(quality.rays, quality.layers).compounded(quality.angles, quality.angles > 1);
        let knobs = knobs.sampled(&self.probe, quality.coarse);
        if quality.aperture { knobs } else { knobs.without_aperture() }
    }

    /// Number of steering angles of the reference.
    pub(super) fn reference_angles(&self) -> u32 {
        if self.probe.kind.steers() { self.settings.look.odd_angles().max(REFERENCE_ANGLES) } else { 1 }
    }

    pub(super) fn configure(&mut self, knobs: &Knobs, seed: u32) -> Result<(), MeasuringError> {
        let (probe, settings) = knobs.apply(&self.probe, &self.settings, seed);
        Ok(self.renderer.reconfigure(&probe, &settings)?)
    }

    pub(super) fn render(&mut self, pose: &Pose) -> Result<&Frame, MeasuringError> {
        self.renderer.set_image(true);
        self.renderer.set_needle(timed_needle(&self.settings, &self.probe, pose));
        self.renderer.render(pose, &mut self.frame)?;
        Ok(&self.frame)
    }

    /// Renders frames at `poses`, several at once, with the seed of the settings. `each` receives them in order.
    pub(super) fn render_many(
        &mut self,
        poses: &[Pose],
        mut each: impl FnMut(&Frame) -> Result<(), MeasuringError>,
    ) -> Result<(), MeasuringError> {
        self.renderer.set_image(true);
        let seed = self.renderer.settings().quality.seed;
        let needle = |pose: &Pose| timed_needle(&self.settings, &self.probe, pose);
        let jobs = poses.iter().map(|&pose| Job { pose, time_s: 0.0, seed, needle: needle(&pose) });
        self.renderer.render_many(jobs, |_, frame| each(frame))
    }

    /// Each generator's index, paired with each frame quality that the generator takes.
    pub(crate) fn generated_points(&self) -> Vec<(FrameQuality, usize)> {
        let all = self.generators.iter().enumerate();
        all.flat_map(|(index, generator)| generator.manifest().lq().into_iter().map(move |lq| (lq, index))).collect()
    }

    /// Generator of this index.
    pub(crate) fn generator(&self, index: usize) -> Option<&Generator> {
        self.generators.get(index)
    }

    /// Errors of a live frame with two seeds.
    pub(crate) fn live_error(
        &mut self,
        quality: FrameQuality,
        generator: Option<usize>,
        reference: &Reference,
        track: &Track,
    ) -> Result<[LiveError; 2], MeasuringError> {
        let knobs = self.live_knobs(quality);
        let mut image = Vec::new();
        let mut of_seed = |seed: u32| {
            self.configure(&knobs, seed)?;
            self.shown(track, generator, knobs.rolling, &mut image)?;
            let seen = seen_error(&reference.pair(&image)?)?;
            Ok::<_, MeasuringError>(LiveError { rmse: rmse(&image, reference)?, seen })
        };
        let [first, second] = SEEDS;
        Ok([of_seed(first)?, of_seed(second)?])
    }

    /// Operating points of the generators, on frames of the qualities that they were trained for.
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

    /// Measures the time and errors of an operating point.
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
                    // Not counted: this frame also uploads the new settings.
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
                    error.seen[turn] = seen_error(&reference.pair(&image)?)?;
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

    /// Renders a frame, without its image if the generator takes none, and runs the generator if given. With `rolling`,
    /// the frames before it on the track are rendered first, uncounted. Returns the times of the render and of the
    /// generator, ms.
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
        self.renderer.set_needle(timed_needle(&self.settings, &self.probe, &track.at));
        if rolling {
            self.roll(track)?;
        } else {
            self.renderer.render(&track.at, &mut self.frame)?;
        }
        let generator_ms = match generator.and_then(|index| self.generators.get_mut(index)) {
            Some(generator) => elapsed_ms(|| generator.run(&Input::from(&self.frame), image))?,
            None => {
                image.clone_from(&self.frame.bmode);
                0.0
            }
        };
        Ok([self.frame.times.total_ms, generator_ms])
    }

    /// Renders the last frame of a live session whose probe moved along `track`.
    fn roll(&mut self, track: &Track) -> Result<(), MeasuringError> {
        let angles = self.renderer.settings().look.odd_angles() as usize;
        let skipped = track.before.len().saturating_sub(angles - 1);
        let poses = track.before[skipped..].iter().chain([&track.at]);
        Ok(self.renderer.render_live(poses.map(|&pose| (0.0, pose)), &mut self.frame)?)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::render::{Backend, BackendChoice};

    #[test]
    fn frames_hold_the_needle_of_the_station() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/needle_cyst.toml");
        let station = Station::load(&path).unwrap();
        let scene = station.load_scene_from(station.scene_file().unwrap()).unwrap();
        let backend = Backend::open(BackendChoice::Host).unwrap();
        let pixels = |needle| {
            let station = Station { settings: RenderSettings { needle, ..station.settings }, ..station.clone() };
            let renderer = Renderer::new(&backend, &scene, &station.probe, &station.settings).unwrap();
            let mut harness = Harness::new(renderer, &station, &scene).unwrap();
            let mut frames = vec![harness.render(&Pose::IDENTITY).unwrap().segmentation.clone()];
            let keep = |frame: &Frame| {
                frames.push(frame.segmentation.clone());
                Ok(())
            };
            harness.render_many(&[Pose::IDENTITY], keep).unwrap();
            let track = Track { at: Pose::IDENTITY, before: vec![Pose::IDENTITY; 2] };
            harness.shown(&track, None, true, &mut Vec::new()).unwrap();
            frames.push(harness.frame.segmentation);
            let number = scene.tissues.names().iter().position(|name| name == "needle").map(|at| at as u8 + 1);
            frames
                .iter()
                .map(|frame| frame.iter().filter(|&&tissue| Some(tissue) == number).count())
                .collect::<Vec<_>>()
        };
        assert!(pixels(station.settings.needle).iter().all(|&count| count > 100));
        assert_eq!(pixels(None), [0; 3]);
    }
}
