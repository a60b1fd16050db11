//! Arms and legs: outline, shafts of the long bones with their cartilage ends, hands, feet and girdles.

use glam::Vec3;

use super::organ;
use crate::anatomy::phantom::attitude::{Arm, Attitude, Leg};
use crate::anatomy::phantom::biometry::Biometry;
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{
    Isometry, Solid, catmull_rom, ellipsoid, round_cone, smooth_union, sphere, sweep, union,
};

/// The limbs up to the skin, fetal frame.
pub(super) fn outline(biometry: &Biometry, attitude: &Attitude) -> Solid {
    let legs = attitude.legs.iter().map(|leg| {
        let thigh = sweep(&[(leg.hip, 11.0), (leg.hip.lerp(leg.knee, 0.45), 9.4), (leg.knee, 6.9)]);
        let calf = leg.knee.lerp(leg.ankle, 0.35);
        let shank = sweep(&[(leg.knee, 6.7), (calf, 6.4), (leg.ankle, 4.3)]);
        smooth_union([thigh, shank, foot(biometry, leg, 1.0)], 2.5)
    });
    let arms = attitude.arms.iter().map(|arm| {
        let upper = sweep(&[(arm.shoulder, 8.0), (arm.shoulder.lerp(arm.elbow, 0.5), 6.4), (arm.elbow, 5.3)]);
        let fore = sweep(&[(arm.elbow, 5.2), (arm.elbow.lerp(arm.wrist, 0.3), 5.2), (arm.wrist, 3.4)]);
        smooth_union([upper, fore, hand(arm)], 2.0)
    });
    union(legs.chain(arms))
}

/// The sole's frame: origin at the ankle, y away from the sole, z to the toes.
fn sole(leg: &Leg) -> Isometry {
    let up = (leg.knee - leg.ankle).normalize();
    Isometry::from_axes(leg.ankle, up - leg.toes * up.dot(leg.toes), leg.toes)
}

fn foot(biometry: &Biometry, leg: &Leg, size: f32) -> Solid {
    let v = Vec3::new;
    let scale = biometry.foot_mm / 38.0;
    let heel = v(0.0, -4.0, -6.5 * scale);
    let ball = v(0.0, -6.5, 20.0 * scale);
    let core = sweep(&[(heel, 4.6 * size), (v(0.0, -3.5, 3.0), 4.9 * size), (ball, 3.2 * size)]);
    let toes = (0..5).map(|i| {
        let x = 2.2 * (i as f32 - 2.0);
        round_cone(
            v(0.7 * x, -6.2, 17.0 * scale),
            v(x, -7.0, (25.0 - 0.5 * (i as f32 - 1.5).powi(2)) * scale),
            2.4 * size,
            1.9 * size,
        )
    });
    smooth_union(std::iter::once(core).chain(toes), 1.6).placed(sole(leg))
}

/// The palm's frame: origin at the wrist, y to the fingers, z out of the palm.
fn palm(arm: &Arm) -> Isometry {
    Isometry::from_axes(arm.wrist, arm.fingers, (arm.elbow - arm.wrist).cross(Vec3::X))
}

/// Half-closed fingers as (root, knuckle, tip) in the palm's frame.
fn fingers() -> [[Vec3; 3]; 5] {
    let v = Vec3::new;
    std::array::from_fn(|i| {
        let x = 2.3 * (i as f32 - 1.6);
        if i == 0 {
            [v(-3.4, 3.0, 0.0), v(-6.0, 6.5, 1.5), v(-6.5, 10.0, 3.2)]
        } else {
            [v(x * 0.7, 9.0, 0.0), v(x, 14.5, 0.8), v(x * 1.05, 17.8, 4.0)]
        }
    })
}

fn hand(arm: &Arm) -> Solid {
    let palm_pad = ellipsoid(Vec3::new(0.0, 6.0, 0.0), Vec3::new(5.0, 6.5, 3.0));
    let digits = fingers().map(|[a, b, c]| sweep(&[(a, 1.8), (b, 1.6), (c, 1.35)]));
    smooth_union(std::iter::once(palm_pad).chain(digits), 1.2).placed(palm(arm))
}

