//! Plan of a data set: its tuples, drawn from the seed before rendering.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use super::variation::whole;
use super::{DatasetError, Split, parameters};
use crate::anatomy::Skin;
use crate::anatomy::planes::StandardPlanes;
use crate::exam::hand::{Deviation, Skill, wandered};
use crate::exam::session::{self, PLANE_S};
use crate::exam::{ExamError, START_TIME_NS};
use crate::phantom::Parameters;
use crate::pose::{Pose, TimedPose, interpolate};
use crate::random::SplitMix64;

/// Two key frames of an exam must be at least this far apart (mm), or turned by at least this angle (degrees).
const APART_MM: f64 = 4.0;
const APART_DEG: f64 = 4.0;
/// Attempts to draw a key frame that is on the skin and far enough from the others.
const TRIES: usize = 40;
/// Largest distance of the probe from the skin that still gives an image, mm.
const OFF_SKIN_MM: f64 = 1.0;
/// Largest deviations of a hand that wanders about the pose of a station without standard planes.
const WANDER: Deviation = Deviation { tilt_deg: 12.0, rock_deg: 10.0, rotate_deg: 40.0, slide_mm: 12.0 };
/// Range of the simulated live sessions' frame rates, Hz.
const FRAME_RATE_HZ: (f64, f64) = (10.0, 30.0);
/// Duration of a session in which the hand wanders about a pose, s. Scenes move for this time as well.
const WANDER_S: f64 = 60.0;

/// Requested size and variety of a data set.
#[derive(Debug, Clone, PartialEq)]
pub struct Wishes {
    /// Number of tuples, at least 2.
    pub frames: usize,
    /// Seed of all random choices.
    pub seed: u64,
    /// Number of phantoms per station with a phantom scene; 0 keeps the station's own phantom.
    pub phantoms: usize,
    /// Number of tuples per exam, at least 1.
    pub frames_per_exam: usize,
    /// Share of test tuples, above 0 and below 1.
    pub test_share: f64,
    /// For each station, whether its scene is a phantom.
    pub stations: Vec<bool>,
}

/// One exam of a plan: a simulated session with its tuples.
#[derive(Debug, Clone, PartialEq)]
pub struct Exam {
    /// Number of the exam in the plan, from 0.
    pub number: usize,
    /// Index of the station in the request.
    pub station: usize,
    /// Parameters of the phantom; `None` for the station's own scene.
    pub phantom: Option<Parameters>,
    /// Seed of the exam's session, settings and frames.
    pub seed: u64,
    /// Skill of the simulated hand.
    pub skill: Skill,
    /// Split of the exam: training or test.
    pub split: Split,
    /// Indices of the exam's tuples.
    pub tuples: Range<usize>,
}

/// The exams of a data set.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Exams, grouped by station, and by phantom within a station.
    pub exams: Vec<Exam>,
}

/// How the poses of an exam arise.
pub enum Source<'a> {
    /// A simulated hand searches for standard planes on the skin.
    Planes(&'a StandardPlanes, &'a Skin),
    /// A simulated hand wanders about this pose.
    About(Pose),
}

/// A key frame of an exam, which becomes a tuple.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// Index of the tuple.
    pub index: usize,
    /// Time in the session, s.
    pub time_s: f64,
    /// Pose `scene_from_probe` at that time.
    pub pose: Pose,
    /// Seed of the tuple's frames.
    pub seed: u32,
    /// Frame rate of the simulated live session, Hz.
    pub frame_rate_hz: f64,
    /// Poses of the previous frames of the live session, oldest first.
    pub before: Vec<Pose>,
}

/// A part of a data set that one run makes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Number of the shard, 1..=of.
    pub number: usize,
    /// Total number of shards.
    pub of: usize,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((number, of)) if (1..=of).contains(&number) && of <= 100_000 => Ok(Self { number, of }),
            _ => Err("expected i/n with i from 1 to n, such as 3/8".to_owned()),
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl Shard {
    /// The shard's exams. They are consecutive, so few shards need the same phantom.
    pub fn of<'a>(&self, exams: &'a [Exam]) -> &'a [Exam] {
        let bound = |number: usize| exams.len() * number / self.of;
        &exams[bound(self.number - 1)..bound(self.number)]
    }
}

