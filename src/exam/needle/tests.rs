//! Tests of score and simulated hands in a scene of balls and blocks.

use glam::{DQuat, DVec3, Vec3};

use super::hand::{self, HandError, Plan};
use super::*;
use crate::anatomy::{Scene, TissueTable, analytic};
use crate::exam::hand::Skill;
use crate::needle::Needle;
use crate::pose::Pose;
use crate::transducer::{Probe, ProbeKind};

/// A body from z = 0 down, a cyst in its middle at 30 mm, and a vessel above the cyst at x = −12 mm.
fn scene() -> Scene {
    let part = |name, tissue, priority, mesh| analytic::Part { name, tissue, priority, mesh };
    let parts = vec![
        part("body", "soft_tissue", 1, analytic::cuboid(Vec3::new(-60.0, -40.0, 0.0), Vec3::new(60.0, 40.0, 80.0))),
        part("cyst", "water", 3, analytic::sphere(Vec3::new(0.0, 0.0, 30.0), 7.0, 4)),
        part("vessel", "blood", 2, analytic::sphere(Vec3::new(-12.0, 0.0, 20.0), 3.0, 4)),
    ];
    analytic::scene(parts, &TissueTable::builtin().unwrap(), "gel").unwrap()
}

fn exercise(approach: Approach) -> Exercise {
    Exercise {
        name: "Cyst".into(),
        target: Region::Surface("cyst".into()),
        entry: Some(Region::Surface("body".into())),
        forbidden: vec!["vessel".into()],
        approach,
        time_s: 30.0,
    }
}

fn probe() -> Probe {
    Probe { kind: ProbeKind::Linear { width_mm: 72.0 }, depth_mm: 60.0, ..Probe::default() }
}

/// The needle with its tip here, along `direction`, and the probe at the origin.
fn sample(time_s: f64, tip_mm: DVec3, direction: DVec3) -> Sample {
    let orientation = DQuat::from_rotation_arc(DVec3::Z, direction.normalize());
    let needle = Needle { scene_from_needle: Pose { position_mm: tip_mm, orientation }, bevel_known: false };
    Sample { time_s, probe: Some(Pose::IDENTITY), needle: Some(needle) }
}

/// A needle that visits these points on straight ways, at 10 mm/s and 50 Hz, always along `direction`.
fn way(points: &[[f64; 3]], direction: DVec3) -> Vec<Sample> {
    let mut samples = Vec::new();
    let mut time_s = 0.0;
    for pair in points.windows(2) {
        let (from, to) = (DVec3::from_array(pair[0]), DVec3::from_array(pair[1]));
        let count = (from.distance(to) / 0.2).ceil().max(1.0) as u32;
        for i in 0..count {
            samples.push(sample(time_s, from.lerp(to, f64::from(i) / f64::from(count)), direction));
            time_s += 0.02;
        }
    }
    samples.extend(points.last().map(|last| sample(time_s, DVec3::from_array(*last), direction)));
    samples
}

fn judged(samples: &[Sample], exercise: &Exercise) -> NeedleScore {
    let (scene, probe) = (scene(), probe());
    let profile = GaussianSlice(probe);
    let reference = NeedleReference { exercise, scene: &scene, probe: &probe, profile: &profile };
    score(samples, &reference).unwrap().0
}

fn lost(score: &NeedleScore) -> Vec<&'static str> {
    score.deductions.iter().map(|deduction| deduction.criterion.name()).collect()
}

/// Way in the image plane from the left to the cyst's middle.
const DOWN: DVec3 = DVec3::new(30.0, 0.0, 30.0);

#[test]
fn a_straight_puncture_in_the_plane_loses_nothing() {
    let score =
        judged(&way(&[[35.0, 0.0, -5.0], [0.0, 0.0, 30.0]], DVec3::new(-1.0, 0.0, 1.0)), &exercise(Approach::InPlane));
    assert!(score.points > Some(99.9), "{score}");
    let entry = score.entry.unwrap();
    assert!(entry.position_mm.distance(DVec3::new(30.0, 0.0, 0.0)) < 0.1, "{entry:?}");
    assert_eq!((score.entry_surface.as_deref(), score.right_entry), (Some("body"), Some(true)));
    // From the skin to the near side of the cyst: 42.4 − 7 mm at 10 mm/s.
    assert!((score.path_mm - 35.4).abs() < 0.2 && score.straightness > 0.999, "{score}");
    assert!((score.time_to_target_s.unwrap() - 3.54).abs() < 0.05, "{score}");
    assert!(score.angle_deg.unwrap() < 1e-6 && score.offset_mm.unwrap() < 1e-9);
    assert!((score.passes, score.final_mm) == (1, 0.0) && score.sideways_mm < 1e-6);
    let kinds: Vec<_> = score.events.iter().map(|event| (event.kind.name(), event.surface.as_deref())).collect();
    assert_eq!(kinds, [("entered", Some("body")), ("entered", Some("cyst")), ("target-reached", None)]);
}

