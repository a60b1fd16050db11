//! Way of the needle's tip in a session: its surfaces, its position in the image, and its target.

use glam::{DVec2, DVec3};
use serde::Serialize;

use super::elevation::ElevationalProfile;
use super::exercise::{Exercise, Region};
use super::sample::Sample;
use crate::anatomy::{BvhError, Scene};
use crate::needle::{GAP_S, Needle, TipEvent, TipEventKind, TipWatch};
use crate::pose::Pose;
use crate::transducer::{Probe, Sector};

/// Level above which the tip counts as visible, dB.
const VISIBLE_DB: f64 = -6.0;

/// Exercise, scene and probe of a session.
pub struct NeedleReference<'a> {
    /// The exercise. Its surfaces are in the scene.
    pub exercise: &'a Exercise,
    /// The scene.
    pub scene: &'a Scene,
    /// The probe.
    pub probe: &'a Probe,
    /// Elevational profile of the probe.
    pub profile: &'a dyn ElevationalProfile,
}

/// The needle relative to the image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TipInSlice {
    /// Distance of the tip from the image plane, mm.
    pub offset_mm: f64,
    /// Angle between the shaft and the image plane, degrees.
    pub angle_deg: f64,
    /// Whether the image shows the tip: it is in the sector, at −6 dB or more.
    pub visible: bool,
}

/// Crossing of a surface by the tip.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NeedleEvent {
    /// Time since the session's start, s.
    pub time_s: f64,
    /// `entered`, `re-entered` or `left`.
    pub kind: &'static str,
    /// Name of the surface.
    pub surface: String,
    /// Name of its tissue.
    pub tissue: String,
    /// Place in the scene, mm.
    pub position_mm: DVec3,
    /// Number of punctures of this surface so far.
    pub punctures: u32,
    /// Whether the exercise forbids the surface.
    pub forbidden: bool,
}

impl NeedleEvent {
    /// Whether the tip entered a surface that the exercise forbids.
    pub fn is_forbidden_puncture(&self) -> bool {
        self.forbidden && self.kind != TipEventKind::Left.name()
    }
}

/// A moment on the tip's way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Moment {
    /// Time since the session's start, s.
    pub time_s: f64,
    /// Position of the tip in the scene, mm.
    pub position_mm: DVec3,
}

/// Way of the tip; each list has an entry for each sample with a needle.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct NeedleTrack {
    /// Time since the session's start, s.
    pub time_s: Vec<f64>,
    /// Position of the tip in the scene, mm.
    pub tip_mm: Vec<DVec3>,
    /// Advance along the shaft since the first sample, mm.
    pub advance_mm: Vec<f64>,
    /// Whether the tip is inside a surface of the scene.
    pub in_tissue: Vec<bool>,
    /// The needle relative to the image; `None` without a probe.
    pub slice: Vec<Option<TipInSlice>>,
    /// Crossings of surfaces, in order.
    pub events: Vec<NeedleEvent>,
    /// Moment at which the tip first entered a surface; `None` if it never did.
    pub entry: Option<Moment>,
    /// Moment at which the tip first reached the target; `None` if it never did.
    pub reached: Option<Moment>,
    /// Last pose of the probe while the tip was in tissue.
    #[serde(skip)]
    pub probe: Option<Pose>,
}

impl NeedleTrack {
    /// Follows the tip through all samples, which are in ascending time.
    ///
    /// # Errors
    /// Errors of [`TipWatch::new`].
    pub fn of(samples: &[Sample], reference: &NeedleReference<'_>) -> Result<Self, BvhError> {
        let mut follower = NeedleFollower::new(TipWatch::new(reference.scene)?);
        for sample in samples {
            follower.advance(sample, reference);
        }
        Ok(follower.track)
    }

    fn add(
        &mut self,
        sample: &Sample,
        needle: &Needle,
        events: &[TipEvent],
        medium: Option<usize>,
        reference: &NeedleReference<'_>,
    ) {
        let here = Moment { time_s: sample.time_s, position_mm: needle.tip_mm() };
        let before = self.time_s.last().zip(self.tip_mm.last());
        let before = before.map(|(&time_s, &position_mm)| Moment { time_s, position_mm });
        let entered = events.iter().find(|event| event.kind != TipEventKind::Left);
        let first = entered.map(moment).or(medium.map(|_| here));
        self.entry = self.entry.or(first);
        if self.reached.is_none() {
            self.reached = reached(before, here, events, medium, reference);
        }
        self.events.extend(events.iter().filter_map(|event| named(event, reference)));
        let step_mm = before.map_or(0.0, |before| needle.direction().dot(here.position_mm - before.position_mm));
        self.advance_mm.push(self.advance_mm.last().copied().unwrap_or_default() + step_mm);
        self.time_s.push(here.time_s);
        self.tip_mm.push(here.position_mm);
        self.in_tissue.push(medium.is_some());
        self.slice.push(sample.probe.map(|probe| in_slice(needle, &probe, reference)));
        if medium.is_some() {
            self.probe = sample.probe.or(self.probe);
        }
    }

