use glam::{DQuat, DVec2, DVec3};
use insonify_core::pose::Pose;
use insonify_core::random;
use insonify_core::settings::LookSettings;

use super::twin::{AnglePicture, compounded};
use super::*;

const RULES: Rules = Rules { registration: true, reach_mm: 4.0 };
const DEPTH_MM: f64 = 100.0;

fn sector() -> Sector {
    Sector { width: 90, height: 70, pixel_mm: 0.2, corner_mm: DVec2::new(-9.0, 0.0) }
}

fn place(pose: Pose) -> Place {
    Place::new(pose, DEPTH_MM, true)
}

/// Pose from a position (mm), a turn about the slice's normal, and a tilt about the lateral axis (radians).
fn pose(position_mm: [f64; 3], turn: f64, tilt: f64) -> Pose {
    let orientation = DQuat::from_rotation_y(turn) * DQuat::from_rotation_x(tilt);
    Pose { position_mm: position_mm.into(), orientation }
}

/// A picture with random levels that shows a random part of its pixels.
fn random_angle(seed: u64, pose: Pose) -> AnglePicture {
    let pixels = u64::from(sector().width * sector().height);
    AnglePicture {
        pose,
        covers: (0..pixels).map(|i| random::at(seed, i) > 0.2).collect(),
        levels: (0..pixels).map(|i| (255.0 * random::at(seed + 50, i)) as u8).collect(),
    }
}

/// A picture of a smooth pattern that is fixed in the scene.
fn smooth_angle(pose: Pose) -> AnglePicture {
    let sector = sector();
    let level = |i: u32| {
        let point = sector.pixel_centre_mm(i % sector.width, i / sector.width);
        let world = pose.transform_point(DVec3::new(point.x, 0.0, point.y));
        (150.0 + 60.0 * (0.9 * world.x).sin() * (0.7 * world.z).cos()) as u8
    };
    let pixels = sector.width * sector.height;
    AnglePicture { pose, covers: vec![true; pixels as usize], levels: (0..pixels).map(level).collect() }
}

fn new(angles: &[AnglePicture], range_db: f64) -> Compounding {
    let pixels = angles[0].levels.len();
    let covered = (0..pixels)
        .map(|i| angles.iter().enumerate().map(|(k, angle)| u16::from(angle.covers[i]) << k).sum())
        .collect();
    Compounding::new(sector(), vec![255; pixels].into(), covered, angles.len(), range_db)
}

/// The mean after adding the angles one after another.
fn picture(angles: &[AnglePicture], rules: Rules, range_db: f64) -> Vec<u8> {
    let mut compounding = new(angles, range_db);
    let mut mean = Vec::new();
    for (k, angle) in angles.iter().enumerate() {
        mean.clone_from(&angle.levels);
        compounding.add(k, place(angle.pose), rules, &mut mean);
    }
    mean
}

fn largest_difference(a: &[u8], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(&a, b)| (f64::from(a) - b).abs()).fold(0.0, f64::max)
}

#[test]
fn angles_are_even_and_end_with_none() {
    let degrees =
        |angles, span| steering(angles, span).iter().map(|a| a.to_degrees().round() as i32).collect::<Vec<_>>();
    assert_eq!(degrees(1, 30.0), [0]);
    assert_eq!(degrees(3, 30.0), [-15, 15, 0]);
    assert_eq!(degrees(5, 20.0), [-10, 10, -5, 5, 0]);
}

#[test]
fn a_mean_is_its_twins_at_rest() {
    for range_db in [30.0, 60.0, 120.0, 190.0] {
        let mut angles = [1, 2, 3].map(|seed| random_angle(seed, Pose::IDENTITY));
        let mut compounding = new(&angles, range_db);
        let mut add = |angles: &[AnglePicture], k: usize| {
            let mut mean = angles[k].levels.clone();
            compounding.add(k, place(angles[k].pose), RULES, &mut mean);
            mean
        };
        let twin = |angles: &[AnglePicture]| compounded(&sector(), angles, &Pose::IDENTITY, range_db);
        for k in 0..3 {
            let mean = add(&angles, k);
            // Pixels that only later angles show are black, in the twin, too.
            let off = largest_difference(&mean, &twin(&angles[..=k]));
            assert!(off < 0.6, "{range_db} dB, {k}: {off}");
        }
        // Adding the same picture again changes nothing; another one replaces it, in any order.
        let before = add(&angles, 0);
        assert_eq!(add(&angles, 1), before);
        angles[1].levels = random_angle(7, Pose::IDENTITY).levels;
        let after = add(&angles, 1);
        assert!(after != before && largest_difference(&after, &twin(&angles)) < 0.6, "{range_db} dB");
        compounding.restart(0.5 * range_db);
        let again = [2, 0, 1].map(|k| {
            let mut mean = angles[k].levels.clone();
            compounding.add(k, place(angles[k].pose), RULES, &mut mean);
            mean
        });
        let twin = compounded(&sector(), &angles, &Pose::IDENTITY, 0.5 * range_db);
        assert!(largest_difference(&again[2], &twin) < 0.6, "{range_db} dB, anew");
    }
}

