//! What the tip does, pose by pose, in constant memory.

use glam::DVec3;
use serde::Serialize;

use super::elevation::ElevationalProfile;
use super::event::{NeedleEvent, NeedleEventKind};
use super::exercise::{Exercise, Region};
use super::sample::Sample;
use super::slice::{SliceWatch, TipInSlice};
use crate::anatomy::Scene;
use crate::needle::{GAP_S, TipEvent, TipWatch};
use crate::transducer::Probe;

/// A moment on the tip's way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Moment {
    /// Time since the session's start, s.
    pub time_s: f64,
    /// Position of the tip in the scene, mm.
    pub position_mm: DVec3,
}

impl From<&NeedleEvent> for Moment {
    fn from(event: &NeedleEvent) -> Self {
        Self { time_s: event.time_s, position_mm: event.position_mm }
    }
}

/// The tip after a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipState {
    /// Place and time of the tip.
    pub here: Moment,
    /// Whether the tip is inside a surface of the scene.
    pub in_tissue: bool,
    /// Whether the tip is in the target.
    pub in_target: bool,
    /// The needle relative to the image; `None` without a probe.
    pub slice: Option<TipInSlice>,
}

/// What events say about a surface of the scene.
#[derive(Debug, Clone)]
struct Described {
    name: String,
    tissue: String,
    is_target: bool,
    forbidden: bool,
}

/// Follows the tip of a needle, and tells its events.
#[derive(Debug, Clone)]
pub struct NeedleWatch {
    tip: TipWatch,
    surfaces: Vec<Described>,
    /// Centre and radius of a target that is a ball, mm.
    ball: Option<(DVec3, f64)>,
    last: Option<Moment>,
    /// Whether the target was reached since the tip entered the body.
    reached: bool,
    slice: SliceWatch,
}

impl NeedleWatch {
    /// Watch of a session that begins. `tip` is new, in `scene`. Without an exercise there is no target, and nothing is
    /// forbidden.
    pub fn new(tip: TipWatch, scene: &Scene, exercise: Option<&Exercise>) -> Self {
        let described = |surface: &crate::anatomy::Surface| Described {
            name: surface.name.clone(),
            tissue: scene.tissues.names().get(surface.tissue).cloned().unwrap_or_default(),
            is_target: exercise.is_some_and(|exercise| exercise.target.is_surface(&surface.name)),
            forbidden: exercise.is_some_and(|exercise| exercise.forbids(&surface.name)),
        };
        let ball = exercise.and_then(|exercise| match exercise.target {
            Region::Ball { centre_mm, radius_mm } => Some((centre_mm, radius_mm)),
            Region::Surface(_) => None,
        });
        let surfaces = scene.surfaces.iter().map(described).collect();
        Self { tip, surfaces, ball, last: None, reached: false, slice: SliceWatch::default() }
    }

    /// Adds a sample, which is no earlier than the last one, and appends its events to `events` in the order of time. A
    /// sample without a needle, or with a tip that is not finite, adds nothing, and returns `None`.
    pub fn advance(
        &mut self,
        sample: &Sample,
        probe: &Probe,
        profile: &dyn ElevationalProfile,
        events: &mut Vec<NeedleEvent>,
    ) -> Option<TipState> {
        let needle = sample.needle.filter(|needle| needle.tip_mm().is_finite())?;
        let here = Moment { time_s: sample.time_s, position_mm: needle.tip_mm() };
        let before = self.last.replace(here).filter(|before| here.time_s - before.time_s <= GAP_S);
        if before.is_none() {
            self.slice.interrupt();
        }
        self.tip.set_scene_time_s(sample.time_s);
        let first = events.len();
        let crossed = self.tip.advance(here.time_s, here.position_mm);
        events.extend(crossed.iter().filter_map(|event| self.crossing(event)));
        let in_tissue = self.tip.medium().is_some();
        let in_target = self.is_in_target(here.position_mm);
        let reached = before.and_then(|before| self.target(before, here, &crossed));
        if let Some(Moment { time_s, position_mm }) = reached.filter(|_| !self.reached) {
            // A surface is entered first, and then it is the target that was reached.
            let at = first + events.iter().skip(first).take_while(|event| event.time_s <= time_s).count();
            events.insert(at, NeedleEvent::of_tip(NeedleEventKind::TargetReached, time_s, position_mm));
        }
        self.reached = reached.is_some() || in_target || (self.reached && in_tissue);
        let slice = sample.probe.map(|scene_from_probe| TipInSlice::of(&needle, &scene_from_probe, probe, profile));
        let told = self.slice.advance(here.time_s, in_tissue, slice);
        events.extend(told.map(|kind| NeedleEvent::of_tip(kind, here.time_s, here.position_mm)));
        Some(TipState { here, in_tissue, in_target, slice })
    }

