//! Errors of effects against wave theory, errors of post-processing against a perfect picture, and the frame time of
//! both.

use std::fmt::Write;

use serde::{Deserialize, Serialize};

use super::effect_cost::effect_costs;
use super::look_cost::{self, Variant};
use super::step::part;
use super::store::Store;
use super::table::csv_field;
use super::timing::{Cost, TimedFrame};
use super::{MeasuringError, Progress};
use crate::anatomy::Scene;
use crate::pose::Pose;
use crate::render::{Backend, Choice, Effect, EffectPlan, Quality, RenderSettings};
use crate::selftest::{LookError, TruthError, look_errors, truth_errors};
use crate::station::Station;

/// Error with and without an effect or a post-processing step, and its cost.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectError {
    /// Errors with and without the effect or step.
    #[serde(flatten)]
    pub error: TruthError,
    /// False if the effect can't be simulated with the station's probe.
    pub possible: bool,
    /// Frame time that the effect or step adds, and its spread, ms. `None` if it only changes numbers in tables.
    pub cost_ms: Option<[f64; 2]>,
}

impl EffectError {
    /// The cost in words for a table, such as `1.2 ms`.
    pub fn cost(&self) -> String {
        match self.cost_ms {
            _ if !self.possible => "not simulated".to_owned(),
            None => "no time".to_owned(),
            Some([cost, spread]) if cost <= spread => format!("< {:.1} ms", spread.max(0.1)),
            Some([cost, _]) => format!("{cost:.1} ms"),
        }
    }

    /// `error` with its unit. Errors with a tolerance below 1 get three digits, others one.
    pub fn with_unit(&self, error: f64) -> String {
        let digits = if self.error.tolerance < 1.0 { 3 } else { 1 };
        let unit = if self.error.unit.is_empty() { String::new() } else { format!(" {}", self.error.unit) };
        format!("{error:.digits$}{unit}")
    }
}

/// Errors of effects as CSV.
pub fn effects_csv(effects: &[EffectError]) -> String {
    let mut text = "effect,quantity,unit,values,tolerance,without,with,cost_ms,cost_spread_ms\n".to_owned();
    for row in effects {
        let e = &row.error;
        let [cost, spread] = row.cost_ms.map_or_else(Default::default, |cost| cost.map(|ms| ms.to_string()));
        // Writing to a String can't fail.
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{cost},{spread}",
            csv_field(&e.effect),
            csv_field(&e.quantity),
            csv_field(&e.unit),
            e.values,
            e.tolerance,
            e.without,
            e.with
        );
    }
    text
}

/// Errors of effects as a Markdown table.
pub fn effects_markdown(effects: &[EffectError]) -> String {
    let mut text = "| effect | costs | compared with theory | values | error without it | with it | tolerance |\n\
                    |---|---:|---|---:|---:|---:|---:|\n"
        .to_owned();
    for row in effects {
        let e = &row.error;
        let [without, with, tolerance] = [e.without, e.with, e.tolerance].map(|error| row.with_unit(error));
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {without} | {with} | {tolerance} |",
            e.effect,
            row.cost(),
            e.quantity,
            e.values
        );
    }
    text
}

/// Scene and pose of the cost measurements.
pub(super) struct EffectScene<'a> {
    pub(super) backend: &'a Backend,
    pub(super) station: &'a Station,
    pub(super) scene: &'a Scene,
    /// Pose of the probe; `None` skips all measurements.
    pub(super) pose: Option<&'a Pose>,
}

impl EffectScene<'_> {
    /// The station's frame at one ray and one layer.
    fn frame(&self, pose: &Pose) -> TimedFrame<'_> {
        let Self { backend, station, scene, .. } = *self;
        let quality = Quality { seed: 0, ..Quality::LQ };
        let settings = RenderSettings { quality, maps: true, ..station.settings };
        TimedFrame { backend, scene, probe: station.probe, settings, pose: *pose }
    }
}

/// Errors of effects and their costs at one ray and one layer, from the store or measured.
pub(super) fn measure_effects(
    at: &EffectScene<'_>,
    store: &Store,
    progress: &Progress<'_>,
) -> Result<Vec<EffectError>, MeasuringError> {
    let Some(pose) = at.pose else { return Ok(Vec::new()) };
    stored_or_measured(store, "effects", || measured(at, pose, progress))
}