#[test]
fn without_registration_poses_do_not_matter_within_reach() {
    let angles = [1, 2, 3].map(|seed| random_angle(seed, pose([0.9 * seed as f64, 0.0, 0.0], 0.0, 0.0)));
    let off = picture(&angles, Rules { registration: false, ..RULES }, 60.0);
    let at_rest = angles.clone().map(|angle| AnglePicture { pose: Pose::IDENTITY, ..angle });
    assert_eq!(off, picture(&at_rest, RULES, 60.0));
    assert_ne!(off, picture(&angles, RULES, 60.0));
}

#[test]
fn a_moved_mean_is_its_twins() {
    // Translations within and across the slice: displacements of blocks are exact up to rounding.
    for last in [[0.37, 0.0, -0.91], [1.2, 0.8, 0.0], [-3.3, -1.7, 2.6]] {
        let there = pose(last, 0.0, 0.0);
        let angles = [smooth_angle(pose([0.1, 0.3, 0.2], 0.0, 0.0)), smooth_angle(Pose::IDENTITY), smooth_angle(there)];
        let twin = compounded(&sector(), &angles, &there, 60.0);
        let off = largest_difference(&picture(&angles, RULES, 60.0), &twin);
        assert!(off < 1.0, "{last:?}: {off}");
    }
    // Rotations: a block is read at the displacement of its middle.
    for (turn, tilt) in [(0.05, 0.0), (-0.03, 0.02), (0.0, -0.04)] {
        let there = pose([0.4, 0.1, 0.3], turn, tilt);
        let angles = [smooth_angle(Pose::IDENTITY), smooth_angle(there)];
        let twin = compounded(&sector(), &angles, &there, 60.0);
        let off = largest_difference(&picture(&angles, RULES, 60.0), &twin);
        assert!(off < 2.5, "{turn} {tilt}: {off}");
    }
}

#[test]
fn a_pattern_of_the_scene_stays_where_it_is() {
    // A registered mean equals the present angle; a mean without registration doesn't.
    for there in [pose([1.0, 0.0, 0.0], 0.0, 0.0), pose([0.5, 0.0, -0.7], 0.04, 0.0), pose([0.0; 3], 0.06, 0.0)] {
        let angles =
            [smooth_angle(pose([-0.6, 0.0, 0.3], -0.02, 0.0)), smooth_angle(Pose::IDENTITY), smooth_angle(there)];
        let present = angles[2].levels.iter().map(|&level| f64::from(level)).collect::<Vec<_>>();
        let registered = picture(&angles, RULES, 60.0);
        let smeared = picture(&angles, Rules { registration: false, reach_mm: 20.0 }, 60.0);
        let off = largest_difference(&registered, &present);
        assert!(off < 3.0, "{there:?}: {off}");
        assert!(largest_difference(&smeared, &present) > 4.0 * off, "{there:?}");
    }
}

#[test]
fn frames_from_beside_the_slice_leave_nothing() {
    let there = pose([0.0, 3.6, 0.0], 0.0, 0.0);
    let angles = [random_angle(1, Pose::IDENTITY), random_angle(2, there)];
    let mean = picture(&angles, RULES, 60.0);
    for (i, level) in mean.iter().enumerate() {
        if angles[1].covers[i] {
            assert!(level.abs_diff(angles[1].levels[i].max(1)) <= 1, "{i}");
        }
    }
    // Pictures that must be left out: beyond the reach, with other contact, and so far away that no pixel overlaps.
    let alone = |place: Place| {
        let mut compounding = new(&angles, 60.0);
        let mut mean = angles[0].levels.clone();
        compounding.add(0, self::place(Pose::IDENTITY), RULES, &mut mean);
        mean.clone_from(&angles[1].levels);
        compounding.add(1, place, RULES, &mut mean);
        mean
    };
    let only = compounded(&sector(), &angles[1..], &there, 60.0);
    let places = [
        place(pose([0.0, 5.0, 0.0], 0.0, 0.0)),
        Place::new(Pose::IDENTITY, DEPTH_MM, false),
        place(pose([1.0e8, 0.0, 0.0], 0.0, 0.0)),
    ];
    for place in places {
        let off = largest_difference(&alone(place), &only);
        assert!(off < 0.6, "{place:?}: {off}");
    }
}

