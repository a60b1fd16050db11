//! Cost of each post-processing step (a part of the look) in live frames on this machine. Compounding adds one angle
//! per frame.

use std::fmt;

use serde::Serialize;

use super::timing::{Cost, TimedFrame, elapsed_ms, in_turns, timed};
use crate::anatomy::Bvh;
use crate::look::{Look, Shape};
use crate::pose::Pose;
use crate::render::{Frame, RenderError, RenderSettings, Renderer};
use crate::settings::{GreyMap, LookPreset, LookSettings};
use crate::transducer::Probe;

/// Timed frames of a variant in each round.
const FRAMES: usize = 4;

/// Settings of post-processing, and whether the probe receives tissue harmonics.
pub(super) type Variant = (LookSettings, bool);

/// A post-processing step, its value in the station, and its cost.
#[derive(Debug, Clone, Serialize)]
pub struct LookCost {
    setting: &'static str,
    /// Value in the station, as text.
    value: String,
    on: bool,
    /// Value of the comparison frames, as text.
    other: String,
    /// Frame time that the step adds, or would add if it is off.
    #[serde(flatten)]
    cost: Cost,
}

impl fmt::Display for LookCost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (state, saves) = if self.on { ("on", "") } else { ("off", "saves ") };
        let cost = format!("{saves}{}", self.cost);
        let measured = if self.on { "without it" } else { "with it" };
        write!(f, "{:19} {state:4} {cost:>22}  {}; {measured} {}", self.setting, self.value, self.other)
    }
}

/// A post-processing setting whose cost is measured.
struct LookStep {
    setting: &'static str,
    value: fn(&Variant) -> String,
    /// Copies the setting from the second variant to the first.
    take: fn(&mut Variant, &Variant),
}

const STEPS: [LookStep; 6] = [
    LookStep {
        setting: "angles",
        value: |(look, _)| match look.odd_angles() {
            1 => "1".to_owned(),
            angles => format!("{angles} over {} degrees", look.span_deg),
        },
        take: |(look, _), (from, _)| (look.angles, look.span_deg) = (from.angles, from.span_deg),
    },
    LookStep {
        setting: "speckle_reduction",
        value: |(look, _)| look.speckle_reduction.to_string(),
        take: |(look, _), (from, _)| look.speckle_reduction = from.speckle_reduction,
    },
    LookStep {
        setting: "edge_enhancement",
        value: |(look, _)| look.edge_enhancement.to_string(),
        take: |(look, _), (from, _)| look.edge_enhancement = from.edge_enhancement,
    },
    LookStep {
        setting: "persistence",
        value: |(look, _)| look.persistence.to_string(),
        take: |(look, _), (from, _)| look.persistence = from.persistence,
    },
    LookStep {
        setting: "grey_map",
        value: |(look, _)| look.grey_map.name().to_owned(),
        take: |(look, _), (from, _)| look.grey_map = from.grey_map,
    },
    LookStep {
        setting: "harmonics",
        value: |(_, harmonics)| harmonics.to_string(),
        take: |(_, harmonics), (_, from)| *harmonics = *from,
    },
];

fn plain() -> Variant {
    (LookPreset::Raw.settings(), false)
}

/// The station's post-processing, once with each step inverted. Steps that are off get the values of `usual`.
fn other_ways(own: Variant) -> Vec<Variant> {
    let plain = plain();
    let usual: Variant = (
        LookSettings {
            angles: 9,
            persistence: 0.5,
            speckle_reduction: 0.5,
            edge_enhancement: 0.5,
            grey_map: GreyMap::Contrast,
            ..plain.0
        },
        true,
    );
    let inverted = |step: &LookStep| {
        let mut other = own;
        (step.take)(&mut other, if is_on(step, &own) { &plain } else { &usual });
        other
    };
    STEPS.iter().map(inverted).collect()
}

fn is_on(step: &LookStep, own: &Variant) -> bool {
    let mut without = *own;
    (step.take)(&mut without, &plain());
    (step.value)(&without) != (step.value)(own)
}

