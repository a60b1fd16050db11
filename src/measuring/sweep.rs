//! Measurement of a station's operating points: reference, times, errors, and effects against theory.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::convergence::{Check, References};
use super::effect_error::{EffectScene, measure_effects, measure_looks};
use super::estimate::{Estimate, Remaining};
use super::harness::Harness;
use super::point::{mark_front, mark_noise};
use super::store::{Store, identity};
use super::{EffectError, Knobs, MeasuringError, Planned, Point, Progress, Step, planned_points};
use crate::anatomy::Scene;
use crate::pose::Pose;
use crate::render::{Backend, Renderer, processor_name};
use crate::settings::ANGLES_MAX;
use crate::station::{Poses, Station, StationError, Track};

/// Target duration of a sweep whose number of poses is not given, s. A slowly converging reference may double it.
const TIME_S: f64 = 270.0;
/// Largest number of poses of such a sweep.
const POSES: usize = 3;

/// Extent of a sweep.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SweepSettings {
    /// Recording whose poses are used. `None`: the station's recording, or its own pose turned about the beam.
    pub recording: Option<PathBuf>,
    /// Number of poses, spread over the recording. `None`: 3, or as many as take about 5 minutes.
    pub poses: Option<usize>,
    /// Whether to measure fewer points at one pose, with a reference of fewer rays.
    pub quick: bool,
    /// Whether stored results are used: of an earlier sweep of the same station, scene, models, poses, machine and
    /// version.
    pub resume: bool,
}

/// A prepared sweep of a station.
#[derive(Debug)]
pub struct Sweep<'a> {
    backend: &'a Backend,
    station: &'a Station,
    scene: &'a Scene,
    quick: bool,
    harness: Harness,
    planned: Vec<Planned>,
    estimate: Estimate,
    tracks: Vec<Track>,
    source: &'static str,
    store: Store,
    machine: Machine,
}

/// Machine on which a sweep runs.
#[derive(Debug, Clone, Serialize)]
pub struct Machine {
    /// Name of the rendering device.
    pub device: String,
    /// Name of the processor.
    pub processor: String,
    /// Number of the processor's threads.
    pub threads: usize,
}

/// Result of a sweep.
#[derive(Debug, Clone, Serialize)]
pub struct SweepReport {
    /// Version of insonify.
    pub version: &'static str,
    /// Station file.
    pub station: PathBuf,
    /// Machine.
    #[serde(flatten)]
    pub machine: Machine,
    /// Number of poses measured.
    pub poses: usize,
    /// Convergence of the reference pictures.
    pub reference: Check,
    /// Operating points, with marks of the Pareto front and of noise.
    pub points: Vec<Point>,
    /// Errors of effects against wave theory.
    pub effects: Vec<EffectError>,
    /// Errors of the post-processing steps against a perfect picture.
    pub looks: Vec<EffectError>,
}

impl<'a> Sweep<'a> {
    /// Loads the station's generators, measures a few frames to estimate the duration, and opens the store of results
    /// in `directory`, which is made if missing. `scene` is the station's.
    ///
    /// # Errors
    /// A station without poses, a scene that cannot be rendered, ONNX Runtime that is missing, or a directory that
    /// cannot be used.
    pub fn prepare(
        backend: &'a Backend,
        station: &'a Station,
        scene: &'a Scene,
        directory: &Path,
        settings: &SweepSettings,
    ) -> Result<Self, MeasuringError> {
        let SweepSettings { ref recording, poses, quick, resume } = *settings;
        let all = Poses::of_station(station, recording.as_deref())?;
        let compounds = station.probe.kind.steers();
        let mut planned = planned_points(Knobs::of(&station.probe, &station.settings), compounds, all.moves(), quick);
        let renderer = Renderer::new(backend, scene, &station.probe, &station.settings)?;
        let mut harness = Harness::new(renderer, station, scene)?;
        planned.extend(harness.planned_generators());
        let first = all.spread(1).first().copied();
        let first = first.ok_or_else(|| StationError::NoPose { station: station.path.clone() })?;
        let estimate = Estimate::measure(&mut harness, &planned, &first)?;
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let machine = Machine { device: backend.to_string(), processor: processor_name(), threads };

        let models = harness.models();
        let mut key = vec![identity(station, scene), models, machine.device.clone(), machine.processor.clone()];
        key.push(format!("{threads} {quick} {recording:?}"));
        let count = match poses {
            Some(count) => count,
            None => poses_in_time(&Store::new(directory, resume, &key)?, &estimate, quick)?,
        };
        let period = Duration::from_secs_f64(1.0 / station.pipeline.frame_rate_hz);
        let tracks = all.tracks(count, ANGLES_MAX, period);
        key.push(format!("{tracks:?}"));
        let store = Store::new(directory, resume, &key)?;
        Ok(Self {
            backend,
            station,
            scene,
            quick,
            harness,
            planned,
            estimate,
            tracks,
            source: all.what,
            store,
            machine,
        })
    }

