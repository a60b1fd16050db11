//! Exercises with a needle: scores of samples, sessions step by step, simulated hands.

use std::sync::{Arc, Mutex, PoisonError};

use insonify::anatomy::Skin;
use insonify::exam::hand::Skill;
use insonify::exam::needle::hand::{Plan, samples};
use insonify::exam::needle::{
    self, GaussianSlice, Moment, NeedleEvent, NeedleFollower, NeedleReference, NeedleScore, Sample, TargetDistance,
    TipInSlice, hand::HandError,
};
use insonify::needle::{Needle, TipWatch};
use insonify::pose::Pose;
use insonify::settings::ContactSettings;
use insonify::transducer::Probe;
use pyo3::prelude::*;
use serde::Serialize;

use crate::described::Described;
use crate::errors::{Failure, Kind};
use crate::frame::{Components, components, pose_of};
use crate::planes::{Touched, touched};
use crate::scene::{Loaded, SceneKey};
use crate::work::{interruptibly, on_pool};

/// Largest time of a sample, s.
const TIME_MAX_S: f64 = 1e6;

/// An exercise in its scene, shared by its sessions.
struct Course {
    loaded: Arc<Loaded>,
    exercise: needle::Exercise,
    probe: Probe,
    contact: ContactSettings,
    profile: GaussianSlice,
    target: TargetDistance,
    skin: Skin,
    /// Pose of the station's `[pose]`, near which simulated hands hold the probe.
    start: Option<Pose>,
}

impl Course {
    fn reference(&self) -> NeedleReference<'_> {
        let Self { loaded, exercise, probe, profile, .. } = self;
        NeedleReference { exercise, scene: &loaded.scene, probe, profile }
    }

    fn follower(&self) -> NeedleFollower {
        NeedleFollower::new(TipWatch::with_bvh(&self.loaded.scene, self.loaded.bvh.clone()), &self.reference())
    }

    fn start(&self) -> Result<Pose, Failure> {
        let missing =
            || Failure::new(Kind::Input, "the station has no pose of its own, near which the exercise would be done");
        self.start.ok_or_else(missing)
    }
}

/// A sample as a caller gives it: time, pose of the probe, pose of the needle.
type Given = (f64, Option<[f64; 7]>, Option<[f64; 7]>);

/// A sample for a caller: time, pose of the probe, pose of the needle.
type Row = (f64, Option<Components>, Option<Components>);

/// Checks a sample after one at `last_s`.
fn sample_of((time_s, probe, needle): Given, last_s: Option<f64>) -> Result<Sample, Failure> {
    if !(0.0..=TIME_MAX_S).contains(&time_s) {
        let text = format!("time_s of a sample is {time_s}; it must be a number of seconds from 0 to {TIME_MAX_S}");
        return Err(Failure::new(Kind::Input, text));
    }
    if let Some(last_s) = last_s.filter(|last_s| time_s < *last_s) {
        let text = format!("time_s of a sample is {time_s}, before the last one's {last_s}; times must not fall");
        return Err(Failure::new(Kind::Input, text));
    }
    let needle = needle.map(pose_of).transpose()?;
    Ok(Sample {
        time_s,
        probe: probe.map(pose_of).transpose()?,
        needle: needle.map(|scene_from_needle| Needle { scene_from_needle, bevel_known: true }),
    })
}

fn of_hand(error: HandError) -> Failure {
    Failure::of(Kind::Scene, &error)
}

/// A score as JSON, as in `insonify score --json`, and as text.
fn told(score: &NeedleScore) -> Result<(String, String), Failure> {
    let json = serde_json::to_string(score).map_err(|error| Failure::of(Kind::Internal, &error))?;
    Ok((json, score.to_string()))
}

/// An exercise with a needle.
#[pyclass(frozen, module = "insonify._insonify")]
pub(crate) struct Exercise(Arc<Course>);

impl Exercise {
    /// The exercise in the described scene, which is loaded.
    ///
    /// # Errors
    /// The scene can't be loaded, or it lacks a surface that the exercise names.
    pub(crate) fn open(described: &Described, exercise: needle::Exercise) -> Result<Self, Failure> {
        let station = &described.station;
        let loaded = SceneKey::of(station, described.arrays.clone()).load()?;
        let names: Vec<&str> = loaded.scene.surfaces.iter().map(|surface| surface.name.as_str()).collect();
        exercise.check(&names).map_err(|error| Failure::of(Kind::Station, &error))?;
        let (target, skin) = on_pool(|| {
            let target = TargetDistance::with_bvh(&exercise.target, &loaded.scene, loaded.bvh.clone())?;
            Ok((target, Skin::of_scene(&loaded.scene)?))
        })?;
        let (probe, contact) = (station.probe, station.settings.contact);
        let (profile, start) = (GaussianSlice(probe), station.default_pose);
        Ok(Self(Arc::new(Course { loaded, exercise, probe, contact, profile, target, skin, start })))
    }
}

