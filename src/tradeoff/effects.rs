//! Errors of effects against wave theory, of looks against a perfect picture, and their costs in the station's scene.

use super::cost::{Cost, TimedFrame, effect_costs};
use super::look_cost::{self, Variant};
use super::store::Store;
use super::sweep_step::{SweepProgress, SweepStep};
use super::{EffectTruth, TradeoffError};
use crate::anatomy::Scene;
use crate::pose::Pose;
use crate::render::{Backend, Choice, Effect, EffectPlan, Quality, RenderSettings};
use crate::selftest::{LookError, TruthError, look_errors, truth_errors};
use crate::station::Station;

/// Scene and pose at which costs are measured.
pub(super) struct Place<'a> {
    pub(super) backend: &'a Backend,
    pub(super) station: &'a Station,
    pub(super) scene: &'a Scene,
    /// `None`: nothing is measured.
    pub(super) pose: Option<&'a Pose>,
}

impl Place<'_> {
    /// The station's frame at one ray and one layer.
    fn frame(&self, pose: &Pose) -> TimedFrame<'_> {
        let Self { backend, station, scene, .. } = *self;
        let quality = Quality { seed: 0, ..Quality::LQ };
        let settings = RenderSettings { quality, maps: true, ..station.settings };
        TimedFrame { backend, scene, probe: station.probe, settings, pose: *pose }
    }
}

/// Errors and costs at one ray and one layer. What the store holds is not measured again.
pub(super) fn measure(
    at: &Place<'_>,
    store: &Store,
    progress: &SweepProgress<'_>,
) -> Result<Vec<EffectTruth>, TradeoffError> {
    let Some(pose) = at.pose else { return Ok(Vec::new()) };
    kept(store, "effects", || measured(at, pose, progress))
}

fn measured(at: &Place<'_>, pose: &Pose, progress: &SweepProgress<'_>) -> Result<Vec<EffectTruth>, TradeoffError> {
    let errors = truth_errors(at.backend, &|done, total| progress(SweepStep::Theory { done, total }))?;
    let compared: Vec<Effect> =
        Effect::ALL.into_iter().filter(|effect| errors.iter().any(|error| error.effect == effect.name())).collect();
    let mut frame = at.frame(pose);
    for &effect in &compared {
        frame.settings.effects = frame.settings.effects.with(effect, Choice::On);
    }
    let plan = EffectPlan::new(at.scene, &frame.probe, &frame.settings);
    let costs = effect_costs(&frame, &plan, &compared, &|done, total| progress(SweepStep::Costs { done, total }))?;
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
    at: &Place<'_>,
    store: &Store,
    progress: &SweepProgress<'_>,
) -> Result<Vec<EffectTruth>, TradeoffError> {
    let Some(pose) = at.pose else { return Ok(Vec::new()) };
    kept(store, "looks", || measured_looks(at, pose, progress))
}

fn measured_looks(
    at: &Place<'_>,
    pose: &Pose,
    progress: &SweepProgress<'_>,
) -> Result<Vec<EffectTruth>, TradeoffError> {
    let errors = look_errors(at.backend, &|done, total| progress(SweepStep::Looks { done, total }))?;
    let variants: Vec<Variant> = errors.iter().map(|step| (step.look, step.harmonics)).collect();
    let show = |done, total| progress(SweepStep::LookCosts { done, total });
    let costs = look_cost::costs(&at.frame(pose), &variants, &show)?;
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
    measure: impl FnOnce() -> Result<Vec<EffectTruth>, TradeoffError>,
) -> Result<Vec<EffectTruth>, TradeoffError> {
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