    /// The event of a crossing.
    fn crossing(&self, event: &TipEvent) -> Option<NeedleEvent> {
        let surface = self.surfaces.get(event.surface)?;
        Some(NeedleEvent {
            surface: Some(surface.name.clone()),
            tissue: Some(surface.tissue.clone()),
            punctures: Some(event.punctures),
            forbidden: surface.forbidden,
            ..NeedleEvent::of_tip(event.kind.into(), event.time_s, event.position_mm)
        })
    }

    /// Whether the tip, at this place, is in the target.
    fn is_in_target(&self, tip_mm: DVec3) -> bool {
        match self.ball {
            Some((centre_mm, radius_mm)) => tip_mm.distance(centre_mm) <= radius_mm,
            None => self.tip.medium().is_some_and(|surface| self.is_target(surface)),
        }
    }

    fn is_target(&self, surface: usize) -> bool {
        self.surfaces.get(surface).is_some_and(|surface| surface.is_target)
    }

    /// Moment of the step from `before` to `here` at which the tip comes into the target.
    fn target(&self, before: Moment, here: Moment, crossed: &[TipEvent]) -> Option<Moment> {
        if let Some((centre_mm, radius_mm)) = self.ball {
            let part = into_ball(before.position_mm - centre_mm, here.position_mm - centre_mm, radius_mm)?;
            let time_s = before.time_s + part * (here.time_s - before.time_s);
            return Some(Moment { time_s, position_mm: before.position_mm.lerp(here.position_mm, part) });
        }
        let is_entry =
            |event: &&TipEvent| NeedleEventKind::from(event.kind).is_entry() && self.is_target(event.surface);
        crossed.iter().find(is_entry).map(|event| Moment { time_s: event.time_s, position_mm: event.position_mm })
    }
}

/// Part of the way from `from` to `to` at which it first is in the ball of this radius about the origin, 0..=1.
fn into_ball(from: DVec3, to: DVec3, radius: f64) -> Option<f64> {
    let way = to - from;
    let c = from.length_squared() - radius * radius;
    if c <= 0.0 {
        return Some(0.0);
    }
    let (a, b) = (way.length_squared(), from.dot(way));
    // NaN past the ball, and at rest.
    let part = (-b - (b * b - a * c).sqrt()) / a;
    (0.0..=1.0).contains(&part).then_some(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_through_a_ball_reaches_it_at_its_border() {
        let x = |x: f64| DVec3::new(x, 3.0, 0.0);
        assert_eq!(into_ball(x(-10.0), x(10.0), 5.0), Some(0.3));
        assert_eq!(into_ball(x(-10.0), x(-5.0), 5.0), None);
        assert_eq!(into_ball(x(10.0), x(20.0), 5.0), None, "away from it");
        assert_eq!(into_ball(x(1.0), x(20.0), 5.0), Some(0.0), "inside");
        assert_eq!(into_ball(x(10.0), x(10.0), 5.0), None, "at rest outside");
        assert_eq!(into_ball(x(-10.0), x(10.0), 2.9), None, "past it");
    }
}