#[test]
fn forbidden_punctures_are_listed_with_time_and_place() {
    let samples = way(&[[-42.0, 0.0, -10.0], [-2.0, 0.0, 30.0]], DOWN);
    let score = judged(&samples, &exercise(Approach::InPlane));
    assert_eq!(lost(&score), ["forbidden puncture"]);
    assert!((score.points.unwrap() - 80.0).abs() < 0.1, "{score}");
    let puncture = score.forbidden().next().unwrap();
    assert!((puncture.position_mm.distance(DVec3::new(-12.0, 0.0, 20.0)) - 3.0).abs() < 0.05, "{puncture:?}");
    assert!(score.to_string().contains("forbidden"), "{score}");
}

#[test]
fn passes_detours_and_a_hidden_tip_have_their_deductions() {
    // Beside the image plane by 9 mm, past the cyst, back by 12 mm, and to the side into the cyst.
    let points = [[30.0, 9.0, -5.0], [2.0, 9.0, 30.0], [8.0, 9.0, 20.0], [4.0, 2.0, 29.0]];
    let score = judged(&way(&points, DVec3::new(-1.0, 0.2, 1.2)), &exercise(Approach::InPlane));
    assert!(score.reached.is_some(), "{score}");
    assert_eq!(score.passes, 2);
    assert!(score.visible < 0.3 && score.offset_mm.unwrap() > 6.0, "{score}");
    let lost = lost(&score);
    for name in ["tip visible", "approach", "straightness", "passes"] {
        assert!(lost.contains(&name), "{name}: {score}");
    }
}

#[test]
fn a_missed_target_costs_points_and_tells_the_distance() {
    let score = judged(
        &way(&[[40.0, 0.0, -10.0], [20.0, 0.0, 10.0], [40.0, 0.0, -10.0]], -DOWN + 2.0 * DVec3::Z * 30.0),
        &exercise(Approach::Any),
    );
    assert_eq!(score.reached, None);
    // From (20, 0, 10) to the ball about (0, 0, 30).
    assert!((score.final_mm - (800.0_f64.sqrt() - 7.0)).abs() < 0.3, "{score}");
    assert_eq!(score.passes, 1, "drawing the needle out is no pass");
    let lost = lost(&score);
    assert!(lost.starts_with(&["target", "time", "final distance"]), "{lost:?}");
    let ball = Exercise {
        target: Region::Ball { centre_mm: DVec3::new(20.0, 0.0, 10.0), radius_mm: 2.0 },
        ..exercise(Approach::Any)
    };
    let score = judged(&way(&[[40.0, 0.0, -10.0], [20.0, 0.0, 10.0]], DVec3::new(-1.0, 0.0, 1.0)), &ball);
    let reached = score.reached.unwrap().position_mm;
    assert!((reached.distance(DVec3::new(20.0, 0.0, 10.0)) - 2.0).abs() < 1e-6, "{reached}");
}

#[test]
fn a_wrong_entry_and_a_session_without_a_needle_are_told() {
    let elsewhere = Region::Ball { centre_mm: DVec3::new(-30.0, 0.0, 0.0), radius_mm: 10.0 };
    let exercise = Exercise { entry: Some(elsewhere), ..exercise(Approach::Any) };
    let score = judged(&way(&[[35.0, 0.0, -5.0], [0.0, 0.0, 30.0]], DVec3::new(-1.0, 0.0, 1.0)), &exercise);
    assert_eq!((score.right_entry, lost(&score)), (Some(false), vec!["entry"]));
    let none = [Sample { time_s: 0.0, probe: Some(Pose::IDENTITY), needle: None }];
    let score = judged(&none, &exercise);
    assert_eq!((score.points, score.not_judged), (None, Some("the session has no pose of the needle")));
    let outside = judged(&way(&[[35.0, 0.0, -5.0], [30.0, 0.0, -5.0]], DVec3::X), &exercise);
    assert_eq!(outside.points, None);
    assert!(outside.to_string().contains("never in a surface"), "{outside}");
}

