//! Rendering for commands: scene, warnings, and frames in order.

use std::path::{Path, PathBuf};

use insonify::anatomy::Scene;
use insonify::files::cache_directory;
use insonify::phantom::{self, PhantomFile};
use insonify::pose::Pose;
use insonify::render::{Backend, EffectPlan, FRAMES_IN_FLIGHT, Frame, RenderSettings, Renderer};
use insonify::sink::frame_record::AdapterRecord;
use insonify::station::{SceneSource, Station};
use insonify::transducer::Probe;

use super::progress::Progress;
use super::{Failure, quality};

/// Name and driver of the backend.
pub(crate) fn adapter(backend: &Backend) -> AdapterRecord {
    AdapterRecord { name: backend.name(), driver: backend.driver() }
}

/// The surfaces of a station, from its file or from the cache of generated scenes.
pub(crate) fn load_scene(station: &Station) -> Result<Scene, Failure> {
    Ok(station.load_scene_from(scene_file(station)?.path())?)
}

/// File of a station's surfaces.
pub(crate) enum SceneFile {
    Given(PathBuf),
    Generated(PhantomFile),
}

impl SceneFile {
    pub(crate) fn path(&self) -> &Path {
        match self {
            Self::Given(path) => path,
            Self::Generated(file) => &file.path,
        }
    }
}

/// File of a station's surfaces; a generated scene is built and cached if missing.
pub(crate) fn scene_file(station: &Station) -> Result<SceneFile, Failure> {
    match &station.scene {
        SceneSource::File(path) => Ok(SceneFile::Given(path.clone())),
        SceneSource::ObstetricPhantom(options) => {
            let progress = Progress::new("phantom", 0);
            let progress = |p: phantom::Progress| progress.set(p.done, p.total);
            Ok(SceneFile::Generated(phantom::cached_or_temporary(&cache_directory(), options, &progress)?))
        }
    }
}

/// Warns, one line each, of effects that are left out although the scene needs them, or that it shows only on request.
pub(crate) fn warn_of_effects(scene: &Scene, probe: &Probe, settings: &RenderSettings) {
    let plan = EffectPlan::new(scene, probe, settings);
    for warning in plan.warnings().chain(plan.notices()) {
        tracing::warn!("{warning}");
    }
}

/// Warns that the command ignores the station's budget and uses the lowest quality.
pub(crate) fn warn_of_budget(station: &Station) {
    if let Some(budget_ms) = station.quality_budget_ms {
        let quality = quality::name(&station.settings.quality);
        tracing::warn!("quality.budget_ms = {budget_ms} chooses nothing here: the quality is {quality}");
    }
}

/// Warns of frames in which crossings did not fit the buffers.
pub(crate) fn warn_of_overflows(frames: usize) {
    if frames > 0 {
        tracing::warn!(
            "in {frames} frames a few paths met more interfaces than are kept, and go on in the last medium"
        );
    }
}

/// Indices of `count` of `total` things, spread evenly.
pub(crate) fn evenly(count: usize, total: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |i| (2 * i + 1) * total / (2 * count))
}

/// Renders `poses` in order, two in flight. `each` receives every frame with its index. `before` runs before each
/// submission, may wait, and returns the scene time, s.
pub(crate) fn render_paced(
    renderer: &mut Renderer,
    poses: &[Pose],
    mut before: impl FnMut(usize) -> f64,
    mut each: impl FnMut(usize, &mut Frame) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let mut frame = Frame::default();
    let mut done = 0;
    for (submitted, pose) in poses.iter().enumerate() {
        if submitted - done == FRAMES_IN_FLIGHT {
            renderer.receive(&mut frame)?;
            each(done, &mut frame)?;
            done += 1;
        }
        renderer.set_time_s(before(submitted));
        renderer.submit(pose)?;
    }
    while done < poses.len() {
        renderer.receive(&mut frame)?;
        each(done, &mut frame)?;
        done += 1;
    }
    Ok(())
}
