//! Recordings of simulated hands that do an exercise.

use std::path::Path;

use serde_json::json;

use super::hand::{HandSession, Phase, Plan, RATE_HZ};
use crate::exam::batch::{KeyFrame, Skills, WrittenExam};
use crate::exam::{ExamError, LATENCY_NS, START_TIME_NS, encode};
use crate::pose::{Calibration, Pose, TimedPose};
use crate::recording::Event;

/// Name of the events that tell the hand's intention: `{"pass": 1, "phase": "aim" | "advance" | "rest" | "withdraw"}`.
/// The first event also has `aim_mm` and `entry_mm`.
pub const TRUTH_EVENT: &str = "truth.needle";

/// Properties that all sessions of an exercise share.
#[derive(Debug)]
pub struct Exercises {
    /// Name of the scene, as the recordings state it.
    pub scene: String,
    /// Plan of the exercise.
    pub plan: Plan,
    /// Skill of the simulated hands.
    pub skills: Skills,
    /// Calibration of the station that reads the recordings. The recorded poses of the probe are those that its tracker
    /// would measure.
    pub probe: Calibration,
    /// Calibration of the needle's sensor: the probe's, with the needle's mounting in place of the probe's.
    pub needle: Calibration,
}

impl Exercises {
    /// Makes the session of `seed` and writes it to `path`: bytes of two sensors, 0 on the probe and 1 on the needle. The
    /// same seed gives the same file.
    ///
    /// # Errors
    /// The file can't be written.
    pub fn write(&self, seed: u64, path: &Path) -> Result<WrittenExam, ExamError> {
        let skill = self.skills.of(seed);
        let HandSession { samples, phases } = self.plan.session(skill, seed);
        let timed = |time_s: f64, pose: Pose| {
            let device_time_us = (1e6 * time_s).round() as u64;
            TimedPose { host_time_ns: START_TIME_NS + device_time_us * 1000 + LATENCY_NS, device_time_us, pose }
        };
        let measured = |pose: Option<Pose>, time_s: f64, by: &Calibration| {
            pose.map(|pose| timed(time_s, by.tracker_from_sensor(pose)))
        };
        let probe: Vec<TimedPose> =
            samples.iter().filter_map(|sample| measured(sample.probe, sample.time_s, &self.probe)).collect();
        let of_needle = samples.iter().filter_map(|sample| {
            measured(sample.needle.map(|needle| needle.scene_from_needle), sample.time_s, &self.needle)
        });
        let events: Vec<Event> = phases.iter().enumerate().map(|(nth, phase)| self.event(phase, nth == 0)).collect();
        encode(path, &self.scene, &probe, &of_needle.collect::<Vec<_>>(), &events)?;
        let rests = phases.iter().filter(|phase| phase.name == "rest");
        Ok(WrittenExam {
            path: path.to_owned(),
            seed,
            skill: Some(skill.name()),
            duration_s: samples.last().map_or(0.0, |last| last.time_s),
            rate_hz: RATE_HZ,
            key_frames: rests
                .map(|rest| KeyFrame { name: format!("end of pass {}", rest.pass), time_s: rest.time_s })
                .collect(),
        })
    }

    fn event(&self, phase: &Phase, is_first: bool) -> Event {
        let Phase { time_s, pass, name } = *phase;
        let mut value = json!({ "pass": pass, "phase": name });
        if let Some(fields) = value.as_object_mut().filter(|_| is_first) {
            fields.insert("aim_mm".to_owned(), json!(self.plan.aim_mm.to_array()));
            fields.insert("entry_mm".to_owned(), json!(self.plan.entry_mm.to_array()));
        }
        Event::new(START_TIME_NS + (1e9 * time_s).round() as u64, TRUTH_EVENT).with(value)
    }
}