impl Plan {
    /// Plans a data set for `wishes`. Equal wishes give equal plans.
    ///
    /// The test split holds whole phantoms, or whole exams of stations with their own scenes. The number of phantoms or
    /// exams in it is the nearest to `test_share`; each split gets at least one.
    ///
    /// # Errors
    /// Too few tuples for training and test, a share outside 0..1, no stations, no frames per exam, or a single
    /// phantom.
    pub fn new(wishes: &Wishes) -> Result<Self, DatasetError> {
        let Wishes { frames, frames_per_exam, test_share, phantoms, ref stations, .. } = *wishes;
        let wrong = |text: String| Err(DatasetError::Plan(text));
        if !(test_share > 0.0 && test_share < 1.0) {
            return wrong(format!("a test share of {test_share} is none: it must be above 0 and below 1"));
        }
        if frames_per_exam == 0 || stations.is_empty() {
            return wrong("an exam must have a frame, and a data set a station".to_owned());
        }
        if phantoms == 1 && stations.contains(&true) {
            return wrong("one phantom cannot be shared between training and test: ask for 2 or more, or for 0: exams of the station's own".to_owned());
        }
        let mut random = SplitMix64::new(wishes.seed ^ 0x6461_7461_7365_7421);
        let mut exams = Vec::new();
        let mut first = 0;
        for (station, &is_phantom) in stations.iter().enumerate() {
            let last = frames * (station + 1) / stations.len();
            let groups = if is_phantom && phantoms > 0 { phantoms } else { 0 };
            let count = (last - first).div_ceil(frames_per_exam);
            let units = if groups > 0 { groups.min(count) } else { count };
            if units < 2 {
                return wrong(format!(
                    "{} frames of a station are too few: a session has {frames_per_exam}, and training and test need one each; take {} \
                     frames or more, fewer a session, or 2 phantoms or more",
                    last - first,
                    frames_per_exam + 1
                ));
            }
            let tests = ((test_share * units as f64).round() as usize).clamp(1, units - 1);
            let phantom_seeds: Vec<u64> = (0..groups).map(|_| whole(&mut random)).collect();
            for nth in 0..count {
                // Phantoms (or exams) have consecutive numbers; the last ones are the test split.
                let unit = nth * units / count;
                let skill = Skill::ALL[exams.len() % Skill::ALL.len()];
                exams.push(Exam {
                    number: exams.len(),
                    station,
                    phantom: phantom_seeds.get(unit).map(|&seed| parameters(seed)),
                    seed: whole(&mut random),
                    skill,
                    split: if unit >= units - tests { Split::Test } else { Split::Train },
                    tuples: first + nth * (last - first) / count..first + (nth + 1) * (last - first) / count,
                });
            }
            first = last;
        }
        Ok(Self { exams })
    }
}

impl Exam {
    /// Key frames of the exam: spread over its session, on the skin, and far enough from each other. Each has the poses
    /// of up to `frames_before` previous frames, at a random frame rate. If the hand wanders about a pose, it rests at
    /// each key frame.
    ///
    /// # Errors
    /// Errors of [`session::make`].
    pub fn moments(&self, source: &Source, frames_before: u32) -> Result<Vec<Moment>, ExamError> {
        let mut random = SplitMix64::new(self.seed ^ 0x6d6f_6d65_6e74);
        let count = self.tuples.len();
        let mut moments: Vec<Moment> = Vec::with_capacity(count);
        let session = match source {
            Source::Planes(planes, skin) => {
                let mut chosen: Vec<_> = planes.planes.iter().collect();
                session::shuffle(&mut chosen, self.seed);
                let duration_s = PLANE_S * chosen.len() as f64;
                session::make(&chosen, skin, &session::Settings { seed: self.seed, duration_s, skill: self.skill })?
                    .poses
            }
            Source::About(_) => Vec::new(),
        };
        for (nth, index) in self.tuples.clone().enumerate() {
            let mut found = None;
            for _ in 0..TRIES {
                let part = (nth as f64 + random.unit()) / count as f64;
                let (time_s, pose) = match source {
                    Source::Planes(..) => at(&session, part),
                    Source::About(pose) => (part * WANDER_S, wandered(pose, &WANDER, &mut random)),
                };
                let on_skin = match source {
                    Source::Planes(_, skin) => skin.press_mm(&pose).is_none_or(|mm| mm > -OFF_SKIN_MM),
                    Source::About(_) => true,
                };
                let apart = moments.iter().all(|other| is_apart(&other.pose, &pose));
                found = Some((time_s, pose));
                if on_skin && apart {
                    break;
                }
            }
            let Some((time_s, pose)) = found else { continue };
            // Rounded to three decimals, so that every reader of the manifest recovers it exactly.
            let time_s = (1e3 * time_s).round() / 1e3;
            let seed = whole(&mut random) as u32;
            let frame_rate_hz = frame_rate_hz(seed);
            let before = match source {
                Source::Planes(..) => before(&session, time_s, frame_rate_hz, frames_before),
                Source::About(_) => vec![pose; frames_before as usize],
            };
            moments.push(Moment { index, time_s, pose, seed, frame_rate_hz, before });
        }
        Ok(moments)
    }
}