    /// Number of poses to measure.
    pub fn poses(&self) -> usize {
        self.tracks.len()
    }

    /// Source of the poses, in words.
    pub fn source(&self) -> &'static str {
        self.source
    }

    /// Rendering device.
    pub fn device(&self) -> &str {
        &self.machine.device
    }

    /// Estimated duration of the sweep, s.
    pub fn estimated_s(&self) -> f64 {
        self.estimate.pose_s() * self.tracks.len() as f64
    }

    /// Measures all operating points, effects against wave theory, and post-processing steps.
    ///
    /// # Errors
    /// Frames that cannot be rendered, translated or compared; stored results that are damaged or cannot be written.
    pub fn run(mut self, progress: &Progress<'_>) -> Result<SweepReport, MeasuringError> {
        let poses: Vec<Pose> = self.tracks.iter().map(|track| track.at).collect();
        let mut remaining = Remaining::new(self.estimated_s());
        let started = Instant::now();
        let show = |found| progress(Step::Reference(found));
        let (references, kept) = References::make(&mut self.harness, &self.store, &poses, self.quick, &show)?;
        let reference_s = self.estimate.reference_s * poses.len() as f64;
        remaining.done(reference_s, (!kept).then(|| started.elapsed().as_secs_f64()));
        progress(Step::Converged(&references.check));
        let mut points = self.points(&references, &mut remaining, progress)?;
        mark_front(&mut points);
        mark_noise(&mut points);
        let Self { backend, station, scene, ref store, .. } = self;
        let at = EffectScene { backend, station, scene, pose: poses.first() };
        let effects = measure_effects(&at, store, progress)?;
        let looks = measure_looks(&at, store, progress)?;
        Ok(SweepReport {
            version: env!("CARGO_PKG_VERSION"),
            station: station.path.clone(),
            machine: self.machine,
            poses: poses.len(),
            reference: references.check,
            points,
            effects,
            looks,
        })
    }

    /// Measures the planned points. Stored points are not measured again.
    fn points(
        &mut self,
        references: &References,
        remaining: &mut Remaining,
        progress: &Progress<'_>,
    ) -> Result<Vec<Point>, MeasuringError> {
        let mut points: Vec<Point> = Vec::new();
        for (planned, estimate_s) in self.planned.iter().zip(&self.estimate.points_s) {
            // File names hold the generator's index, because names of generators may differ only in characters that
            // file names lack.
            let generators = || points.iter().filter(|point| point.generator.is_some()).count();
            let file =
                planned.generator.map_or_else(|| planned.name.clone(), |_| format!("generator {}", generators()));
            let started = Instant::now();
            let (point, taken_s) = match self.store.read(&file)? {
                Some(point) => (point, None),
                None => {
                    let point = self.harness.point(planned, &references.pictures, &self.tracks)?;
                    self.store.write(&file, &point)?;
                    (point, Some(started.elapsed().as_secs_f64()))
                }
            };
            remaining.done(estimate_s * self.tracks.len() as f64, taken_s);
            let (number, total) = (points.len() + 1, self.planned.len());
            progress(Step::Point { point: &point, number, total, left_s: remaining.left_s() });
            points.push(point);
        }
        Ok(points)
    }
}

/// Number of poses that fit into [`TIME_S`]. A resumed sweep keeps its number of poses, because estimates vary.
fn poses_in_time(store: &Store, estimate: &Estimate, quick: bool) -> Result<usize, MeasuringError> {
    if let Some(count) = store.read::<usize>("poses")? {
        return Ok(count.clamp(1, POSES));
    }
    let most = if quick { 1 } else { POSES };
    let count = ((TIME_S / estimate.pose_s()) as usize).clamp(1, most);
    store.write("poses", &count)?;
    Ok(count)
}