    /// Time that a sample stands for, s: until the next one, but not over a gap.
    pub(super) fn lasts_s(&self, index: usize) -> f64 {
        let next_s = self.time_s.get(index + 1).zip(self.time_s.get(index));
        next_s.map_or(0.0, |(next, here)| (next - here).clamp(0.0, GAP_S))
    }
}

/// Follows a session sample by sample.
#[derive(Debug, Clone)]
pub struct NeedleFollower {
    watch: TipWatch,
    track: NeedleTrack,
}

impl NeedleFollower {
    /// Follower of a session that begins. `watch` is new, in the scene of the references to come.
    pub fn new(watch: TipWatch) -> Self {
        Self { watch, track: NeedleTrack::default() }
    }

    /// Adds a sample, which is no earlier than the last one. Returns the crossings of surfaces since then. A sample
    /// without a needle, or with a tip that is not finite, adds nothing. The reference is the same in each call.
    pub fn advance(&mut self, sample: &Sample, reference: &NeedleReference<'_>) -> &[NeedleEvent] {
        let known = self.track.events.len();
        if let Some(needle) = sample.needle.filter(|needle| needle.tip_mm().is_finite()) {
            self.watch.set_scene_time_s(sample.time_s);
            let events = self.watch.advance(sample.time_s, needle.tip_mm());
            self.track.add(sample, &needle, &events, self.watch.medium(), reference);
        }
        self.track.events.get(known..).unwrap_or_default()
    }

    /// The way of the tip so far.
    pub fn track(&self) -> &NeedleTrack {
        &self.track
    }
}

fn moment(event: &TipEvent) -> Moment {
    Moment { time_s: event.time_s, position_mm: event.position_mm }
}

fn named(event: &TipEvent, reference: &NeedleReference<'_>) -> Option<NeedleEvent> {
    let surface = reference.scene.surfaces.get(event.surface)?;
    Some(NeedleEvent {
        time_s: event.time_s,
        kind: event.kind.name(),
        surface: surface.name.clone(),
        tissue: reference.scene.tissues.names().get(surface.tissue).cloned().unwrap_or_default(),
        position_mm: event.position_mm,
        punctures: event.punctures,
        forbidden: reference.exercise.forbids(&surface.name),
    })
}

/// Moment of the step from `before` to `here` at which the tip reaches the target.
fn reached(
    before: Option<Moment>,
    here: Moment,
    events: &[TipEvent],
    medium: Option<usize>,
    reference: &NeedleReference<'_>,
) -> Option<Moment> {
    match &reference.exercise.target {
        target @ Region::Surface(_) => {
            let is_target = |index: usize| {
                reference.scene.surfaces.get(index).is_some_and(|surface| target.is_surface(&surface.name))
            };
            let entered = |event: &&TipEvent| event.kind != TipEventKind::Left && is_target(event.surface);
            events.iter().find(entered).map(moment).or(medium.filter(|&index| is_target(index)).map(|_| here))
        }
        Region::Ball { centre_mm, radius_mm } => {
            let before = before.filter(|before| here.time_s - before.time_s <= GAP_S).unwrap_or(here);
            let part = into_ball(before.position_mm - *centre_mm, here.position_mm - *centre_mm, *radius_mm)?;
            Some(Moment {
                time_s: before.time_s + part * (here.time_s - before.time_s),
                position_mm: before.position_mm.lerp(here.position_mm, part),
            })
        }
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

fn in_slice(needle: &Needle, scene_from_probe: &Pose, reference: &NeedleReference<'_>) -> TipInSlice {
    let probe_from_scene = scene_from_probe.inverse();
    let tip = probe_from_scene.transform_point(needle.tip_mm());
    let along = probe_from_scene.transform_vector(needle.direction());
    let depth_mm = Sector::polar(reference.probe, DVec2::new(tip.x, tip.z)).map(|(_, depth_mm)| depth_mm);
    let level_db = depth_mm.map(|depth_mm| reference.profile.level_db(tip.y.abs(), depth_mm));
    TipInSlice {
        offset_mm: tip.y.abs(),
        angle_deg: along.y.abs().min(1.0).asin().to_degrees(),
        visible: level_db.is_some_and(|level_db| level_db >= VISIBLE_DB),
    }
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