/// Time (s) and pose at the fraction `part` (0 to 1) of a session.
fn at(session: &[TimedPose], part: f64) -> (f64, Pose) {
    let index = (part * session.len() as f64) as usize;
    let Some(timed) = session.get(index).or(session.last()) else { return (0.0, Pose::IDENTITY) };
    (timed.host_time_ns.saturating_sub(START_TIME_NS) as f64 * 1e-9, timed.pose)
}

/// Random frame rate of a live session, Hz, from `seed`.
fn frame_rate_hz(seed: u32) -> f64 {
    let unit = SplitMix64::new(u64::from(seed) ^ 0x7261_7465).unit();
    // Rounded to three decimals, which a manifest holds exactly.
    (1e3 * (FRAME_RATE_HZ.0 + unit * (FRAME_RATE_HZ.1 - FRAME_RATE_HZ.0))).round() / 1e3
}

/// Poses of the `count` frames before `time_s`, oldest first; fewer near the start of the session.
fn before(session: &[TimedPose], time_s: f64, frame_rate_hz: f64, count: u32) -> Vec<Pose> {
    let pose = |frames: u32| {
        let ns = 1e9 * (time_s - f64::from(frames) / frame_rate_hz);
        (ns >= 0.0).then(|| interpolate(session, START_TIME_NS + ns as u64, u64::MAX)).flatten()
    };
    let mut poses: Vec<Pose> = (1..=count).map_while(pose).collect();
    poses.reverse();
    poses
}

