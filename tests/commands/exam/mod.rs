//! Tests of exams: sessions made and scored on the obstetric phantom.

// clippy.toml allows these in test functions only, not in their helpers.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod documented;
mod marks;
mod needle;
mod sessions;
mod told;

use std::collections::BTreeMap;
use std::sync::OnceLock;

use glam::{DQuat, DVec3};
use insonify::anatomy::planes::{StandardPlane, StandardPlanes, View};
use insonify::anatomy::{Axes, Mesh, Motion, Scene, Skin, Surface, TissueTable, analytic};
use insonify::exam::hand::Skill;
use insonify::exam::score::{Reference, Score, score};
use insonify::exam::session::{Session, Settings, TRUTH_EVENT, make};
use insonify::exam::{ExamError, START_TIME_NS};
use insonify::phantom::{self, Biometry, Parameters};
use insonify::pose::{Pose, TimedPose};
use insonify::recording::{Event, RecordingReader, read_all};
use insonify::settings::ContactSettings;
use insonify::transducer::Probe;

struct Place {
    planes: StandardPlanes,
    skin: Skin,
    surfaces: BTreeMap<String, Mesh>,
}

fn place() -> &'static Place {
    static PLACE: OnceLock<Place> = OnceLock::new();
    PLACE.get_or_init(|| {
        let measured = ["skull", "subarachnoid_space", "cerebellum", "fetal_skin", "long_bones"];
        let surfaces = phantom::parts(&Parameters::default(), &measured, 1.2)
            .into_iter()
            .map(|part| (part.name, part.mesh))
            .collect();
        Place { planes: phantom::planes(&Parameters::default()), skin: phantom::skin(&Parameters::default()), surfaces }
    })
}

fn planes(names: &[&str]) -> Vec<&'static StandardPlane> {
    place().planes.chosen(names).unwrap()
}

fn made(names: &[&str], skill: Skill, seed: u64) -> Session {
    let planes = planes(names);
    let duration_s = 14.0 * planes.len() as f64;
    make(&planes, &place().skin, &Settings { seed, duration_s, skill }).unwrap()
}

fn scored(poses: &[TimedPose], events: &[Event], names: &[&str]) -> Score {
    let Place { skin, surfaces, .. } = place();
    let probe = Probe::default();
    score(
        poses,
        events,
        &Reference {
            planes: planes(names),
            scene_planes: planes(&[]),
            skin: Some(skin),
            surfaces,
            contact: &ContactSettings::default(),
            probe: &probe,
            depths_mm: &[],
        },
    )
    .0
}

/// The same pose at 60 Hz over `seconds`.
fn still(pose: Pose, seconds: f64) -> Vec<TimedPose> {
    let timed = |i: u64| TimedPose { host_time_ns: START_TIME_NS + i * 16_666_667, device_time_us: i * 16_667, pose };
    (0..=(60.0 * seconds) as u64).map(timed).collect()
}

fn view(name: &str) -> &'static View {
    &planes(&[name])[0].views[0]
}

fn perfect(name: &str) -> Pose {
    view(name).pose_on(&place().skin, 2.5).unwrap()
}

/// Perfect pose for the view `name`, turned about an axis of the probe through the view's centre.
fn turned(name: &str, axis: DVec3, degrees: f64) -> Pose {
    let (pose, centre) = (perfect(name), view(name).centre_mm);
    let turn = DQuat::from_axis_angle(pose.orientation * axis, degrees.to_radians());
    Pose { position_mm: centre + turn * (pose.position_mm - centre), orientation: turn * pose.orientation }
}