/// The tips of a shaft of `length_mm` in the middle between two joints.
fn shaft_tips(from: Vec3, to: Vec3, length_mm: f32) -> [Vec3; 2] {
    let middle = 0.5 * (from + to);
    let half = 0.5 * length_mm * (to - from).normalize();
    [middle - half, middle + half]
}

/// Hip and knee tip of the ossified femur, fetal frame.
pub(in crate::anatomy::phantom) fn femur_tips(biometry: &Biometry, leg: &Leg) -> [Vec3; 2] {
    shaft_tips(leg.hip, leg.knee, biometry.femur_mm)
}

/// A shaft from tip to tip, flared at its ends, slightly bowed towards `bow`.
fn shaft([a, b]: [Vec3; 2], middle_mm: f32, end_mm: f32, bow: Vec3) -> Solid {
    let along = (b - a).normalize();
    // Ends are balls: their centres lie a radius inside the tips.
    let (a, b) = (a + along * end_mm, b - along * end_mm);
    let knots = [
        (a, end_mm),
        (a.lerp(b, 0.18) + bow * 0.6, middle_mm),
        (a.lerp(b, 0.5) + bow, middle_mm * 0.95),
        (a.lerp(b, 0.82) + bow * 0.6, middle_mm),
        (b, end_mm),
    ];
    sweep(&catmull_rom(&knots, 5))
}

/// Shafts, cartilage ends, small bones and girdles.
pub(super) fn organs(biometry: &Biometry, attitude: &Attitude) -> Vec<Organ> {
    let mut shafts = Vec::new();
    let mut ends = Vec::new();
    let mut small = Vec::new();
    for leg in &attitude.legs {
        let thigh = (leg.knee - leg.hip).normalize();
        let front = (thigh - (leg.ankle - leg.knee).normalize()).normalize();
        let side = thigh.cross(leg.ankle - leg.knee).normalize();
        shafts.push(shaft(femur_tips(biometry, leg), 1.75, 2.4, (front - thigh * front.dot(thigh)) * 1.0));
        shafts.push(shaft(shaft_tips(leg.knee, leg.ankle, biometry.tibia_mm), 1.6, 2.1, Vec3::ZERO));
        let fibula = shaft_tips(leg.knee, leg.ankle, biometry.fibula_mm).map(|p| p + side * 3.1);
        shafts.push(shaft(fibula, 0.85, 1.0, Vec3::ZERO));
        ends.push(sphere(leg.hip, 4.0));
        ends.push(smooth_union(
            [sphere(leg.knee - thigh * 1.5, 4.4), sphere(leg.knee.lerp(leg.ankle, 0.06), 4.0)],
            1.0,
        ));
        ends.push(sphere(leg.ankle, 2.9));
        small.push(foot_bones(biometry, leg));
    }
    for arm in &attitude.arms {
        let side = (arm.elbow - arm.shoulder).cross(arm.wrist - arm.elbow).normalize();
        shafts.push(shaft(shaft_tips(arm.shoulder, arm.elbow, biometry.humerus_mm), 1.6, 2.1, Vec3::ZERO));
        shafts.push(shaft(
            shaft_tips(arm.elbow, arm.wrist, biometry.ulna_mm).map(|p| p - side * 1.4),
            0.95,
            1.2,
            Vec3::ZERO,
        ));
        shafts.push(shaft(
            shaft_tips(arm.elbow, arm.wrist, biometry.radius_mm).map(|p| p + side * 1.4),
            0.9,
            1.15,
            Vec3::ZERO,
        ));
        ends.push(sphere(arm.shoulder, 3.6));
        ends.push(sphere(arm.elbow, 3.1));
        ends.push(sphere(arm.wrist, 2.0));
        small.push(hand_bones(arm));
    }
    vec![
        organ("cartilage", "cartilage", 122, 0.8, 3.2, union(ends)),
        organ("long_bones", "bone_fetal", 124, 0.6, 1.6, union(shafts)),
        organ("hand_and_foot_bones", "bone_fetal", 126, 0.5, 1.05, union(small)),
        organ("limb_girdles", "bone_fetal", 128, 0.6, 1.15, girdles(attitude)),
    ]
}