#[test]
fn an_own_profile_decides_what_is_visible() {
    let (scene, probe, exercise) = (scene(), probe(), exercise(Approach::Any));
    let samples = way(&[[35.0, 0.0, -5.0], [0.0, 0.0, 30.0]], DVec3::new(-1.0, 0.0, 1.0));
    let visible = |profile: &dyn ElevationalProfile| {
        let reference = NeedleReference { exercise: &exercise, scene: &scene, probe: &probe, profile };
        score(&samples, &reference).unwrap().0.visible
    };
    assert_eq!(visible(&|_: f64, _: f64| -7.0), 0.0);
    assert!(visible(&|_: f64, _: f64| -5.0) > 0.6);
}

#[test]
fn an_expert_reaches_the_target_in_one_pass_and_a_novice_loses_more() {
    let (scene, probe) = (scene(), probe());
    for approach in [Approach::InPlane, Approach::OutOfPlane] {
        let exercise = Exercise { forbidden: Vec::new(), ..exercise(approach) };
        let made = |skill, seed| hand::samples(&exercise, &scene, &probe, &Pose::IDENTITY, skill, seed).unwrap();
        let points = |skill: Skill| {
            let all: Vec<_> = (0..6).map(|seed| judged(&made(skill, seed), &exercise)).collect();
            assert!(all.iter().all(|score| score.reached.is_some()), "{skill:?}");
            let passes = all.iter().map(|score| score.passes).max().unwrap();
            (all.iter().map(|score| score.points.unwrap()).sum::<f64>() / 6.0, passes)
        };
        assert_eq!(made(Skill::Novice, 3), made(Skill::Novice, 3));
        assert_ne!(made(Skill::Novice, 3), made(Skill::Novice, 4));
        let ((expert, one), (trained, _), (novice, many)) =
            (points(Skill::Expert), points(Skill::Trained), points(Skill::Novice));
        assert!(expert > 85.0 && one == 1, "{approach:?}: {expert}, {one} passes");
        assert!(novice < expert - 5.0 && trained <= expert && many > 1, "{approach:?}: {novice}, {trained}, {expert}");
    }
}

#[test]
fn the_plan_aims_inside_the_target_and_shows_the_way() {
    let (scene, probe) = (scene(), probe());
    let plan = |exercise: &Exercise| Plan::of(exercise, &scene, &probe, &Pose::IDENTITY);
    let inside = plan(&exercise(Approach::InPlane)).unwrap();
    assert!(inside.aim_mm.distance(DVec3::new(0.0, 0.0, 30.0)) < 4.0, "{inside:?}");
    assert!(inside.entry_mm.z.abs() < 0.01 && inside.entry_mm.x < -25.0, "{inside:?}");
    let in_probe = |plan: &Plan, point| plan.probe.inverse().transform_point(point);
    for point in [inside.aim_mm, inside.entry_mm] {
        assert!(in_probe(&inside, point).y.abs() < 1e-6, "{inside:?}");
    }
    let across = plan(&exercise(Approach::OutOfPlane)).unwrap();
    assert!(in_probe(&across, across.aim_mm).y.abs() < 1e-6 && in_probe(&across, across.entry_mm).y < -15.0);
    let far = Region::Ball { centre_mm: DVec3::new(500.0, 0.0, 30.0), radius_mm: 3.0 };
    let error = plan(&Exercise { target: far, ..exercise(Approach::Any) }).unwrap_err();
    assert!(matches!(error, HandError::NoSkin { .. }) && error.to_string().contains("no skin"), "{error}");
}

#[test]
fn a_tip_that_begins_in_the_target_has_reached_it_without_an_event() {
    let still: Vec<Sample> = (0..30).map(|i| sample(f64::from(i) * 0.05, DVec3::Z * 30.0, DOWN)).collect();
    let score = judged(&still, &exercise(Approach::Any));
    assert!(score.reached.is_some_and(|reached| reached.time_s == 0.0), "{score}");
    assert_eq!(score.events, []);
}
