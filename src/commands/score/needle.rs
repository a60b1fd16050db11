//! Score of the needle in a recorded session.

use insonify::Scene;
use insonify::exam::needle::{Exercise, GaussianSlice, NeedleReference, NeedleScore, NeedleTrack, Sample, score};
use insonify::pipeline::replay::RecordedExam;
use insonify::station::Station;

use crate::commands::Failure;

/// Poses of probe and needle in a recorded session, in the order of time. Empty for a recording without a needle.
pub(super) fn needle_samples(_exam: &RecordedExam) -> Vec<Sample> {
    // Recordings have the poses of one tool.
    Vec::new()
}

/// The station's exercise in its scene, and the elevational profile of its probe.
pub(super) struct Judge<'a> {
    exercise: &'a Exercise,
    scene: &'a Scene,
    station: &'a Station,
    profile: GaussianSlice,
}

impl<'a> Judge<'a> {
    /// Judge of the station's exercise; `None` if it has none.
    pub(super) fn of(station: &'a Station, scene: &'a Scene) -> Option<Self> {
        let exercise = station.exercise.as_ref()?;
        Some(Self { exercise, scene, station, profile: GaussianSlice(station.probe) })
    }

    /// Exercise, scene and probe for the score and its page.
    pub(super) fn reference(&self) -> NeedleReference<'_> {
        let Self { exercise, scene, station, profile } = self;
        NeedleReference { exercise, scene, probe: &station.probe, profile }
    }

    /// Score and track of a session.
    pub(super) fn score(&self, exam: &RecordedExam) -> Result<(NeedleScore, NeedleTrack), Failure> {
        score(&needle_samples(exam), &self.reference()).map_err(|e| Failure::Input(e.into()))
    }
}
