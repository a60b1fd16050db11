//! Errors of effects against wave theory, and their costs in the station's scene.

use insonify::anatomy::Scene;
use insonify::pose::Pose;
use insonify::render::{Backend, Effect, EffectPlan, Quality, RenderSettings};
use insonify::selftest::truth_errors;
use insonify::station::Station;
use insonify::tradeoff::EffectTruth;

use super::super::plan::measure;
use super::super::progress::Progress;
use super::super::{Classify, Failure};
use super::store::Store;

/// Measures what the store does not hold.
pub(super) fn measure(
    backend: &Backend,
    station: &Station,
    scene: &Scene,
    store: &Store,
    poses: &[Pose],
) -> Result<Vec<EffectTruth>, Failure> {
    if let Some(effects) = store.read("effects")? {
        return Ok(effects);
    }
    let progress = Progress::new("wave theory", 0);
    let errors = truth_errors(backend, &|done, of| progress.set(done, of)).other()?;
    drop(progress);
    let settings = RenderSettings { quality: Quality { seed: 0, ..Quality::LQ }, maps: true, ..station.settings };
    let plan = EffectPlan::new(scene, &station.probe, &settings);
    let Some(pose) = poses.first() else { return Ok(Vec::new()) };
    let costs = measure::measure(backend, scene, &station.probe, &settings, &plan, pose)?;
    let of = |error: insonify::selftest::TruthError| {
        let effect = Effect::ALL.into_iter().find(|effect| effect.name() == error.effect);
        EffectTruth { cost_ms: effect.and_then(|effect| costs.of(effect)).map(measure::Cost::ms), error }
    };
    let effects: Vec<EffectTruth> = errors.into_iter().map(of).collect();
    store.write("effects", &effects)?;
    Ok(effects)
}
