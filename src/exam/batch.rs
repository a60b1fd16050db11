//! Batches of sessions over one scene, one for each seed, written as recordings.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::Serialize;

use super::hand::Skill;
use super::session::{self, RATE_HZ, Settings, TRUTH_EVENT};
use super::{ExamError, START_TIME_NS, sweep};
use crate::anatomy::Skin;
use crate::anatomy::planes::StandardPlane;
use crate::pose::Calibration;

/// Skill of the simulated hands in a batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Skills {
    /// All hands have this skill.
    One(Skill),
    /// Each session has the next skill in turn, by its seed.
    Mixed,
}

impl FromStr for Skills {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "mixed" { Ok(Self::Mixed) } else { text.parse().map(Self::One).map_err(|e| format!("{e}, mixed")) }
    }
}

impl Skills {
    /// Skill of the hand with this seed.
    pub fn of(self, seed: u64) -> Skill {
        match self {
            Self::One(skill) => skill,
            Self::Mixed => Skill::ALL[(seed % Skill::ALL.len() as u64) as usize],
        }
    }
}

/// A written session. [`Display`](fmt::Display) lists its key frames.
#[derive(Debug, Clone, Serialize)]
pub struct WrittenExam {
    /// The recording.
    pub path: PathBuf,
    /// Seed of every random choice.
    pub seed: u64,
    /// Skill of the hand; `None` for the short sweep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skill: Option<&'static str>,
    /// Length, s.
    pub duration_s: f64,
    /// Pose rate, Hz.
    pub rate_hz: u32,
    /// Moments at which the hand holds a standard plane, or ends a pass of the needle.
    pub key_frames: Vec<KeyFrame>,
}

/// A moment at which the hand holds a standard plane, or ends a pass of the needle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KeyFrame {
    /// Name of the standard plane, or `end of pass N`.
    pub name: String,
    /// Time from the start, s.
    pub time_s: f64,
}

impl fmt::Display for WrittenExam {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hand = self.skill.map_or_else(String::new, |skill| format!(", hand: {skill}"));
        writeln!(f, "{:.1} s at {} poses a second, seed {}{hand}", self.duration_s, self.rate_hz, self.seed)?;
        self.key_frames.iter().try_for_each(|k| writeln!(f, "{:6.1} s  {}", k.time_s, k.name))?;
        writeln!(f, "{}", self.path.display())
    }
}

/// Properties that all sessions of a batch share.
#[derive(Debug)]
pub struct Batch<'a> {
    /// Name of the scene, as the recordings state it.
    pub scene: String,
    /// Skin that the probe touches.
    pub skin: &'a Skin,
    /// Standard planes that the hand searches for, in this order.
    pub planes: Vec<&'a StandardPlane>,
    /// Whether the seed determines the order of the planes instead.
    pub shuffle: bool,
    /// Length of a session, s.
    pub duration_s: f64,
    /// Skill of the simulated hands.
    pub skills: Skills,
    /// Calibration of the station that reads the recordings. The recorded poses are those that its tracker would
    /// measure.
    pub calibration: Calibration,
}

impl Batch<'_> {
    /// Makes the session of `seed` and writes it to `path`. The same seed gives the same file.
    ///
    /// # Errors
    /// Errors of [`session::make`], or the file can't be written.
    pub fn write(&self, seed: u64, path: &Path) -> Result<WrittenExam, ExamError> {
        let skill = self.skills.of(seed);
        let mut planes = self.planes.clone();
        if self.shuffle {
            session::shuffle(&mut planes, seed);
        }
        let mut made = session::make(&planes, self.skin, &Settings { seed, duration_s: self.duration_s, skill })?;
        if self.calibration != Calibration::default() {
            made.poses.iter_mut().for_each(|timed| timed.pose = self.calibration.tracker_from_sensor(timed.pose));
        }
        made.write(path, &self.scene)?;
        let holds = made.events.iter().filter(|event| event.name == TRUTH_EVENT);
        let key_frames = holds.filter_map(|event| {
            let value = event.value.as_ref().filter(|value| value["phase"] == "hold")?;
            let time_s = (event.host_time_ns - START_TIME_NS) as f64 * 1e-9;
            Some(KeyFrame { name: value["plane"].as_str()?.to_owned(), time_s })
        });
        Ok(WrittenExam {
            path: path.to_owned(),
            seed,
            skill: Some(skill.name()),
            duration_s: self.duration_s,
            rate_hz: RATE_HZ,
            key_frames: key_frames.collect(),
        })
    }
}

/// Writes `count` sessions by `write`, which takes a seed and a path. The seeds are consecutive from `first` on, and the
/// files are `session_SEED.mcap` in the directory `out`. `progress` receives the number of finished sessions, from several
/// threads.
///
/// # Errors
/// The first error of `write`.
pub fn write_all(
    first: u64,
    count: u32,
    out: &Path,
    write: &(dyn Fn(u64, &Path) -> Result<WrittenExam, ExamError> + Sync),
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Vec<WrittenExam>, ExamError> {
    let done = AtomicUsize::new(0);
    let written = (0..u64::from(count)).into_par_iter().map(|i| {
        let seed = first.wrapping_add(i);
        let written = write(seed, &out.join(format!("session_{seed:06}.mcap")))?;
        progress(done.fetch_add(1, Ordering::Relaxed) + 1);
        Ok(written)
    });
    written.collect()
}

/// Writes the short sweep over the phantom to `path`, as [`sweep::write`] does.
///
/// # Errors
/// Errors of [`sweep::write`].
pub fn write_sweep(path: &Path, seed: u64) -> Result<WrittenExam, ExamError> {
    sweep::write(path, seed)?;
    let key_frames = sweep::KEY_FRAMES.map(|(name, time_s)| KeyFrame { name: name.to_owned(), time_s });
    Ok(WrittenExam {
        path: path.to_owned(),
        seed,
        skill: None,
        duration_s: f64::from(sweep::DURATION_S),
        rate_hz: sweep::RATE_HZ,
        key_frames: key_frames.into(),
    })
}
