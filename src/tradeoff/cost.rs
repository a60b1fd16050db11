//! Cost of each effect on this machine.

use std::fmt;
use std::time::{Duration, Instant};

use serde::Serialize;

use crate::anatomy::{Bvh, Scene};
use crate::pose::Pose;
use crate::render::{Backend, Choice, Effect, EffectChoices, EffectPlan, Frame, RenderError, RenderSettings, Renderer};
use crate::statistics::{median, percentile};
use crate::transducer::Probe;

/// Rounds of each variant, and frames per round; the first frame of a round is not counted.
pub(super) const ROUNDS: usize = 7;
pub(super) const FRAMES: usize = 4;
/// Time after which no round beyond `ROUNDS_MIN` starts: slow devices measure fewer rounds.
pub(super) const LONG: Duration = Duration::from_secs(30);
pub(super) const ROUNDS_MIN: usize = 3;
/// Time between frames of a scene that moves, s.
const STEP_S: f64 = 1.0 / 30.0;

/// A frame whose time is measured.
#[derive(Debug, Clone)]
pub struct TimedFrame<'a> {
    /// Renderer.
    pub backend: &'a Backend,
    /// Scene.
    pub scene: &'a Scene,
    /// Probe.
    pub probe: Probe,
    /// Settings as planned.
    pub settings: RenderSettings,
    /// Pose of the probe.
    pub pose: Pose,
}

/// Time that something adds to a frame.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Cost {
    /// Median over rounds of the difference in frame time with and without it, ms.
    cost_ms: f64,
    /// Half the interquartile range of the differences, ms.
    spread_ms: f64,
}

impl Cost {
    /// Cost from the differences of the rounds, ms; `None` without a round.
    pub(super) fn of(differences_ms: &[f64]) -> Option<Self> {
        let quartile = |part| percentile(differences_ms, part);
        let spread_ms = 0.5 * (quartile(0.75)? - quartile(0.25)?);
        Some(Self { cost_ms: median(differences_ms)?, spread_ms })
    }

    /// Cost and its spread, ms.
    pub fn ms(self) -> [f64; 2] {
        [self.cost_ms, self.spread_ms]
    }
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let noise = if self.cost_ms.abs() <= self.spread_ms { " noise" } else { "" };
        write!(f, "{:.1} ± {:.1} ms{noise}", self.cost_ms, self.spread_ms)
    }
}

/// Cost of an effect: time saved by leaving it out, or spent on simulating it.
#[derive(Debug, Clone, Copy, Serialize)]
struct EffectCost {
    effect: Effect,
    #[serde(flatten)]
    cost: Cost,
}

/// Measured times.
#[derive(Debug, Clone, Serialize)]
pub struct Costs {
    /// Median time of a frame as planned, ms.
    pub planned_ms: f64,
    /// Median time of a frame with all effects, ms.
    pub all_effects_ms: f64,
    /// Number of frames per median.
    pub frames: usize,
    costs: Vec<EffectCost>,
}

impl Costs {
    /// Cost of `effect`; `None` if it only changes numbers in tables.
    pub fn of(&self, effect: Effect) -> Option<Cost> {
        self.costs.iter().find(|cost| cost.effect == effect).map(|found| found.cost)
    }

    /// Time that the plan saves, ms.
    pub(crate) fn saved_ms(&self) -> f64 {
        self.all_effects_ms - self.planned_ms
    }
}

/// A variant of the settings, and its times.
struct Way {
    settings: RenderSettings,
    /// Effect that differs from the plan.
    effect: Option<Effect>,
    /// Median of each round, ms.
    turns_ms: Vec<f64>,
    all_ms: Vec<f64>,
}

impl Way {
    fn new(settings: RenderSettings, effect: Option<Effect>) -> Self {
        Self { settings, effect, turns_ms: Vec::new(), all_ms: Vec::new() }
    }
}

/// Whether an effect costs frame time; the others only change numbers in tables.
fn takes_time(effect: Effect) -> bool {
    use Effect::{Attenuation, FrequencyExponent, SpeedDisplacement, Thickness};
    ![SpeedDisplacement, Thickness, Attenuation, FrequencyExponent].contains(&effect)
}

/// Settings that invert `effect` and force all other effects as planned: the plan's rules depend on each other.
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

/// Measures frames as planned, with all effects, and with each of `effects` inverted.
///
/// # Errors
/// A scene or settings that cannot be rendered.
pub fn effect_costs(
    frame: &TimedFrame<'_>,
    plan: &EffectPlan,
    effects: &[Effect],
    progress: &dyn Fn(usize, usize),
) -> Result<Costs, RenderError> {
    let TimedFrame { backend, scene, ref probe, ref settings, ref pose } = *frame;
    let asked = |effect| match effect {
        Effect::Rays => settings.quality.rays > 1,
        Effect::Layers => settings.quality.layers > 1,
        Effect::Motion => !scene.motion.is_empty(),
        _ => true,
    };
    let other_way = |effect| Way::new(other_way(settings, plan, effect), Some(effect));
    let every = RenderSettings { effects: EffectChoices::ALL_ON, maps: true, ..*settings };
    let mut ways = vec![Way::new(*settings, None), Way::new(every, None)];
    ways.extend(effects.iter().copied().filter(|&effect| takes_time(effect) && asked(effect)).map(other_way));

    let bvh = Bvh::build(scene).map_err(RenderError::from)?;
    let mut renderer = Renderer::with_bvh(backend, scene, bvh, probe, settings)?;
    let mut frame = Frame::default();
    // Compiles each variant's pipelines before timing.
    for way in &ways {
        renderer.reconfigure(probe, &way.settings)?;
    }
    let began = Instant::now();
    let mut time_s = 0.0;
    for round in 0..ROUNDS {
        if round >= ROUNDS_MIN && began.elapsed() > LONG {
            break;
        }
        let count = ways.len();
        for (i, way) in ways.iter_mut().enumerate() {
            renderer.reconfigure(probe, &way.settings)?;
            let mut turn_ms = Vec::with_capacity(FRAMES);
            for number in 0..FRAMES {
                let started = Instant::now();
                renderer.set_time_s(time_s);
                renderer.render(pose, &mut frame)?;
                time_s += STEP_S;
                if number > 0 {
                    turn_ms.push(started.elapsed().as_secs_f64() * 1e3);
                }
            }
            way.turns_ms.extend(median(&turn_ms));
            way.all_ms.append(&mut turn_ms);
            progress(round * count + i + 1, ROUNDS * count);
        }
    }

    let planned = ways[0].turns_ms.clone();
    let cost = |way: &Way| {
        let effect = way.effect?;
        let sign = if plan.has(effect) { 1.0 } else { -1.0 };
        let differences: Vec<f64> = planned.iter().zip(&way.turns_ms).map(|(p, w)| sign * (p - w)).collect();
        Some(EffectCost { effect, cost: Cost::of(&differences)? })
    };
    let costs = ways.iter().filter_map(cost).collect();
    let frames = ways[0].all_ms.len();
    let median_ms = |way: &Way| median(&way.all_ms).unwrap_or(0.0);
    Ok(Costs { planned_ms: median_ms(&ways[0]), all_effects_ms: median_ms(&ways[1]), frames, costs })
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
            for effect in Effect::ALL {
                let other = EffectPlan::new(&scene, &station.probe, &other_way(&settings, &plan, effect));
                for each in Effect::ALL {
                    assert_eq!(other.has(each) != plan.has(each), each == effect, "{name}: {effect}, {each}");
                }
            }
        }
    }
}