#[test]
fn a_long_session_stays_on_a_small_body() {
    let mesh = analytic::sphere(glam::Vec3::new(0.0, 0.0, 32.0), 32.0, 4);
    let surfaces = vec![Surface { name: "ball".into(), tissue: 0, priority: 0, mesh }];
    let tissues = TissueTable::builtin().unwrap();
    let skin =
        Skin::of_scene(&Scene { tissues, background: 0, surfaces, motion: Motion::default(), axes: Axes::default() })
            .unwrap();
    let planes = serde_json::json!({ "version": 1, "planes": [{
        "name": "ball", "title": "middle of the ball",
        "tolerances": { "angle_deg": 10, "distance_mm": 3, "centring_mm": 20, "depth_mm": [10, 100] },
        "views": [{ "centre_mm": [0, 0, 32], "normal": [0, 1, 0], "lateral": [1, 0, 0], "to_probe": [0, 0, -1] }]
    }]});
    let planes = StandardPlanes::from_json(&planes.to_string(), std::path::Path::new("t.planes.json")).unwrap();
    for (skill, seed) in [(Skill::Novice, 1), (Skill::Novice, 2), (Skill::Trained, 3), (Skill::Expert, 4)] {
        let session = make(&planes.chosen(&["ball"]).unwrap(), &skin, &Settings { seed, duration_s: 200.0, skill });
        let session = session.unwrap();
        assert_eq!(session.poses.len(), 200 * 60 + 1, "{skill:?}");
        assert!(session.poses.iter().all(|p| p.pose.position_mm.distance(DVec3::Z * 32.0) < 60.0), "{skill:?}");
    }
}

#[test]
fn an_image_too_shallow_for_a_plane_does_not_show_it() {
    let Place { skin, surfaces, .. } = place();
    let (probe, poses) = (Probe::default(), still(perfect("head"), 4.0));
    let found = |depths_mm: &[f64]| {
        let reference = Reference {
            planes: planes(&["head"]),
            scene_planes: planes(&[]),
            skin: Some(skin),
            surfaces,
            contact: &ContactSettings::default(),
            probe: &probe,
            depths_mm,
        };
        score(&poses, &[], &reference).0.planes[0].clone()
    };
    let depths: Vec<f64> = (0..poses.len()).map(|i| if i < 120 { 30.0 } else { probe.depth_mm }).collect();
    assert_eq!((found(&[]).find_s, found(&vec![30.0; poses.len()]).found), (Some(0.0), false));
    assert!((found(&depths).find_s.unwrap() - 2.0).abs() < 0.01, "from when the depth was set");
}

#[test]
fn a_probe_within_the_body_touches_no_skin() {
    let deeper = |mm: f64| {
        let pose = perfect("head");
        Pose { position_mm: pose.transform_point(DVec3::Z * mm), ..pose }
    };
    assert_eq!(scored(&still(deeper(15.0), 1.5), &[], &["head"]).contact, 1.0, "pressed hard");
    let score = scored(&still(deeper(30.0), 1.5), &[], &["head"]);
    assert_eq!((score.contact, score.found), (0.0, 0));
}

#[test]
fn a_perfect_session_scores_full_and_measures_the_truth() {
    for name in ["head", "cerebellum", "abdomen", "femur", "heart", "spine", "profile"] {
        let score = scored(&still(perfect(name), 1.5), &[], &[name]);
        let plane = &score.planes[0];
        assert!(plane.found && (plane.points - 100.0).abs() < 1e-9, "{name}: {plane:?}");
        assert_eq!((plane.find_s, score.found), (Some(0.0), 1));
        assert!((plane.press_mm.unwrap() - 2.5).abs() < 0.01 && score.contact == 1.0);
        assert_eq!(plane.best.unwrap().landmarks_seen, plane.landmarks);
        for m in &plane.measures {
            assert!(m.error_percent.unwrap().abs() < 1.5, "{name}: {m:?}");
        }
    }
}

#[test]
fn tilts_turns_and_offsets_lose_their_own_points() {
    let plane = |pose: Pose, name: &str| scored(&still(pose, 1.5), &[], &[name]).planes.remove(0);
    // Tilted by 20 degrees about the image's horizontal, and by 15 about the beam.
    for (axis, degrees) in [(DVec3::X, 20.0), (DVec3::Z, 15.0)] {
        let tilted = plane(turned("head", axis, degrees), "head");
        let best = tilted.best.unwrap();
        assert!((best.angle_deg - degrees).abs() < 1e-6 && best.distance_mm < 1e-6, "{best:?}");
        assert!(!tilted.found && tilted.points == 0.0);
    }
    // A turn in the image leaves the plane where it is.
    let rocked = plane(turned("abdomen", DVec3::Y, 12.0), "abdomen").best.unwrap();
    assert!(rocked.angle_deg < 1e-6 && (rocked.in_plane_deg - 12.0).abs() < 1e-6);
    // Half of the angle's tolerance loses a third of its 20 points.
    let half = plane(turned("abdomen", DVec3::X, 5.0), "abdomen");
    assert!(half.found && (half.points - (100.0 - 20.0 / 3.0)).abs() < 1e-6, "{}", half.points);
    // Slid by 8 mm: a smaller section of the skull.
    let pose = perfect("head");
    let slid = Pose { position_mm: pose.transform_point(DVec3::Y * 8.0), ..pose };
    let slid = plane(slid, "head");
    assert!(!slid.found && (slid.best.unwrap().distance_mm - 8.0).abs() < 1e-6);
    let smaller = slid.measures[1].measured_mm.unwrap() / slid.measures[1].true_mm.unwrap();
    assert!((0.94..0.985).contains(&smaller), "HC {smaller}");
}

