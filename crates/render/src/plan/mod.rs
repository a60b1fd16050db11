//! The effect plan: the effects that a scene calls for, with reasons, decided before anything is compiled.
//!
//! An effect is left out only if frames without it change by a small amount in every pose of the probe: see [`Bound`].

mod bound;
mod contact;
mod facts;
mod loss;
mod needle;
mod rules;
mod speckle;

use std::fmt;

use serde::Serialize;

pub use bound::{Bound, GREY_ALLOWED};
pub(crate) use facts::{AIR, SKIN, SceneFacts};

use insonify_core::anatomy::Scene;
use insonify_core::settings::RenderSettings;
use insonify_core::settings::{Choice, Effect, EffectSet};
use insonify_core::transducer::Probe;
use rules::{Rules, decided};

/// Decision whether an effect is simulated, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Decision {
    /// The effect.
    pub effect: Effect,
    /// Whether the effect is simulated.
    pub on: bool,
    /// Whether the scene calls for the effect.
    pub called_for: bool,
    /// The station's choice for the effect.
    pub choice: Choice,
    /// Reason for `called_for`, with the numbers that decided it.
    pub reason: String,
    /// Bound on the error of frames without the effect, in any pose.
    pub bound: Bound,
}

impl Decision {
    /// Notice for the user that tissues have a texture which is shown only on request; `None` for other decisions.
    pub fn notice(&self) -> Option<String> {
        let Self { effect, reason, .. } = self;
        let waits = *effect == Effect::Texture && self.choice == Choice::Auto && self.bound == Bound::OnRequest;
        waits.then(|| format!("{effect} is left out: {reason}; [effects] {effect} = \"on\" shows it"))
    }

    /// Warning for the user that an effect is off though the scene calls for it; `None` for other decisions.
    pub fn warning(&self) -> Option<String> {
        let against = self.called_for && !self.on;
        against.then(|| format!("{} is off though {} (bound without it: {})", self.effect, self.reason, self.bound))
    }
}

/// Decisions on all effects for one scene, probe and settings.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct EffectPlan {
    decisions: Vec<Decision>,
}

impl EffectPlan {
    /// Makes the plan for a scene, a probe and settings.
    pub fn new(scene: &Scene, probe: &Probe, settings: &RenderSettings) -> Self {
        Self::of(&SceneFacts::new(scene), probe, settings)
    }

    pub(crate) fn of(facts: &SceneFacts, probe: &Probe, settings: &RenderSettings) -> Self {
        // With contact simulated, paths may meet air, even in a scene without skin.
        let in_air = (settings.effects.of(Effect::Contact) == Choice::On && !facts.skin).then(|| facts.in_air());
        let facts = in_air.as_ref().unwrap_or(facts);
        let mut rules = Rules { facts, probe, settings, on: EffectSet::default() };
        let decide = |effect| {
            let found = rules.of(effect);
            let possible = rules.possible(effect);
            let (called_for, choice) = (possible && !found.bound.negligible(), settings.effects.of(effect));
            let on = possible && decided(choice, called_for);
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

    /// Notices for the user, see [`Decision::notice`].
    pub fn notices(&self) -> impl Iterator<Item = String> {
        self.decisions.iter().filter_map(Decision::notice)
    }

    /// Warnings for the user, see [`Decision::warning`]; one line each.
    pub fn warnings(&self) -> impl Iterator<Item = String> + '_ {
        self.decisions.iter().filter_map(Decision::warning)
    }

    /// Settings to render with: `asked`, with one ray or one layer where more would not change the frame.
    pub fn settings(&self, asked: &RenderSettings) -> RenderSettings {
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
