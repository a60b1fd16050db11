//! Exams: sessions of a simulated hand, and scoring of a trainee's session.
//!
//! [`session`] generates freehand sessions in which a hand searches, finds, holds and leaves a scene's standard planes.
//! [`sweep`] is the short exam in `assets/exams`. Both are recordings of raw tracker bytes, equal for equal seeds.
//! [`score`] compares any recording with the planes: it finds which planes were shown and when ([`offset`]), and
//! compares measurements with true values ([`measure`]). [`needle`] is about exercises with a tracked needle.

mod batch;
pub mod hand;
pub mod measure;
pub mod needle;
pub mod offset;
pub mod score;
pub mod session;
pub mod slide;
mod subject;
pub mod sweep;

use std::path::Path;

use glam::{DQuat, DVec3};
use thiserror::Error;

pub use batch::{Batch, KeyFrame, Skills, WrittenExam, write_all, write_sweep};
pub use subject::{SubjectError, planes_of};

use crate::pose::{Pose, TimedPose};
use crate::recording::{Event, RecordingError, RecordingInfo, RecordingWriter};
use crate::tracker::{NeedleSensor, ProbeSensor, Protocol, ascii_line};

/// Start time of generated exams: 1 January 2026, ns since 1970 (UTC). It is fixed to make files reproducible.
pub const START_TIME_NS: u64 = 1_767_225_600_000_000_000;

/// Time from a simulated measurement to the arrival of its first byte on the host, ns.
const LATENCY_NS: u64 = 2_000_000;

/// Errors in generating exams.
#[derive(Debug, Error)]
pub enum ExamError {
    /// The line from a view's target to the probe does not hit the skin.
    #[error("no skin is found {time_s:.2} s after the start, from {target_mm} mm along {direction}")]
    NoSkin {
        /// Time from the start, s.
        time_s: f64,
        /// Target of the probe in the scene, mm.
        target_mm: DVec3,
        /// Unit direction from the target to the probe.
        direction: DVec3,
    },
    /// A plane is not visible to any probe on the skin.
    #[error(
        "plane `{plane}`: the line from its centre {centre_mm} mm along {direction} meets no skin to put a probe on"
    )]
    OutOfReach {
        /// Name of the plane.
        plane: String,
        /// Centre of the plane, mm.
        centre_mm: DVec3,
        /// Unit direction from the centre to the probe.
        direction: DVec3,
    },
    /// The duration is too short to find and hold every plane.
    #[error("{duration_s} s are too short for {planes} planes: a plane takes at least {least_s} s")]
    TooShort {
        /// Requested length, s.
        duration_s: f64,
        /// Number of planes.
        planes: usize,
        /// Least duration for a plane, s.
        least_s: f64,
    },
    /// The exercise with a needle can't be done.
    #[error(transparent)]
    Needle(#[from] needle::hand::HandError),
    /// The recording can't be written.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

/// Pose of a probe on the skin, aimed at `target_mm`, with the hand's tremor `shift`. Lateral tremor slides the probe
/// on the skin; tremor along the beam is pressure. `press_mm` is the depth of the face in the skin. `skin` returns the
/// point at which a line from inside the body along a unit direction leaves the body.
fn on_skin(
    device_time_us: u64,
    (target_mm, orientation): (DVec3, DQuat),
    shift: DVec3,
    press_mm: f64,
    skin: impl Fn(DVec3, DVec3) -> Option<DVec3>,
) -> Result<TimedPose, ExamError> {
    let target_mm = target_mm + orientation * DVec3::new(shift.x, shift.y, 0.0);
    let into_body = orientation * DVec3::Z;
    let contact = skin(target_mm, -into_body).ok_or_else(|| ExamError::NoSkin {
        time_s: device_time_us as f64 * 1e-6,
        target_mm,
        direction: -into_body,
    })?;
    Ok(TimedPose {
        host_time_ns: START_TIME_NS + device_time_us * 1000 + LATENCY_NS,
        device_time_us,
        pose: Pose { position_mm: contact + into_body * (press_mm + shift.z), orientation },
    })
}

/// Number of the needle's sensor in generated exams. The probe's is 0.
const NEEDLE_SENSOR: u16 = 1;

/// Writes a recording of `poses` of the probe, and of `needle` at the same times if there is one, as lines of a tracker,
/// interleaved with `events`, which must be in the order of time.
fn encode(
    path: &Path,
    scene: &str,
    poses: &[TimedPose],
    needle: &[TimedPose],
    events: &[Event],
) -> Result<(), ExamError> {
    let has_needle = !needle.is_empty();
    let info = RecordingInfo {
        protocol: Protocol::AsciiLine,
        device: "simulated hand".to_owned(),
        scene: scene.to_owned(),
        start_time_ns: START_TIME_NS,
        sensor: has_needle.then_some(ProbeSensor::Number(0)),
        needle: has_needle.then_some(NeedleSensor::Number(NEEDLE_SENSOR)),
    };
    let mut events = events.iter().peekable();
    let mut writer = RecordingWriter::create(path, &info)?;
    for (sequence, timed) in (0..).zip(poses) {
        while let Some(event) = events.next_if(|event| event.host_time_ns <= timed.host_time_ns) {
            writer.event(event)?;
        }
        let line = ascii_line::encode(sequence, timed.device_time_us, &timed.pose);
        writer.raw(timed.host_time_ns, line.as_bytes())?;
        if let Some(needle) = needle.get(sequence as usize) {
            let line = ascii_line::encode_of(NEEDLE_SENSOR, sequence, needle.device_time_us, &needle.pose);
            writer.raw(needle.host_time_ns, line.as_bytes())?;
        }
    }
    // Events after the last pose.
    events.try_for_each(|event| writer.event(event))?;
    Ok(writer.finish()?)
}
