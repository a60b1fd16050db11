//! A simulated exam: a freehand sweep over the obstetric phantom, recorded as tracker data.
//!
//! The probe's face stays pressed into the mother's skin while the hand moves between the standard views of
//! [`KEY_FRAMES`], as in an exam at 22 weeks: head, heart, abdomen, spine, femur, placenta.

use std::path::Path;

use glam::{DVec3, Vec3};

use super::{ExamError, START_TIME_NS, encode, on_skin};
use crate::phantom::{self, Landmarks, Parameters};
use crate::pose::freehand::{Tremor, Waypoint, view_at};
use crate::pose::{Pose, TimedPose};
use crate::recording::Event;

/// Length of the exam, s.
pub const DURATION_S: u32 = 24;

/// Pose rate, Hz.
pub const RATE_HZ: u32 = 60;

/// Seed of the exam in `assets/exams`.
pub const SEED: u64 = 22;

/// Depth of the centre of the face in the skin, mm.
const PRESS_MM: f64 = 2.5;

/// Names of the standard views, and times at which the hand rests there, s from the start.
pub const KEY_FRAMES: [(&str, f64); 6] =
    [("head", 4.0), ("heart", 8.4), ("abdomen", 11.7), ("spine", 15.9), ("femur", 19.4), ("placenta", 23.2)];

/// Writes the exam of `seed` over the phantom to `path`; deterministic. Its key frames are events.
///
/// # Errors
/// The file cannot be written, or [`ExamError::NoSkin`].
pub fn write(path: &Path, seed: u64) -> Result<(), ExamError> {
    let parameters = Parameters::default();
    let skin = phantom::skin(&parameters);
    let poses = sweep(&phantom::landmarks(&parameters), |from, along| skin.exit(from, along), seed)?;
    let events = KEY_FRAMES.map(|(name, time_s)| Event::new(START_TIME_NS + (time_s * 1e9).round() as u64, name));
    encode(path, "obstetric phantom", &poses, &[], &events)
}

/// Poses of the exam of `seed`, at [`RATE_HZ`] over [`DURATION_S`].
///
/// `skin` returns the point at which a line from inside the body (mm) along a unit direction leaves the skin.
///
/// # Errors
/// [`ExamError::NoSkin`] if `skin` returns `None`.
pub fn sweep(
    landmarks: &Landmarks,
    skin: impl Fn(DVec3, DVec3) -> Option<DVec3>,
    seed: u64,
) -> Result<Vec<TimedPose>, ExamError> {
    let waypoints = waypoints(landmarks);
    let tremor = Tremor::new(seed);
    let pose = |i: u32| {
        let time_s = f64::from(i) / f64::from(RATE_HZ);
        let (target_mm, orientation) = view_at(&waypoints, time_s).unwrap_or_default();
        let (shift, turn) = tremor.at(time_s);
        let orientation = (orientation * turn).normalize();
        let device_time_us = u64::from(i) * 1_000_000 / u64::from(RATE_HZ);
        on_skin(device_time_us, (target_mm, orientation), shift, PRESS_MM, &skin)
    };
    (0..=DURATION_S * RATE_HZ).map(pose).collect()
}

/// Waypoints at the standard views. Each is computed from its target, the direction from there to the probe, and the
/// lateral direction.
fn waypoints(landmarks: &Landmarks) -> Vec<Waypoint> {
    let view = |arrive_s, leave_s, target_mm: DVec3, up: DVec3, lateral: DVec3| {
        let orientation = Pose::looking(target_mm, -up, lateral).orientation;
        Waypoint { arrive_s, leave_s, target_mm, orientation }
    };
    let d = |v: &Vec3| v.as_dvec3();
    let (head, vertex, left) = (d(&landmarks.head_centre_mm), d(&landmarks.head_vertex), d(&landmarks.fetus_left));
    let face = d(&landmarks.head_face);
    let (heart, heart_cranial) = (d(&landmarks.heart_centre_mm), d(&landmarks.heart_cranial));
    let (abdomen, cranial) = (d(&landmarks.abdomen_centre_mm), d(&landmarks.abdomen_cranial));
    let ventral = d(&landmarks.abdomen_ventral);
    // The heart is seen from the fetus's left, towards the mother's abdomen. Its transverse planes contain left and
    // ventral.
    let heart_up = across(left, heart_cranial);
    let abdomen_up = across(left, cranial);
    // The spine is seen from the left and behind, along its thoracic and lumbar part.
    let [spine_top, spine_end] = [3, 5].map(|i: usize| d(&landmarks.spine_mm[i]));
    let spine_up = across(abdomen_up * 0.8 - ventral * 0.6, spine_top - spine_end);
    let [hip, knee] = landmarks.left_femur_mm.map(|p| d(&p));
    let femur_up = across(DVec3::Z, knee - hip);
    let (placenta, placenta_up) = (d(&landmarks.placenta_centre_mm), d(&landmarks.placenta_outward));
    vec![
        view(0.0, 0.4, head + vertex * 14.0, left, face),
        view(2.6, 5.0, head, left, face),
        view(7.4, 9.0, heart, heart_up, heart_up.cross(heart_cranial)),
        view(10.6, 12.4, abdomen, abdomen_up, ventral),
        view(14.9, 16.6, 0.5 * (spine_top + spine_end), spine_up, spine_top - spine_end),
        view(18.5, 20.2, 0.5 * (hip + knee), femur_up, knee - hip),
        view(22.3, f64::from(DURATION_S), placenta, placenta_up, DVec3::X),
    ]
}

