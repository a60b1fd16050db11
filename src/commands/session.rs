//! Steps shared by commands that render: loading the scene, and warnings.

use insonify::anatomy::Scene;
use insonify::render::{EffectPlan, RenderSettings};
use insonify::station::{SceneFile, Station};
use insonify::transducer::Probe;

use super::Failure;
use super::progress::Progress;

/// Scene of a station, from its file or from the cache of generated scenes.
pub(crate) fn load_scene(station: &Station) -> Result<Scene, Failure> {
    Ok(station.load_scene_from(scene_file(station)?.path())?)
}

/// Scene file of a station. A generated scene is built and cached if missing.
pub(crate) fn scene_file(station: &Station) -> Result<SceneFile, Failure> {
    let progress = Progress::new("phantom", 0);
    Ok(station.prepare_scene_file(&|p| progress.set(p.done, p.total))?)
}

/// Warns of effects that the settings omit although the scene needs them, and of effects that need a request. One line
/// each.
pub(crate) fn warn_of_effects(scene: &Scene, probe: &Probe, settings: &RenderSettings) {
    let plan = EffectPlan::new(scene, probe, settings);
    for warning in plan.warnings().chain(plan.notices()) {
        tracing::warn!("{warning}");
    }
}

/// Warns that the command ignores the station's frame budget and uses the lowest quality.
pub(crate) fn warn_of_budget(station: &Station) {
    if let Some(frame_budget_ms) = station.frame_budget_ms {
        let quality = station.settings.quality.name();
        tracing::warn!("quality.frame_budget_ms = {frame_budget_ms} chooses nothing here: the quality is {quality}");
    }
}