#[pymethods]
impl Exercise {
    /// The exercise as JSON.
    fn json(&self) -> PyResult<String> {
        Ok(serde_json::to_string(&self.0.exercise).map_err(|error| Failure::of(Kind::Internal, &error))?)
    }

    /// Score of samples in ascending time, as JSON and as text.
    fn score(&self, py: Python<'_>, samples: Vec<Given>) -> PyResult<(String, String)> {
        let mut checked: Vec<Sample> = Vec::with_capacity(samples.len());
        for given in samples {
            checked.push(sample_of(given, checked.last().map(|last| last.time_s))?);
        }
        let course = self.0.clone();
        interruptibly(py, move || {
            on_pool(|| {
                let (mut follower, reference) = (course.follower(), course.reference());
                for sample in &checked {
                    follower.advance(sample, &reference);
                }
                told(&NeedleScore::of(follower.track(), &reference)?)
            })
        })
    }

    /// Begins a session.
    fn session(&self) -> NeedleSession {
        NeedleSession { course: self.0.clone(), state: Mutex::new((self.0.follower(), None)) }
    }

    /// Point at which a simulated hand aims, point of the skin where its needle enters, and its pose of the probe.
    fn plan(&self, py: Python<'_>) -> PyResult<([f64; 3], [f64; 3], Components)> {
        let course = self.0.clone();
        interruptibly(py, move || {
            let start = course.start()?;
            let planned = || Plan::of(&course.exercise, &course.loaded.scene, &course.probe, &start).map_err(of_hand);
            let Plan { aim_mm, entry_mm, probe, .. } = on_pool(planned)?;
            Ok((aim_mm.to_array(), entry_mm.to_array(), components(&probe)))
        })
    }

    /// Samples of a simulated hand: time, pose of the probe, pose of the needle.
    fn hand(&self, py: Python<'_>, skill: &str, seed: u64) -> PyResult<Vec<Row>> {
        let unknown = || Failure::new(Kind::Input, format!("skill is `{skill}`; it must be novice, trained or expert"));
        let skill = Skill::named(skill).ok_or_else(unknown)?;
        let course = self.0.clone();
        interruptibly(py, move || {
            let start = course.start()?;
            let Course { exercise, loaded, probe, .. } = &*course;
            let made = on_pool(|| samples(exercise, &loaded.scene, probe, &start, skill, seed).map_err(of_hand))?;
            let row = |sample: &Sample| {
                let needle = sample.needle.map(|needle| components(&needle.scene_from_needle));
                (sample.time_s, sample.probe.map(|probe| components(&probe)), needle)
            };
            Ok(made.iter().map(row).collect())
        })
    }

    /// Contact of the probe with the skin.
    fn touch(&self, pose: [f64; 7]) -> PyResult<Touched> {
        Ok(touched(&self.0.skin, &self.0.probe, &pose_of(pose)?, &self.0.contact))
    }
}

/// A session that goes on, sample by sample.
#[pyclass(frozen, module = "insonify._insonify")]
pub(crate) struct NeedleSession {
    course: Arc<Course>,
    /// Follower of the tip, and time of the last sample, s.
    state: Mutex<(NeedleFollower, Option<f64>)>,
}

/// The needle after a sample.
#[derive(Serialize)]
struct Step<'a> {
    events: &'a [NeedleEvent],
    /// The needle relative to the image; none without a probe or a needle.
    slice: Option<TipInSlice>,
    /// Distance of the tip from the target at rest, mm; none without a needle.
    distance_mm: Option<f64>,
    in_tissue: bool,
    reached: Option<Moment>,
}

#[pymethods]
impl NeedleSession {
    /// Adds a sample. Returns the needle after it, as JSON.
    fn add(&self, py: Python<'_>, time_s: f64, probe: Option<[f64; 7]>, needle: Option<[f64; 7]>) -> PyResult<String> {
        let added = || {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            let (follower, last_s) = &mut *state;
            let sample = sample_of((time_s, probe, needle), *last_s)?;
            *last_s = Some(time_s);
            let known = follower.track().events.len();
            // Surfaces that move do so by the pool's threads.
            on_pool(|| {
                follower.advance(&sample, &self.course.reference());
                Ok(())
            })?;
            let track = follower.track();
            let has_needle = sample.needle.is_some();
            let step = Step {
                events: track.events.get(known..).unwrap_or_default(),
                slice: track.slice.last().copied().flatten().filter(|_| has_needle),
                distance_mm: sample.needle.map(|needle| self.course.target.distance_mm(needle.tip_mm())),
                in_tissue: has_needle && track.in_tissue.last().copied().unwrap_or_default(),
                reached: track.reached,
            };
            serde_json::to_string(&step).map_err(|error| Failure::of(Kind::Internal, &error))
        };
        Ok(py.detach(added)?)
    }

    /// Score of the samples so far, as JSON and as text.
    fn score(&self, py: Python<'_>) -> PyResult<(String, String)> {
        let course = self.course.clone();
        let track = self.state.lock().unwrap_or_else(PoisonError::into_inner).0.track().clone();
        interruptibly(py, move || on_pool(|| told(&NeedleScore::of(&track, &course.reference())?)))
    }
}