#[test]
fn a_turned_femur_is_too_short() {
    let length = |degrees: f64| {
        let score = scored(&still(turned("femur", DVec3::Z, degrees), 1.2), &[], &["femur"]);
        score.planes[0].measures[0].measured_mm.unwrap()
    };
    let femur_mm = f64::from(Biometry::default().femur_mm);
    assert!((length(0.0) - femur_mm).abs() < 0.5, "{}", length(0.0));
    assert!((length(2.0) - femur_mm).abs() < 1.0, "{}", length(2.0));
    // The slice, about 1.5 mm thick, cuts a shaft of 3.5 mm at that angle.
    let short = length(15.0);
    assert!((5.0 / 15f64.to_radians().sin() - short).abs() < 5.0 && short < 26.0, "{short}");
    // Turned about its own length it is still a femur.
    let rolled = scored(&still(turned("femur", DVec3::X, 25.0), 1.2), &[], &["femur"]);
    assert!(rolled.planes[0].found && rolled.planes[0].best.unwrap().angle_deg < 1e-6);
}

#[test]
fn off_the_skin_nothing_is_found() {
    let pose = perfect("head");
    let lifted = Pose { position_mm: pose.transform_point(DVec3::Z * -6.0), ..pose };
    let score = scored(&still(lifted, 2.0), &[], &["head"]);
    assert_eq!((score.found, score.contact), (0, 0.0));
    assert!(score.planes[0].best.unwrap().angle_deg < 1e-6, "how near it was is told all the same");
}

#[test]
fn less_than_a_second_is_not_a_hold() {
    let mut poses = still(perfect("head"), 0.9);
    assert!(!scored(&poses, &[], &["head"]).planes[0].found);
    // Holds before and after a gap are not summed.
    poses.extend(
        still(perfect("head"), 0.9).iter().map(|p| TimedPose { host_time_ns: p.host_time_ns + 2_000_000_000, ..*p }),
    );
    let plane = scored(&poses, &[], &["head"]).planes.remove(0);
    assert!(!plane.found && plane.best.is_none() && (plane.longest_hold_s - 0.9).abs() < 0.02, "{plane:?}");
}

#[test]
fn an_expert_finds_all_it_was_asked_for() {
    for seed in 0..6 {
        let session = made(&[], Skill::Expert, seed);
        let score = scored(&session.poses, &session.events, &[]);
        assert_eq!(score.found, 7, "seed {seed}: {:#?}", score.planes);
        assert!(
            score.points.unwrap() > 90.0 && score.contact > 0.85,
            "seed {seed}: {:?} {}",
            score.points,
            score.contact
        );
        for m in score.planes.iter().flat_map(|p| &p.measures) {
            assert!(m.error_percent.unwrap().abs() < 3.0, "seed {seed}: {m:?}");
        }
        let names: Vec<_> = score.calipers.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["BPD", "HC", "TCD", "AC", "FL"]);
        for c in &score.calipers {
            assert!(c.error_percent.unwrap().abs() < 6.0, "seed {seed}: {c:?}");
        }
        // Each plane was found before its `leave` event.
        let found: Vec<f64> = score.planes.iter().map(|p| p.find_s.unwrap()).collect();
        let search = session.events.iter().filter(|e| e.value.as_ref().is_some_and(|v| v["phase"] == "leave"));
        assert!(search.clone().count() >= found.len(), "seed {seed}");
        for (find_s, leave) in found.iter().zip(search) {
            let leave_s = (leave.host_time_ns - START_TIME_NS) as f64 * 1e-9;
            assert!(*find_s < leave_s, "seed {seed}: found at {find_s} s, left at {leave_s} s");
        }
    }
}