fn measured(at: &EffectScene<'_>, pose: &Pose, progress: &Progress<'_>) -> Result<Vec<EffectError>, MeasuringError> {
    let errors = truth_errors(at.backend, &part(progress, "wave theory"))?;
    let compared: Vec<Effect> =
        Effect::ALL.into_iter().filter(|effect| errors.iter().any(|error| error.effect == effect.name())).collect();
    let mut frame = at.frame(pose);
    for &effect in &compared {
        frame.settings.effects = frame.settings.effects.with(effect, Choice::On);
    }
    let plan = EffectPlan::new(at.scene, &frame.probe, &frame.settings);
    let costs = effect_costs(&frame, &plan, &compared, &part(progress, "measuring"))?;
    let of = |error: TruthError| {
        let effect = compared.iter().copied().find(|effect| effect.name() == error.effect);
        EffectError {
            possible: effect.is_some_and(|effect| plan.has(effect)),
            cost_ms: effect.and_then(|effect| costs.of(effect)).map(Cost::ms),
            error,
        }
    };
    Ok(errors.into_iter().map(of).collect())
}

/// Errors and costs of the post-processing steps, from the store or measured.
pub(super) fn measure_looks(
    at: &EffectScene<'_>,
    store: &Store,
    progress: &Progress<'_>,
) -> Result<Vec<EffectError>, MeasuringError> {
    let Some(pose) = at.pose else { return Ok(Vec::new()) };
    stored_or_measured(store, "looks", || measured_looks(at, pose, progress))
}

fn measured_looks(
    at: &EffectScene<'_>,
    pose: &Pose,
    progress: &Progress<'_>,
) -> Result<Vec<EffectError>, MeasuringError> {
    let errors = look_errors(at.backend, &part(progress, "looks"))?;
    let variants: Vec<Variant> = errors.iter().map(|step| (step.look, step.harmonics)).collect();
    let costs = look_cost::costs(&at.frame(pose), &variants, &part(progress, "measuring looks"))?;
    let of = |(step, cost): (LookError, Option<Cost>)| EffectError {
        error: step.error,
        possible: true,
        cost_ms: cost.map(Cost::ms),
    };
    Ok(errors.into_iter().zip(costs).map(of).collect())
}

/// Reads the rows stored under `name`, or measures and stores them.
fn stored_or_measured(
    store: &Store,
    name: &str,
    measure: impl FnOnce() -> Result<Vec<EffectError>, MeasuringError>,
) -> Result<Vec<EffectError>, MeasuringError> {
    if let Some(rows) = store.read(name)? {
        return Ok(rows);
    }
    let rows = measure()?;
    // JSON cannot hold NaN or infinity, so such rows are not stored.
    if rows.iter().all(|row| row.error.without.is_finite() && row.error.with.is_finite()) {
        store.write(name, &rows)?;
    }
    Ok(rows)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::measuring) fn effects() -> Vec<EffectError> {
        let error = |effect: &str, unit: &str, tolerance, without, with| TruthError {
            effect: effect.into(),
            quantity: "speckle behind a rod, \"dark\"".into(),
            unit: unit.into(),
            values: 8,
            tolerance,
            without,
            with,
        };
        vec![
            EffectError { error: error("aperture", "dB", 4.0, 18.25, 1.5), possible: true, cost_ms: Some([6.5, 0.5]) },
            EffectError {
                error: error("refraction", "mm", 0.1, 1.25, 0.0375),
                possible: true,
                cost_ms: Some([0.25, 0.5]),
            },
            EffectError { error: error("speed_displacement", "mm", 0.1, 0.75, 0.0125), possible: true, cost_ms: None },
        ]
    }

    #[test]
    fn tables_hold_every_effect() {
        let csv = effects_csv(&effects());
        assert!(csv.contains("\naperture,\"speckle behind a rod, \"\"dark\"\"\",dB,8,4,18.25,1.5,6.5,0.5\n"), "{csv}");
        assert!(csv.ends_with(",mm,8,0.1,0.75,0.0125,,\n"), "{csv}");
        let table = effects_markdown(&effects());
        assert!(table.contains("| aperture | 6.5 ms | speckle"), "{table}");
        assert!(table.contains("| refraction | < 0.5 ms |") && table.contains("| no time |"), "{table}");
        assert!(
            table.contains("| 18.2 dB | 1.5 dB | 4.0 dB |") && table.contains("| 1.250 mm | 0.037 mm |"),
            "{table}"
        );
    }
}
