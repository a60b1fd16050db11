//! A scene's effect plan, and the cost of each effect on this machine.

use std::fmt;

use serde::Serialize;

use super::effect_cost::{EffectCosts, effect_costs};
use super::look_cost::{LookCost, look_costs};
use super::step::{Progress, part};
use super::timing::TimedFrame;
use crate::render::{Choice, Effect, EffectPlan, Quality, RenderError};
use crate::sink::frame_record::AdapterRecord;

/// Costs of effects and of post-processing steps (the look).
#[derive(Debug, Serialize)]
pub struct PlanCosts {
    /// Device on which the costs were measured.
    pub adapter: AdapterRecord,
    /// Costs of the effects.
    #[serde(flatten)]
    pub costs: EffectCosts,
    /// Costs of the post-processing steps.
    pub look: Vec<LookCost>,
    #[serde(skip)]
    quality: Quality,
}

impl PlanCosts {
    /// Measures the costs of the effects in `plan`, and of the post-processing steps, on `frame`.
    ///
    /// # Errors
    /// A frame that cannot be rendered.
    pub fn measure(frame: &TimedFrame<'_>, plan: &EffectPlan, progress: &Progress<'_>) -> Result<Self, RenderError> {
        Ok(Self {
            adapter: frame.backend.into(),
            costs: effect_costs(frame, plan, &Effect::ALL, &part(progress, "measuring"))?,
            look: look_costs(frame, &part(progress, "measuring looks"))?,
            quality: frame.settings.quality,
        })
    }
}

/// An effect plan as a text table, with costs if they were measured.
#[derive(Debug)]
pub struct PlanTable<'a> {
    /// The plan.
    pub plan: &'a EffectPlan,
    /// Costs of the plan; `None` if not measured.
    pub measured: Option<&'a PlanCosts>,
}

impl fmt::Display for PlanTable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:19} {:4} {:>22}  why", "effect", "", "cost")?;
        for d in self.plan.decisions() {
            let cost = self.measured.and_then(|m| m.costs.of(d.effect)).map_or_else(String::new, |cost| match d.on {
                true => cost.to_string(),
                false => format!("saves {cost}"),
            });
            let state = match (d.on, d.choice) {
                (true, Choice::Auto) => "on",
                (false, Choice::Auto) => "off",
                (true, _) => "ON",
                (false, _) => "OFF",
            };
            let bound = if d.called_for { format!("without it {}", d.bound) } else { d.bound.to_string() };
            writeln!(f, "{:19} {state:4} {cost:>22}  {}\n{:48} {bound}", d.effect, d.reason, "")?;
        }
        if self.plan.decisions().iter().any(|d| d.choice != Choice::Auto) {
            writeln!(f, "\nON, OFF: by the station or --effect")?;
        }
        let Some(PlanCosts { adapter, costs, look, quality }) = self.measured else { return Ok(()) };
        writeln!(f, "\n{:19} {:4} {:>22}  setting", "look", "", "cost")?;
        look.iter().try_for_each(|cost| writeln!(f, "{cost}"))?;
        writeln!(
            f,
            "\nat {}: {:.1} ms a frame as planned, {:.1} ms with all effects: {:.1} ms saved ({:.0} %)",
            quality.name(),
            costs.planned_ms,
            costs.all_effects_ms,
            costs.saved_ms(),
            100.0 * costs.saved_ms() / costs.all_effects_ms
        )?;
        writeln!(
            f,
            "medians of {} frames each, in turns, on {} ({}); ±: half of the middle half of the differences; noise: no more than that",
            costs.frames, adapter.name, adapter.driver
        )
    }
}
