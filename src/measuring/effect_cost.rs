//! Cost of each effect in frame time on this machine.

use serde::Serialize;

use super::timed_needle;
use super::timing::{Cost, TimedFrame, VariantTimes, elapsed_ms, in_turns, timed};
use crate::anatomy::Bvh;
use crate::render::{Choice, Effect, EffectChoices, EffectPlan, Frame, RenderError, RenderSettings, Renderer};
use crate::statistics::median;

/// Timed frames of a variant in each round. One uncounted frame comes before them.
const FRAMES: usize = 3;
/// Scene time between frames of a moving scene, s.
const STEP_S: f64 = 1.0 / 30.0;

/// Cost of an effect: frame time saved by leaving it out, or added by simulating it.
#[derive(Debug, Clone, Copy, Serialize)]
struct EffectCost {
    effect: Effect,
    #[serde(flatten)]
    cost: Cost,
}

/// Measured frame times, and the cost of each effect.
#[derive(Debug, Clone, Serialize)]
pub struct EffectCosts {
    /// Median time of a frame with the effects that the plan simulates, ms.
    pub planned_ms: f64,
    /// Median time of a frame with all effects, ms.
    pub all_effects_ms: f64,
    /// Number of frames in each median.
    pub frames: usize,
    costs: Vec<EffectCost>,
}

impl EffectCosts {
    /// Cost of `effect`; `None` if the effect takes no frame time, or wasn't measured.
    pub fn of(&self, effect: Effect) -> Option<Cost> {
        self.costs.iter().find(|cost| cost.effect == effect).map(|found| found.cost)
    }

    /// Frame time that the plan saves against simulating all effects, ms.
    pub(crate) fn saved_ms(&self) -> f64 {
        self.all_effects_ms - self.planned_ms
    }
}

/// Whether an effect costs frame time. The other effects only change numbers in tables.
fn takes_time(effect: Effect) -> bool {
    use Effect::{Attenuation, FrequencyExponent, SpeedDisplacement, Thickness};
    ![SpeedDisplacement, Thickness, Attenuation, FrequencyExponent].contains(&effect)
}

/// Settings that invert `effect`. All other effects are forced to their planned state, because the plan's rules depend
/// on each other.
fn other_way(settings: &RenderSettings, plan: &EffectPlan, effect: Effect) -> RenderSettings {
    let mut other = *settings;
    for each in Effect::ALL {
        let on = plan.has(each) != (each == effect);
        if each == Effect::Maps {
            // Maps can't be forced off; they are off only without a reader.
            other.effects = other.effects.with(each, Choice::Auto);
            other.maps = on;
        } else {
            other.effects = other.effects.with(each, if on { Choice::On } else { Choice::Off });
        }
    }
    other
}

/// Measures frames as planned, frames with all effects, and frames with each of `effects` inverted.
///
/// # Errors
/// A scene or settings that cannot be rendered.
pub fn effect_costs(
    frame: &TimedFrame<'_>,
    plan: &EffectPlan,
    effects: &[Effect],
    progress: &dyn Fn(usize, usize),
) -> Result<EffectCosts, RenderError> {
    let TimedFrame { backend, scene, ref probe, ref settings, ref pose } = *frame;
    let asked = |effect| match effect {
        Effect::Rays => settings.quality.rays > 1,
        Effect::Layers => settings.quality.layers > 1,
        Effect::Motion => !scene.motion.is_empty(),
        Effect::Needle => settings.needle.is_some_and(|needle| needle.echoes()),
        _ => true,
    };
    let timed_effects: Vec<Effect> = effects.iter().copied().filter(|&e| takes_time(e) && asked(e)).collect();
    let every = RenderSettings { effects: EffectChoices::ALL_ON, maps: true, ..*settings };
    let mut variants = vec![*settings, every];
    variants.extend(timed_effects.iter().map(|&effect| other_way(settings, plan, effect)));

    let bvh = Bvh::build(scene).map_err(RenderError::from)?;
    let mut renderer = Renderer::with_bvh(backend, scene, bvh, probe, settings)?;
    renderer.set_needle(timed_needle(settings, probe, pose));
    let mut frame = Frame::default();
    // Compiles each variant's pipelines before timing.
    variants.iter().try_for_each(|variant| renderer.reconfigure(probe, variant))?;
    let mut time_s = 0.0;
    let times = in_turns(variants.len(), progress, |index| {
        renderer.reconfigure(probe, &variants[index])?;
        timed(1, FRAMES, || {
            let frame_ms = elapsed_ms(|| {
                renderer.set_time_s(time_s);
                renderer.render(pose, &mut frame)
            });
            time_s += STEP_S;
            frame_ms
        })
    })?;

    let (planned, every) = (&times[0], &times[1]);
    let cost = |(&effect, other): (&Effect, &VariantTimes)| {
        let differences_ms = if plan.has(effect) { planned.over(other) } else { other.over(planned) };
        Some(EffectCost { effect, cost: Cost::of(&differences_ms)? })
    };
    let costs = timed_effects.iter().zip(&times[2..]).filter_map(cost).collect();
    let [planned_ms, all_effects_ms] = [planned, every].map(|times| median(&times.all_ms).unwrap_or(0.0));
    Ok(EffectCosts { planned_ms, all_effects_ms, frames: planned.all_ms.len(), costs })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_other_way_differs_in_one_effect() {
        for name in ["slabs", "speckle", "vessel_needle"] {
            let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("configs/{name}.toml"));
            let station = crate::station::Station::load(&path).unwrap();
            let scene = station.load_scene_from(station.scene_file().unwrap()).unwrap();
            let mut settings = station.settings;
            settings.effects = settings.effects.with(Effect::Maps, Choice::On);
            let plan = EffectPlan::new(&scene, &station.probe, &settings);
            // Without a needle its effect is impossible.
            for effect in Effect::ALL.into_iter().filter(|&effect| effect != Effect::Needle) {
                let other = EffectPlan::new(&scene, &station.probe, &other_way(&settings, &plan, effect));
                for each in Effect::ALL {
                    assert_eq!(other.has(each) != plan.has(each), each == effect, "{name}: {effect}, {each}");
                }
            }
        }
    }
}