#[test]
fn a_point_does_not_widen_on_a_slow_circle() {
    // A point in the scene, seen by 9 angles in turn over 20 frames, while the probe circles within the slice.
    let sector = sector();
    let angle = |frame: u32| {
        let turn = std::f64::consts::TAU * f64::from(frame) / 20.0;
        let pose = pose([1.3 * turn.cos(), 0.0, 1.3 * turn.sin()], 0.01 * turn.sin(), 0.0);
        let level = |i: u32| {
            let point = sector.pixel_centre_mm(i % sector.width, i / sector.width);
            let off_mm = pose.transform_point(DVec3::new(point.x, 0.0, point.y)) - DVec3::new(0.1, 0.0, 7.0);
            // A Gaussian with a standard deviation of 0.35 mm, displayed over 60 dB.
            let amplitude = (-0.5 * (off_mm / 0.35).length_squared()).exp();
            (255.0 * (1.0 + 20.0 * amplitude.max(1e-9).log10() / 60.0).clamp(0.0, 1.0)).round() as u8
        };
        let pixels = sector.width * sector.height;
        AnglePicture { pose, covers: vec![true; pixels as usize], levels: (0..pixels).map(level).collect() }
    };
    // RMS distance from the centroid, weighted by power.
    let width = |levels: &[u8]| {
        let power = |level: u8| if level == 0 { 0.0 } else { 10f64.powf((f64::from(level) / 255.0 - 1.0) * 6.0) };
        let points = || (0u32..).zip(levels).map(|(i, &level)| (sector.pixel_centre_mm(i % 90, i / 90), power(level)));
        let total: f64 = points().map(|(_, power)| power).sum();
        let centre = points().map(|(at, power)| power * at).sum::<DVec2>() / total;
        (points().map(|(at, power)| power * (at - centre).length_squared()).sum::<f64>() / total).sqrt()
    };
    let angles: Vec<AnglePicture> = (0..20).map(angle).collect();
    let mut shown = [true, false].map(|registration| {
        let mut compounding = new(&angles[..9], 60.0);
        let mut mean = Vec::new();
        for (frame, angle) in angles.iter().enumerate() {
            mean.clone_from(&angle.levels);
            compounding.add(frame % 9, place(angle.pose), Rules { registration, ..RULES }, &mut mean);
        }
        width(&mean)
    });
    let single = width(&angles[19].levels);
    shown.iter_mut().for_each(|width| *width /= single);
    let [registered, smeared] = shown;
    assert!((0.95..1.1).contains(&registered) && smeared > 1.5, "{registered} {smeared}");
}

#[test]
fn pictures_are_the_same_on_any_number_of_threads() {
    let angles = [1, 2, 3].map(|seed| random_angle(seed, pose([0.3 * seed as f64, 0.2, 0.1], 0.02, 0.01)));
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| picture(&angles, RULES, 60.0))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn places_that_a_steered_angle_does_not_show_are_the_straight_angles() {
    // The present angle shows no pixel; the straight one, far away within the slice, is shown unregistered.
    let mut angles = [random_angle(1, pose([60.0, 0.0, 0.0], 0.0, 0.0)), random_angle(2, Pose::IDENTITY)];
    (angles[0].covers, angles[1].covers) = (vec![false; 6300], vec![true; 6300]);
    let mut compounding = new(&angles, 60.0);
    let mut mean = angles[1].levels.clone();
    compounding.add(1, place(angles[1].pose), RULES, &mut mean);
    let straight = mean.clone();
    mean.clone_from(&angles[0].levels);
    compounding.add(0, place(angles[0].pose), RULES, &mut mean);
    assert_eq!(mean, straight);
    // These tests use the rules of the default settings.
    assert_eq!(Rules::of(&LookSettings::default()), RULES);
}
