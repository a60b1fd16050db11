//! The effect plan: which effects a scene calls for, decided before anything is compiled, and why.
//!
//! An effect is left out only where a bound on what it changes holds for every pose of the probe: see [`Bound`].

mod bound;
mod facts;
mod loss;
mod rules;

use std::fmt;

use serde::Serialize;

pub use bound::{Bound, GREY_ALLOWED};
pub(crate) use facts::SceneFacts;

use crate::anatomy::Scene;
use crate::settings::RenderSettings;
use crate::settings::{Choice, Effect, EffectSet};
use crate::transducer::Probe;
use rules::{Rules, decided};

/// Whether one effect is simulated, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Decision {
    /// Which.
    pub effect: Effect,
    /// Whether it is simulated.
    pub on: bool,
    /// Whether the scene calls for it.
    pub called_for: bool,
    /// What the station says.
    pub choice: Choice,
    /// Why the scene calls for it or doesn't, with the numbers that decided it.
    pub reason: String,
    /// How far a frame without it is off at the most, in any pose.
    pub bound: Bound,
}

impl Decision {
    /// What a user who leaves it out against the plan must know.
    pub fn warning(&self) -> Option<String> {
        let against = self.called_for && !self.on;
        against.then(|| format!("{} is off though {} (bound without it: {})", self.effect, self.reason, self.bound))
    }
}

/// Which effects a frame is made of.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct EffectPlan {
    decisions: Vec<Decision>,
}

impl EffectPlan {
    /// The plan of a scene, a probe and settings.
    pub fn new(scene: &Scene, probe: &Probe, settings: &RenderSettings) -> Self {
        Self::of(&SceneFacts::new(scene), probe, settings)
    }

    pub(crate) fn of(facts: &SceneFacts, probe: &Probe, settings: &RenderSettings) -> Self {
        let mut rules = Rules { facts, probe, settings, on: EffectSet::default() };
        let decide = |effect| {
            let found = rules.of(effect);
            let (called_for, choice) = (!found.bound.negligible(), settings.effects.of(effect));
            let on = decided(choice, called_for);
            if on {
                rules.on = rules.on.and(effect);
            }
            Decision { effect, on, called_for, choice, reason: found.reason, bound: found.bound }
        };
        Self { decisions: Effect::ALL.into_iter().map(decide).collect() }
    }

    /// The decisions, in the order of [`Effect::ALL`].
    pub fn decisions(&self) -> &[Decision] {
        &self.decisions
    }

    /// Whether `effect` is simulated.
    pub fn has(&self, effect: Effect) -> bool {
        self.decisions.iter().any(|d| d.effect == effect && d.on)
    }

    /// The effects that are simulated.
    pub fn effects(&self) -> EffectSet {
        self.decisions.iter().filter(|d| d.on).map(|d| d.effect).collect()
    }

    /// What is off against the plan, one line each.
    pub fn warnings(&self) -> impl Iterator<Item = String> + '_ {
        self.decisions.iter().filter_map(Decision::warning)
    }

    /// The settings that frames are made with: one ray and one layer where more of them show nothing more.
    pub(crate) fn settings(&self, asked: &RenderSettings) -> RenderSettings {
        let mut settings = *asked;
        if !self.has(Effect::Rays) {
            settings.quality.rays = 1;
        }
        if !self.has(Effect::Layers) {
            settings.quality.layers = 1;
        }
        settings
    }
}

impl fmt::Display for EffectPlan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for d in &self.decisions {
            let forced = if d.choice == Choice::Auto { "" } else { " (by the station)" };
            writeln!(f, "{:19} {:3}{forced} {}", d.effect, if d.on { "on" } else { "off" }, d.reason)?;
        }
        Ok(())
    }
}