fn hand_bones(arm: &Arm) -> Solid {
    let rods = fingers().map(|[a, b, c]| {
        let wrist = a * Vec3::new(0.8, 0.0, 1.0) + Vec3::Y * 2.0;
        let rod = |p: Vec3, q: Vec3| round_cone(p.lerp(q, 0.14), p.lerp(q, 0.86), 0.7, 0.65);
        union([rod(wrist, a), rod(a, b), rod(b, c)])
    });
    union(rods).placed(palm(arm))
}

fn foot_bones(biometry: &Biometry, leg: &Leg) -> Solid {
    let v = Vec3::new;
    let scale = biometry.foot_mm / 38.0;
    let rods = (0..5).map(|i| {
        let x = 2.0 * (i as f32 - 2.0);
        let (root, head, tip) =
            (v(0.55 * x, -4.2, 7.0 * scale), v(0.8 * x, -5.8, 16.0 * scale), v(0.92 * x, -6.6, 22.5 * scale));
        union([
            round_cone(root, root.lerp(head, 0.86), 0.8, 0.7),
            round_cone(head.lerp(tip, 0.12), head.lerp(tip, 0.8), 0.7, 0.65),
        ])
    });
    let calcaneus = ellipsoid(v(0.0, -4.5, -4.5 * scale), v(1.6, 1.6, 2.2));
    union(rods.chain(std::iter::once(calcaneus))).placed(sole(leg))
}

/// Iliac wings, ischia, scapulae and clavicles.
fn girdles(attitude: &Attitude) -> Solid {
    let parts = [(0usize, 1.0f32), (1, -1.0)].into_iter().flat_map(|(i, side)| {
        let at = |level: f32, left: f32, ventral: f32| attitude.trunk(level, side * left, ventral);
        let tube = |knots: &[(Vec3, f32)]| sweep(&catmull_rom(knots, 5));
        let wing = union([
            tube(&[(at(24.4, 6.5, 0.0), 1.1), (at(23.2, 10.5, 3.5), 1.2), (at(23.4, 13.0, 8.5), 1.0)]),
            tube(&[(at(25.4, 6.8, 1.5), 1.1), (at(24.4, 10.0, 5.0), 1.3), (at(24.2, 12.2, 9.0), 1.0)]),
            tube(&[(at(24.4, 9.0, 3.0), 1.2), (at(25.6, 9.2, 6.0), 1.4), (at(26.4, 9.0, 8.0), 1.2)]),
        ]);
        let ischium = tube(&[(at(27.2, 8.0, 8.0), 1.2), (at(28.2, 7.0, 9.0), 1.2)]);
        let shoulder = attitude.arms[i].shoulder;
        // Between the ribs and the skin.
        let neck = shoulder.lerp(at(9.0, 12.5, 0.0), 0.3);
        let (inner, tip) = (at(9.4, 8.6, -3.8), at(12.2, 10.6, -3.1));
        let blade = union([
            tube(&[(neck, 1.0), (at(8.8, 12.3, -0.6), 0.9), (inner, 0.8)]),
            tube(&[(inner, 0.8), (at(10.8, 9.4, -4.0), 0.8), (tip, 0.8)]),
            tube(&[(neck, 0.9), (at(10.6, 13.6, -0.4), 0.8), (tip, 0.8)]),
        ]);
        let clavicle = tube(&[
            (shoulder.lerp(at(8.0, 2.0, 18.0), 0.15), 0.85),
            (shoulder.lerp(at(8.0, 2.0, 18.0), 0.5) + Vec3::new(0.0, 0.6, 1.4), 0.8),
            (at(8.6, 2.0, 18.5), 0.9),
        ]);
        [smooth_union([wing, ischium], 0.5), blade, clavicle]
    });
    union(parts)
}