/// Measures the costs of the frame's post-processing steps, by inverting one step at a time.
///
/// # Errors
/// A scene or settings that cannot be rendered.
pub fn look_costs(frame: &TimedFrame<'_>, progress: &dyn Fn(usize, usize)) -> Result<Vec<LookCost>, RenderError> {
    let own = (frame.settings.look, frame.probe.harmonics);
    let others = other_ways(own);
    let differences_ms = differences_ms(frame, own, &others, progress)?;
    let of = |((step, other), differences_ms): ((&LookStep, &Variant), Vec<f64>)| {
        let on = is_on(step, &own);
        let sign = if on { -1.0 } else { 1.0 };
        let cost = Cost::of(&differences_ms.iter().map(|ms| sign * ms).collect::<Vec<_>>())?;
        Some(LookCost { setting: step.setting, value: (step.value)(&own), on, other: (step.value)(other), cost })
    };
    Ok(STEPS.iter().zip(&others).zip(differences_ms).filter_map(of).collect())
}

/// Cost of each of `looks`, relative to plain post-processing.
pub(super) fn costs(
    frame: &TimedFrame<'_>,
    looks: &[Variant],
    progress: &dyn Fn(usize, usize),
) -> Result<Vec<Option<Cost>>, RenderError> {
    let differences_ms = differences_ms(frame, plain(), looks, progress)?;
    Ok(differences_ms.iter().map(|ms| Cost::of(ms)).collect())
}

/// Frame times of each of `others` minus those of `own`, ms, by round.
fn differences_ms(
    frame: &TimedFrame<'_>,
    own: Variant,
    others: &[Variant],
    progress: &dyn Fn(usize, usize),
) -> Result<Vec<Vec<f64>>, RenderError> {
    let TimedFrame { backend, scene, ref probe, ref settings, ref pose } = *frame;
    let variants: Vec<Variant> = std::iter::once(own).chain(others.iter().copied()).collect();
    let bvh = Bvh::build(scene).map_err(RenderError::from)?;
    let mut renderer = Renderer::with_bvh(backend, scene, bvh, probe, settings)?;
    let mut live = Live { look: Look::default(), frame: Frame::default() };
    let times = in_turns(variants.len(), progress, |index| {
        let (look, harmonics) = variants[index];
        let settings = RenderSettings { look, ..*settings };
        renderer.reconfigure(&Probe { harmonics, ..*probe }, &settings)?;
        // The compounded mean holds all angles only after as many frames.
        let warm_up = look.odd_angles() as usize + 1;
        timed(warm_up, FRAMES, || elapsed_ms(|| live.frame(&mut renderer, &settings, pose)))
    })?;
    Ok(times[1..].iter().map(|other| other.over(&times[0])).collect())
}

/// Renders and post-processes frames as a live session does.
struct Live {
    look: Look,
    frame: Frame,
}

impl Live {
    fn frame(&mut self, renderer: &mut Renderer, settings: &RenderSettings, pose: &Pose) -> Result<(), RenderError> {
        renderer.submit(pose)?;
        renderer.receive(&mut self.frame)?;
        let Frame { width, mask, bmode, .. } = &mut self.frame;
        let angles = settings.look.independent_angles(renderer.probe());
        let shape = Shape::new(*width, renderer.sector().pixel_mm, mask, &settings.image, angles);
        self.look.apply(&settings.look, shape, bmode);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_is_inverted_alone() {
        for preset in LookPreset::ALL {
            let own = (preset.settings(), false);
            for (i, (step, other)) in STEPS.iter().zip(other_ways(own)).enumerate() {
                assert_ne!(is_on(step, &own), is_on(step, &other), "{}: {}", preset.name(), step.setting);
                for (_, same) in STEPS.iter().enumerate().filter(|(j, _)| *j != i) {
                    assert_eq!((same.value)(&own), (same.value)(&other), "{}: {}", preset.name(), same.setting);
                }
            }
        }
    }

    #[test]
    fn steps_are_the_settings_of_a_look() {
        use crate::settings::SettingsGroup as _;
        let mut keys: Vec<&str> = LookSettings::settings().iter().map(|setting| setting.key).collect();
        keys.retain(|key| !["span_deg", "reach_mm", "registration"].contains(key));
        let mut steps: Vec<&str> = STEPS.iter().map(|step| step.setting).filter(|s| *s != "harmonics").collect();
        keys.sort_unstable();
        steps.sort_unstable();
        assert_eq!(keys, steps);
    }
}
