//! Errors of effects against wave theory, of looks against a perfect picture, and their costs in the station's scene.

use insonify::anatomy::Scene;
use insonify::pose::Pose;
use insonify::render::{Backend, Choice, Effect, EffectPlan, Quality, RenderSettings};
use insonify::selftest::{LookError, TruthError, look_errors, truth_errors};
use insonify::station::Station;
use insonify::tradeoff::EffectTruth;

use super::super::plan::looks;
use super::super::plan::measure::{Cost, measure as costs_of};
use super::super::progress::Progress;
use super::super::{Classify, Failure};
use super::store::Store;

/// Errors and costs at one ray and one layer. What the store holds is not measured again.
pub(super) fn measure(
    backend: &Backend,
    station: &Station,
    scene: &Scene,
    store: &Store,
    poses: &[Pose],
) -> Result<Vec<EffectTruth>, Failure> {
    let Some(pose) = poses.first() else { return Ok(Vec::new()) };
    kept(store, "effects", || measured(backend, station, scene, pose))
}

fn measured(backend: &Backend, station: &Station, scene: &Scene, pose: &Pose) -> Result<Vec<EffectTruth>, Failure> {
    let progress = Progress::new("wave theory", 0);
    let errors = truth_errors(backend, &|done, of| progress.set(done, of)).other()?;
    drop(progress);
    let compared: Vec<Effect> =
        Effect::ALL.into_iter().filter(|effect| errors.iter().any(|error| error.effect == effect.name())).collect();
    let mut settings = RenderSettings { quality: Quality { seed: 0, ..Quality::LQ }, maps: true, ..station.settings };
    for &effect in &compared {
        settings.effects = settings.effects.with(effect, Choice::On);
    }
    let plan = EffectPlan::new(scene, &station.probe, &settings);
    let costs = costs_of(backend, scene, &station.probe, &settings, &plan, &compared, pose)?;
    let of = |error: TruthError| {
        let effect = compared.iter().copied().find(|effect| effect.name() == error.effect);
        EffectTruth {
            possible: effect.is_some_and(|effect| plan.has(effect)),
            cost_ms: effect.and_then(|effect| costs.of(effect)).map(Cost::ms),
            error,
        }
    };
    Ok(errors.into_iter().map(of).collect())
}

/// Errors and costs of the steps of a look, likewise.
pub(super) fn measure_looks(
    backend: &Backend,
    station: &Station,
    scene: &Scene,
    store: &Store,
    poses: &[Pose],
) -> Result<Vec<EffectTruth>, Failure> {
    let Some(pose) = poses.first() else { return Ok(Vec::new()) };
    kept(store, "looks", || measured_looks(backend, station, scene, pose))
}

fn measured_looks(
    backend: &Backend,
    station: &Station,
    scene: &Scene,
    pose: &Pose,
) -> Result<Vec<EffectTruth>, Failure> {
    let progress = Progress::new("looks", 0);
    let errors = look_errors(backend, &|done, of| progress.set(done, of)).other()?;
    drop(progress);
    let settings = RenderSettings { quality: Quality { seed: 0, ..Quality::LQ }, maps: true, ..station.settings };
    let variants: Vec<looks::Variant> = errors.iter().map(|step| (step.look, step.harmonics)).collect();
    let costs = looks::costs(backend, scene, &station.probe, &settings, &variants, pose)?;
    let of = |(step, cost): (LookError, Option<Cost>)| EffectTruth {
        error: step.error,
        possible: true,
        cost_ms: cost.map(Cost::ms),
    };
    Ok(errors.into_iter().zip(costs).map(of).collect())
}

/// Rows that the store holds under a name; else measures and stores them.
fn kept(
    store: &Store,
    name: &str,
    measure: impl FnOnce() -> Result<Vec<EffectTruth>, Failure>,
) -> Result<Vec<EffectTruth>, Failure> {
    if let Some(rows) = store.read(name)? {
        return Ok(rows);
    }
    let rows = measure()?;
    // JSON has no word for a number that is none.
    if rows.iter().all(|row| row.error.without.is_finite() && row.error.with.is_finite()) {
        store.write(name, &rows)?;
    }
    Ok(rows)
}
