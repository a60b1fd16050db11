//! Scores of whole sessions. A perfect one scores full, a perturbed one loses the points of its perturbation, a random
//! one finds nothing.

use insonify::random::SplitMix64;

use super::*;

const ALL: [&str; 7] = ["head", "cerebellum", "abdomen", "femur", "heart", "spine", "profile"];
/// Views whose landmarks still fit if a pose is off by half of each tolerance.
const ROOMY: [&str; 3] = ["head", "abdomen", "femur"];
const INTERVAL_NS: u64 = 16_666_667;

/// A session that moves from plane to plane within a second and holds the probe at each. `held` gives the pose at a
/// plane by the time since the hold began, s.
fn session(names: &[&str], hold_s: f64, held: impl Fn(&str, f64) -> Pose) -> Vec<TimedPose> {
    let mut poses: Vec<Pose> = Vec::new();
    for name in names {
        let target = held(name, 0.0);
        if let Some(&from) = poses.last() {
            let between = |i: usize| {
                let part = i as f64 / 60.0;
                Pose {
                    // A metre off the skin half way, so that no plane is found in passing.
                    position_mm: from.position_mm.lerp(target.position_mm, part)
                        + DVec3::Z * 1000.0 * (std::f64::consts::PI * part).sin(),
                    orientation: from.orientation.slerp(target.orientation, part),
                }
            };
            poses.extend((1..60).map(between));
        }
        poses.extend((0..=(60.0 * hold_s) as usize).map(|i| held(name, i as f64 / 60.0)));
    }
    let timed = |(i, pose): (u64, Pose)| TimedPose {
        host_time_ns: START_TIME_NS + i * INTERVAL_NS,
        device_time_us: i * INTERVAL_NS / 1000,
        pose,
    };
    (0..).zip(poses).map(timed).collect()
}

fn slid(pose: Pose, by_mm: DVec3) -> Pose {
    Pose { position_mm: pose.transform_point(by_mm), ..pose }
}

fn tolerances(name: &str) -> &'static insonify::anatomy::planes::Tolerances {
    &planes(&[name])[0].tolerances
}

#[test]
fn a_perfect_session_through_a_recording_scores_full_marks() {
    let poses = session(&ALL, 1.5, |name, _| perfect(name));
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("perfect.mcap");
    let recorded = Session { poses, events: Vec::new() };
    recorded.write(&path, "obstetric phantom").unwrap();
    let (read, summary) = read_all(RecordingReader::open(&path).unwrap()).unwrap();
    assert!(summary.is_clean() && read.len() == recorded.poses.len());
    let score = scored(&read, &[], &ALL);
    // The tracker's lines round to a hundredth of a mm and of a degree or so.
    assert!(score.found == 7 && score.points.unwrap() > 99.99, "{} found, {:?} points", score.found, score.points);
    assert!(score.planes.iter().all(|p| p.longest_hold_s > 1.4 && p.unsteady_mm.unwrap() < 0.02));
}

#[test]
fn each_perturbation_alone_loses_its_own_points() {
    let points = |held: &dyn Fn(&str, f64) -> Pose| {
        let score = scored(&session(&ROOMY, 1.5, held), &[], &ROOMY);
        assert_eq!(score.found, ROOMY.len());
        score.planes.iter().map(|p| p.points).collect::<Vec<_>>()
    };
    let each = |found: Vec<f64>, expected: f64, what: &str| {
        assert!(found.iter().all(|p| (p - expected).abs() < 0.05), "{what}: {found:?}, expected {expected}");
    };
    each(points(&|name, _| perfect(name)), 100.0, "nothing");
    // Full points up to a quarter of the tolerance, none at all of it: half of it loses a third of 20.
    each(points(&|name, _| turned(name, DVec3::Z, 0.5 * tolerances(name).angle_deg)), 100.0 - 20.0 / 3.0, "angle");
    let offset = |name: &str, _| slid(perfect(name), DVec3::Y * 0.5 * tolerances(name).distance_mm);
    each(points(&offset), 100.0 - 20.0 / 3.0, "distance");
    // A lateral oscillation of 1.75 mm RMS: half way from 0.5 to 3 mm.
    let amplitude_mm = 1.75 * std::f64::consts::SQRT_2;
    let shaken =
        |name: &str, s: f64| slid(perfect(name), DVec3::X * amplitude_mm * (s * 4.0 * std::f64::consts::PI).sin());
    let lost = points(&shaken);
    assert!(lost.iter().all(|p| (94.5..95.5).contains(p)), "steadiness: {lost:?}");
}

