//! Way of the needle's tip in a session: its surfaces, its position in the image, and its target.

use glam::DVec3;
use serde::Serialize;

use super::elevation::ElevationalProfile;
use super::event::{NeedleEvent, NeedleEventKind};
use super::exercise::Exercise;
use super::sample::Sample;
use super::slice::TipInSlice;
use super::watch::{Moment, NeedleWatch, TipState};
use crate::anatomy::{BvhError, Scene};
use crate::needle::{GAP_S, TipWatch};
use crate::pose::Pose;
use crate::transducer::Probe;

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
    /// Events, in order.
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
        let mut follower = NeedleFollower::new(TipWatch::new(reference.scene)?, reference);
        for sample in samples {
            follower.advance(sample, reference);
        }
        Ok(follower.track)
    }

    /// Adds a sample after which the tip is in `state`. Its events are those from the index `first` on.
    fn add(&mut self, sample: &Sample, direction: DVec3, state: &TipState, first: usize) {
        let TipState { here, in_tissue, in_target, slice } = *state;
        let events = self.events.get(first..).unwrap_or_default();
        let entered = events.iter().find(|event| event.kind.is_entry()).map(Moment::from);
        self.entry = self.entry.or(entered).or(in_tissue.then_some(here));
        let reached = events.iter().find(|event| event.kind == NeedleEventKind::TargetReached).map(Moment::from);
        self.reached = self.reached.or(reached).or(in_target.then_some(here));
        let step_mm = self.tip_mm.last().map_or(0.0, |&last_mm| direction.dot(here.position_mm - last_mm));
        self.advance_mm.push(self.advance_mm.last().copied().unwrap_or_default() + step_mm);
        self.time_s.push(here.time_s);
        self.tip_mm.push(here.position_mm);
        self.in_tissue.push(in_tissue);
        self.slice.push(slice);
        if in_tissue {
            self.probe = sample.probe.or(self.probe);
        }
    }

    /// Time that a sample stands for, s: until the next one, but not over a gap.
    pub(super) fn lasts_s(&self, index: usize) -> f64 {
        let next_s = self.time_s.get(index + 1).zip(self.time_s.get(index));
        next_s.map_or(0.0, |(next, here)| (next - here).clamp(0.0, GAP_S))
    }
}

/// Follows a session sample by sample, and keeps its way.
#[derive(Debug, Clone)]
pub struct NeedleFollower {
    watch: NeedleWatch,
    track: NeedleTrack,
}

impl NeedleFollower {
    /// Follower of a session that begins. `tip` is new, in the scene of `reference`.
    pub fn new(tip: TipWatch, reference: &NeedleReference<'_>) -> Self {
        let watch = NeedleWatch::new(tip, reference.scene, Some(reference.exercise));
        Self { watch, track: NeedleTrack::default() }
    }

    /// Adds a sample, which is no earlier than the last one. Returns the events since then. A sample without a needle,
    /// or with a tip that is not finite, adds nothing. The reference is the same in each call.
    pub fn advance(&mut self, sample: &Sample, reference: &NeedleReference<'_>) -> &[NeedleEvent] {
        let known = self.track.events.len();
        let state = self.watch.advance(sample, reference.probe, reference.profile, &mut self.track.events);
        if let Some((state, needle)) = state.zip(sample.needle) {
            self.track.add(sample, needle.direction(), &state, known);
        }
        self.track.events.get(known..).unwrap_or_default()
    }

    /// The way of the tip so far.
    pub fn track(&self) -> &NeedleTrack {
        &self.track
    }
}