#[test]
fn a_session_that_goes_nowhere_near_finds_nothing() {
    // Along the mother's left, over womb and bowel only, facing her back.
    let skin = &place().skin;
    let poses: Vec<TimedPose> = still(Pose::IDENTITY, 20.0)
        .into_iter()
        .enumerate()
        .map(|(i, timed)| {
            let y = 90.0 + 20.0 * (i as f64 * 0.02).sin();
            let contact = skin.exit(DVec3::new(70.0, y, -20.0), DVec3::Z).unwrap();
            TimedPose { pose: Pose::looking(contact - DVec3::Z * 2.0, DVec3::NEG_Z, DVec3::Y), ..timed }
        })
        .collect();
    let score = scored(&poses, &[], &[]);
    assert_eq!((score.found, score.points), (0, Some(0.0)));
    assert!(score.contact == 1.0 && score.path_mm > 100.0);
}

#[test]
fn novices_do_worse_than_trained_hands_and_those_worse_than_experts() {
    let mean = |skill| {
        let points = |seed| {
            let session = made(&["head", "abdomen", "femur", "heart"], skill, seed);
            scored(&session.poses, &[], &["head", "abdomen", "femur", "heart"]).points.unwrap()
        };
        (0..8).map(points).sum::<f64>() / 8.0
    };
    let (novice, trained, expert) = (mean(Skill::Novice), mean(Skill::Trained), mean(Skill::Expert));
    assert!(novice + 10.0 < trained && trained < expert, "{novice} {trained} {expert}");
    assert!(novice > 5.0, "a novice finds something: {novice}");
}

#[test]
fn a_seed_gives_its_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = |seed: u64, name: &str| {
        let path = dir.path().join(name);
        made(&["abdomen", "femur"], Skill::Novice, seed).write(&path, "obstetric phantom").unwrap();
        std::fs::read(path).unwrap()
    };
    let first = bytes(5, "a.mcap");
    assert!(first == bytes(5, "b.mcap"));
    assert!(first != bytes(6, "c.mcap"));
    // The recording is complete, and its truth events do not affect the score.
    let (poses, summary) = read_all(RecordingReader::open(&dir.path().join("a.mcap")).unwrap()).unwrap();
    assert!(summary.is_clean() && poses.len() == 28 * 60 + 1, "{summary}");
    let truths: Vec<_> = summary.events.iter().filter(|e| e.name == TRUTH_EVENT).cloned().collect();
    assert!(truths.len() >= 6, "{truths:?}");
    let others: Vec<_> = summary.events.iter().filter(|e| e.name != TRUTH_EVENT).cloned().collect();
    let names = ["abdomen", "femur"];
    assert_eq!(scored(&poses, &summary.events, &names), scored(&poses, &others, &names));
}

#[test]
fn hands_move_as_hands_can() {
    for (skill, seed) in [(Skill::Novice, 1), (Skill::Trained, 2), (Skill::Expert, 3)] {
        let session = made(&[], skill, seed);
        let (mut off, mut fastest) = (0, 0.0f64);
        for pair in session.poses.windows(2) {
            let way = pair[0].pose.position_mm.distance(pair[1].pose.position_mm) * 60.0;
            let turn = pair[0].pose.orientation.angle_between(pair[1].pose.orientation).to_degrees() * 60.0;
            assert!(way < 300.0 && turn < 150.0, "{} {way} mm/s {turn} degrees/s", skill.name());
            fastest = fastest.max(way);
            off += usize::from(place().skin.press_mm(&pair[0].pose).is_none_or(|mm| mm < 0.0));
        }
        let off = off as f64 / session.poses.len() as f64;
        assert!(fastest > 20.0 && (0.005..0.25).contains(&off), "{}: {off} of the time off the skin", skill.name());
    }
}

#[test]
fn too_little_time_is_refused() {
    let settings = Settings { seed: 1, duration_s: 10.0, skill: Skill::Expert };
    let error = make(&planes(&["head", "abdomen"]), &place().skin, &settings).unwrap_err();
    assert!(matches!(error, ExamError::TooShort { planes: 2, .. }), "{error}");
}