#[test]
fn beyond_a_tolerance_or_too_short_nothing_is_found() {
    // Each plane in a separate session: a pose off one plane may be on another.
    let found = |hold_s: f64, held: &dyn Fn(&str, f64) -> Pose| {
        let alone = |name: &str| {
            let score = scored(&session(&[name], hold_s, held), &[], &[name]);
            assert_eq!(score.points.unwrap_or(0.0) == 0.0, score.found == 0);
            score.found
        };
        ALL.iter().map(|name| alone(name)).sum::<usize>()
    };
    assert_eq!(found(0.9, &|name, _| perfect(name)), 0, "held too short");
    assert_eq!(found(1.1, &|name, _| perfect(name)), 7);
    assert_eq!(found(1.5, &|name, _| turned(name, DVec3::Z, 1.1 * tolerances(name).angle_deg)), 0, "turned");
    // In the other direction the right femur would come into view, which also counts.
    let offset = |name: &str, _| slid(perfect(name), DVec3::NEG_Y * 1.1 * tolerances(name).distance_mm);
    assert_eq!(found(1.5, &offset), 0, "slid");
    assert_eq!(found(1.5, &|name, _| slid(perfect(name), DVec3::Z * -6.0)), 0, "off the skin");
}

/// `pose` moved along the middle of its image until it is 2.5 mm in the skin; `None` if that line misses the body.
fn on_skin(pose: Pose, depth_mm: f64) -> Option<Pose> {
    let up = pose.orientation * DVec3::NEG_Z;
    let contact = place().skin.exit(pose.transform_point(DVec3::Z * depth_mm), up)?;
    Some(Pose { position_mm: contact - up * 2.5, ..pose })
}

#[test]
fn random_holds_beyond_a_tolerance_are_not_found_and_some_within_are() {
    let mut random = SplitMix64::new(7);
    let mut even = move || 2.0 * random.unit() - 1.0;
    let (mut found, mut beyond) = (0, 0);
    // Planes of one view and one angle.
    for name in ["head", "cerebellum", "abdomen", "heart", "spine", "profile"] {
        let (limits, depth_mm) = (tolerances(name), perfect(name).position_mm.distance(view(name).centre_mm));
        for _ in 0..20 {
            // A rotation about an axis in the image, and a shift along its normal, give exactly this angle and
            // distance.
            let axis = DVec3::new(even(), 0.0, even()).normalize_or(DVec3::X);
            let (angle_deg, distance_mm) = (1.6 * even() * limits.angle_deg, 1.6 * even() * limits.distance_mm);
            let held = slid(turned(name, axis, angle_deg), DVec3::Y * distance_mm);
            let Some(held) = on_skin(held, depth_mm) else { continue };
            let score = scored(&still(held, 1.5), &[], &[name]);
            if angle_deg.abs() > limits.angle_deg || distance_mm.abs() > limits.distance_mm {
                assert_eq!(score.found, 0, "{name}: {angle_deg}° about {axis}, {distance_mm} mm");
                beyond += usize::from(score.contact == 1.0);
            } else {
                found += score.found;
            }
        }
    }
    // Of 120, three in five are beyond; of the others, landmarks and contact reject some.
    assert!(beyond >= 30 && found >= 6, "{beyond} {found}");
}

/// A minute of a probe that slides, tilts and turns aimlessly over the belly. At about 90 mm and 110° per second, it
/// passes planes and holds none.
fn wandering(seed: u64) -> Vec<TimedPose> {
    let mut random = SplitMix64::new(seed);
    let mut even = move || 2.0 * random.unit() - 1.0;
    let skin = &place().skin;
    // Place on the belly (mm), turn and tilts (degrees), and their speeds.
    let mut at: [f64; 5] = [60.0 * even(), 60.0 * even(), 180.0 * even(), 20.0 * even(), 20.0 * even()];
    let mut speed = [0.0f64; 5];
    let (limits, push) = ([70.0f64, 70.0, 720.0, 35.0, 35.0], [12.0, 12.0, 25.0, 10.0, 10.0]);
    let mut poses = Vec::new();
    for i in 0..3600 {
        for axis in 0..5 {
            speed[axis] = 0.98 * speed[axis] + 0.2 * push[axis] * even();
            at[axis] += speed[axis] / 6.0;
            if at[axis].abs() > limits[axis] {
                at[axis] = at[axis].clamp(-limits[axis], limits[axis]);
                speed[axis] = -speed[axis];
            }
        }
        let turn = DQuat::from_rotation_x(at[3].to_radians()) * DQuat::from_rotation_y(at[4].to_radians());
        let Some(contact) = skin.exit(DVec3::new(at[0], at[1], -20.0), DVec3::Z) else { continue };
        let down = Pose::looking(contact - DVec3::Z * 2.0, DVec3::NEG_Z, DVec3::X);
        let orientation = (turn * down.orientation * DQuat::from_rotation_z(at[2].to_radians())).normalize();
        let time_ns = i * INTERVAL_NS;
        let pose = Pose { orientation, ..down };
        poses.push(TimedPose { host_time_ns: START_TIME_NS + time_ns, device_time_us: time_ns / 1000, pose });
    }
    poses
}

#[test]
fn a_hasty_random_walk_finds_nothing() {
    for seed in 0..8 {
        let score = scored(&wandering(seed), &[], &[]);
        assert_eq!((score.found, score.points), (0, Some(0.0)), "seed {seed}");
        assert!(score.contact > 0.5 && score.path_mm > 500.0, "seed {seed}: {} {}", score.contact, score.path_mm);
    }
}