/// Component of `direction` perpendicular to `axis`, normalised.
fn across(direction: DVec3, axis: DVec3) -> DVec3 {
    direction.reject_from(axis).normalize_or(DVec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::interpolate;
    use crate::recording::poses;

    fn exam() -> Vec<TimedPose> {
        let parameters = Parameters::default();
        let skin = phantom::skin(&parameters);
        sweep(&phantom::landmarks(&parameters), |from, along| skin.exit(from, along), SEED).unwrap()
    }

    fn key_pose(exam: &[TimedPose], name: &str) -> Pose {
        let time_s = KEY_FRAMES.iter().find(|(n, _)| *n == name).unwrap().1;
        interpolate(exam, START_TIME_NS + (time_s * 1e9) as u64, 100_000_000).unwrap()
    }

    /// Distance of `point` from the image plane, mm, and its depth along the central scanline, mm.
    fn seen(pose: &Pose, point: Vec3) -> (f64, f64) {
        let probe = pose.orientation.conjugate() * (point.as_dvec3() - pose.position_mm);
        (probe.y.abs(), probe.z)
    }

    #[test]
    fn the_face_stays_pressed_into_the_skin() {
        let skin = phantom::organs(&Parameters::default()).into_iter().find(|o| o.name == "skin").unwrap().solid;
        for timed in exam() {
            let depth = -skin.distance_mm(timed.pose.position_mm.as_vec3());
            assert!((0.5..4.5).contains(&depth), "{depth} mm deep at {:?}", timed.pose.position_mm);
            let inward = -skin.normal(timed.pose.position_mm.as_vec3()).as_dvec3();
            let tilt = (timed.pose.orientation * DVec3::Z).angle_between(inward).to_degrees();
            assert!(tilt < 50.0, "the probe is tilted by {tilt} degrees against the skin");
        }
    }

    #[test]
    fn the_probe_moves_as_a_hand_can() {
        let exam = exam();
        assert_eq!(exam.len(), 1441);
        for pair in exam.windows(2) {
            let seconds = (pair[1].host_time_ns - pair[0].host_time_ns) as f64 * 1e-9;
            let speed = pair[0].pose.position_mm.distance(pair[1].pose.position_mm) / seconds;
            let turn = pair[0].pose.orientation.angle_between(pair[1].pose.orientation).to_degrees() / seconds;
            assert!(speed < 160.0 && turn < 90.0, "{speed} mm/s, {turn} degrees/s at {}", pair[0].device_time_us);
        }
    }

    #[test]
    fn key_frames_are_the_standard_views() {
        let (exam, l) = (exam(), phantom::landmarks(&Parameters::default()));
        let plane = |name: &str| key_pose(&exam, name).orientation * DVec3::Y;
        let tilt = |name, normal: Vec3| plane(name).dot(normal.as_dvec3().normalize()).abs().acos().to_degrees();
        let targets = [
            ("head", l.head_centre_mm),
            ("heart", l.heart_centre_mm),
            ("abdomen", l.abdomen_centre_mm),
            ("spine", l.spine_mm[4]),
            ("femur", l.left_femur_mm[0]),
            ("femur", l.left_femur_mm[1]),
            ("placenta", l.placenta_centre_mm),
        ];
        for (name, target) in targets {
            let (off_plane, depth) = seen(&key_pose(&exam, name), target);
            assert!(off_plane < 3.0, "{name}: {off_plane} mm off the plane");
            assert!((15.0..140.0).contains(&depth), "{name}: {depth} mm deep");
        }
        for (name, normal) in [("head", l.head_vertex), ("heart", l.heart_cranial), ("abdomen", l.abdomen_cranial)] {
            assert!(tilt(name, normal) < 3.0, "{name} is tilted by {}", tilt(name, normal));
        }
        let head = key_pose(&exam, "head");
        let midline = (head.orientation.conjugate() * l.head_face.as_dvec3()).normalize();
        assert!(midline.x > 0.99, "the midline lies across the beam: {midline}");
        let femur = key_pose(&exam, "femur").orientation.conjugate()
            * (l.left_femur_mm[1] - l.left_femur_mm[0]).as_dvec3().normalize();
        assert!(femur.x.abs() > 0.99, "the femur lies across the beam: {femur}");
    }

    #[test]
    fn the_recorded_exam_is_what_the_command_makes() {
        let committed = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/exams/obstetric_sweep.mcap");
        let dir = tempfile::tempdir().unwrap();
        let made = dir.path().join("exam.mcap");
        write(&made, SEED).unwrap();
        let (found, summary) = poses(&made).unwrap();
        assert!(summary.is_clean() && found.len() == 1441, "{summary}");
        assert!(summary.duration.as_secs_f64() >= 20.0);
        assert_eq!(summary.events.len(), KEY_FRAMES.len());
        let same = std::fs::read(&made).unwrap() == std::fs::read(&committed).unwrap_or_default();
        assert!(same, "{} is out of date: run `insonify exam --out` it", committed.display());
    }
}