fn is_apart(a: &Pose, b: &Pose) -> bool {
    let angle_deg = a.orientation.angle_between(b.orientation).to_degrees();
    a.position_mm.distance(b.position_mm) >= APART_MM || angle_deg >= APART_DEG
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};
    use proptest::prelude::*;

    fn wishes() -> Wishes {
        Wishes { frames: 600, seed: 1, phantoms: 15, frames_per_exam: 8, test_share: 0.1, stations: vec![true, false] }
    }

    fn key(exam: &Exam) -> (usize, Option<u64>, Option<usize>) {
        let phantom = exam.phantom.map(|p| p.seed);
        (exam.station, phantom, phantom.is_none().then_some(exam.number))
    }

    proptest! {
        #[test]
        fn every_tuple_is_planned_once_and_no_phantom_is_in_both(
            frames in 40usize..700, seed: u64, phantoms in 0usize..12, per in 1usize..12, share in 0.01f64..0.99,
            stations in proptest::collection::vec(any::<bool>(), 1..3),
        ) {
            prop_assume!(phantoms != 1);
            let wishes = Wishes { frames, seed, phantoms, frames_per_exam: per, test_share: share, stations };
            let plan = match Plan::new(&wishes) {
                Ok(plan) => plan,
                Err(e) => { prop_assert!(e.to_string().contains("too few")); return Ok(()) }
            };
            let tuples: Vec<usize> = plan.exams.iter().flat_map(|e| e.tuples.clone()).collect();
            prop_assert_eq!(tuples, (0..frames).collect::<Vec<_>>());
            let keys = |split| -> std::collections::HashSet<_> {
                plan.exams.iter().filter(|e| e.split == split).map(key).collect()
            };
            let (train, test) = (keys(Split::Train), keys(Split::Test));
            prop_assert!(train.is_disjoint(&test) && !train.is_empty() && !test.is_empty());
            prop_assert!(plan.exams.iter().all(|e| e.tuples.len() <= per && !e.tuples.is_empty()));
            prop_assert_eq!(&Plan::new(&wishes).unwrap(), &plan);
            for of in [1, 3, 7] {
                let parts = (1..=of).flat_map(|number| Shard { number, of }.of(&plan.exams).to_vec());
                prop_assert_eq!(&parts.collect::<Vec<_>>(), &plan.exams);
            }
        }
    }

    #[test]
    fn another_seed_is_another_data_set() {
        let seeds = |seed| -> Vec<u64> {
            Plan::new(&Wishes { seed, ..wishes() }).unwrap().exams.iter().map(|e| e.seed).collect()
        };
        assert!(seeds(1).iter().zip(seeds(2)).all(|(a, b)| *a != b));
    }

    #[test]
    fn wishes_that_cannot_be_met_say_why() {
        for (wishes, word) in [
            (Wishes { test_share: 0.0, ..wishes() }, "share of 0"),
            (Wishes { test_share: f64::NAN, ..wishes() }, "share of NaN"),
            (Wishes { phantoms: 1, ..wishes() }, "one phantom"),
            (Wishes { frames: 10, ..wishes() }, "too few"),
            (Wishes { stations: vec![], ..wishes() }, "a station"),
        ] {
            let error = Plan::new(&wishes).unwrap_err().to_string();
            assert!(error.contains(word), "{error}");
        }
    }

    #[test]
    fn key_frames_of_the_phantom_lie_apart_and_on_the_skin() {
        let exam = Plan::new(&wishes()).unwrap().exams[0].clone();
        let parameters = exam.phantom.unwrap();
        let skin = crate::phantom::skin(&parameters);
        let planes = crate::phantom::planes(&parameters);
        let source = Source::Planes(&planes, &skin);
        let moments = exam.moments(&source, 2).unwrap();
        assert_eq!(moments.iter().map(|m| m.index).collect::<Vec<_>>(), exam.tuples.clone().collect::<Vec<_>>());
        for (i, a) in moments.iter().enumerate() {
            assert!(skin.press_mm(&a.pose).unwrap() > -OFF_SKIN_MM);
            assert!(moments[..i].iter().all(|b| is_apart(&a.pose, &b.pose) && b.time_s < a.time_s && b.seed != a.seed));
        }
        assert_eq!(exam.moments(&source, 2).unwrap(), moments);
        for moment in &moments {
            assert!((10.0..=30.0).contains(&moment.frame_rate_hz));
            assert_eq!(moment.before.len(), 2);
            // A hand moves less than a metre per second, and the last previous pose is nearest to the key frame's.
            let far = |pose: &Pose| pose.position_mm.distance(moment.pose.position_mm);
            assert!(moment.before.iter().all(|pose| far(pose) < 100.0), "{:?}", moment.before);
        }
        assert!(moments.iter().any(|m| m.before[0] != m.pose && m.before[0] != m.before[1]));
        let same: Vec<_> = exam.moments(&source, 0).unwrap().into_iter().map(|m| (m.pose, m.seed)).collect();
        assert_eq!(same, moments.iter().map(|m| (m.pose, m.seed)).collect::<Vec<_>>());
    }

    #[test]
    fn a_hand_without_planes_wanders_about_a_pose() {
        let exam = Exam { tuples: 5..25, phantom: None, ..Plan::new(&wishes()).unwrap().exams[0].clone() };
        let home = Pose { position_mm: DVec3::new(1.0, 2.0, 3.0), orientation: DQuat::from_rotation_x(1.0) };
        let moments = exam.moments(&Source::About(home), 2).unwrap();
        assert_eq!(moments.len(), 20);
        for moment in &moments {
            assert!(moment.pose.position_mm.distance(home.position_mm) < 1.5 * 1.5 * WANDER.slide_mm);
        }
    }

    #[test]
    fn a_shard_is_one_of_how_many() {
        assert_eq!("3/8".parse(), Ok(Shard { number: 3, of: 8 }));
        for text in ["0/8", "9/8", "3", "a/b", "1/0", "-1/2", "1/200000"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }
}
