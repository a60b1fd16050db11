//! Score of the needle in a recorded session.

use insonify::Scene;
use insonify::exam::needle::{Exercise, GaussianSlice, NeedleReference, NeedleScore, NeedleTrack, Sample, score};
use insonify::needle::Needle;
use insonify::pipeline::replay::RecordedExam;
use insonify::pose::TimedPose;
use insonify::station::Station;

use crate::commands::Failure;

/// Longest time for which a pose of the needle counts after its measurement, ns.
const HELD_NS: u64 = 500_000_000;

/// Poses of probe and needle in a recorded session, in the order of time. Empty for a recording without a needle.
pub(super) fn needle_samples(exam: &RecordedExam) -> Vec<Sample> {
    if exam.needle.is_empty() {
        return Vec::new();
    }
    let mut next = 0;
    let sample = |(probe, &frozen): (&TimedPose, &bool)| {
        while exam.needle.get(next).is_some_and(|needle| needle.host_time_ns <= probe.host_time_ns) {
            next += 1;
        }
        let last = next.checked_sub(1).and_then(|last| exam.needle.get(last));
        // A frozen picture holds the needle and the scene, so nothing happens in it.
        let held = last.filter(|last| !frozen && probe.host_time_ns - last.host_time_ns <= HELD_NS);
        // The recorded poses don't say whether the turn about the shaft was measured, and the score doesn't need it.
        let needle = held.map(|held| Needle { scene_from_needle: held.pose, bevel_known: false });
        // Time of the scene, so that moving surfaces are where they were in the session until it was frozen.
        let time_s = 1e-9 * probe.host_time_ns.saturating_sub(exam.summary.info.start_time_ns) as f64;
        Sample { time_s, probe: Some(probe.pose), needle }
    };
    exam.poses.iter().zip(&exam.frozen).map(sample).collect()
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
