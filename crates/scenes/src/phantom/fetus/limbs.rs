//! Fetal arms and legs: outline, pose, shafts of the long bones with their cartilage ends, hands, feet and girdles.

use glam::Vec3;
use insonify_core::anatomy::sdf::{
    Isometry, Solid, ellipsoid, round_cone, smooth_sweep, smooth_union, sphere, sweep, union,
};

use crate::phantom::attitude::{Arm, Attitude, Leg};
use crate::phantom::organ::{Body::Fetus, Organ};

/// The limbs up to the skin, fetal frame.
pub(super) fn outline(attitude: &Attitude) -> Solid {
    let (l, a) = (attitude.biometry.leg_scale(), attitude.biometry.arm_scale());
    let legs = attitude.legs.iter().map(|leg| {
        let thigh = sweep(&[(leg.hip, 11.0 * l), (leg.hip.lerp(leg.knee, 0.45), 9.4 * l), (leg.knee, 6.9 * l)]);
        let calf = leg.knee.lerp(leg.ankle, 0.35);
        let shank = sweep(&[(leg.knee, 6.7 * l), (calf, 6.4 * l), (leg.ankle, 4.3 * l)]);
        smooth_union([thigh, shank, foot().scaled(l).placed(sole(leg))], 2.5 * l)
    });
    let arms = attitude.arms.iter().map(|arm| {
        let upper =
            sweep(&[(arm.shoulder, 8.0 * a), (arm.shoulder.lerp(arm.elbow, 0.5), 6.4 * a), (arm.elbow, 5.3 * a)]);
        let fore = sweep(&[(arm.elbow, 5.2 * a), (arm.elbow.lerp(arm.wrist, 0.3), 5.2 * a), (arm.wrist, 3.4 * a)]);
        smooth_union([upper, fore, hand().scaled(a).placed(palm(arm))], 2.0 * a)
    });
    union(legs.chain(arms))
}

/// Balls that cover the limbs up to the skin: centre and radius, fetal frame, mm.
pub(super) fn balls(attitude: &Attitude) -> Vec<(Vec3, f32)> {
    let (l, a) = (attitude.biometry.leg_scale(), attitude.biometry.arm_scale());
    let v = Vec3::new;
    let legs = attitude.legs.iter().flat_map(|leg| {
        let sole = sole(leg);
        [
            (leg.hip, 11.0 * l),
            (leg.hip.lerp(leg.knee, 0.5), 9.4 * l),
            (leg.knee, 7.0 * l),
            (leg.knee.lerp(leg.ankle, 0.35), 6.6 * l),
            (leg.ankle, 5.0 * l),
            (sole.point(v(0.0, -4.0, -6.5) * l), 4.8 * l),
            (sole.point(v(0.0, -6.5, 20.0) * l), 5.2 * l),
            (sole.point(v(0.0, -7.0, 24.0) * l), 4.6 * l),
        ]
    });
    let arms = attitude.arms.iter().flat_map(|arm| {
        let palm = palm(arm);
        [
            (arm.shoulder, 8.0 * a),
            (arm.elbow, 5.4 * a),
            (arm.wrist, 4.0 * a),
            (palm.point(v(0.0, 8.0, 0.0) * a), 6.0 * a),
            (palm.point(v(0.0, 16.0, 2.5) * a), 5.5 * a),
        ]
    });
    legs.chain(arms).collect()
}

/// First pair of crossing bones found, as text: bones of two limbs, or a bone and the skull. `None` if no bones cross.
/// The three parts of a limb are numbered from the trunk: 0 to 2.
pub(in crate::phantom) fn crossing_bones(attitude: &Attitude) -> Option<String> {
    let (l, a) = (attitude.biometry.leg_scale(), attitude.biometry.arm_scale());
    let v = Vec3::new;
    // Ends of each bone or group of bones, and its radius.
    let legs = attitude.legs.iter().map(|leg| {
        let sole = sole(leg);
        vec![
            (leg.hip, leg.knee, 3.0 * l),
            (leg.knee, leg.ankle, 4.5 * l),
            (sole.point(v(0.0, -4.5, -6.0) * l), sole.point(v(0.0, -6.5, 22.0) * l), 4.0 * l),
        ]
    });
    let arms = attitude.arms.iter().map(|arm| {
        let palm = palm(arm);
        vec![
            (arm.shoulder, arm.elbow, 2.5 * a),
            (arm.elbow, arm.wrist, 3.0 * a),
            (arm.wrist, palm.point(v(0.0, 16.0, 3.0) * a), 4.0 * a),
        ]
    });
    let limbs: Vec<_> = legs.chain(arms).collect();
    let head = attitude.fetus_from_head;
    let skull = ellipsoid(Vec3::ZERO, attitude.biometry.skull_semi_mm());
    let clear_of_skull = |&(p, q, r): &(Vec3, Vec3, f32)| {
        [0.0, 0.5, 1.0].into_iter().all(|t| skull.distance_mm(head.local_point(p.lerp(q, t))) > r)
    };
    for (i, limb) in limbs.iter().enumerate() {
        for (k, bone) in limb.iter().enumerate() {
            if !clear_of_skull(bone) {
                return Some(format!("{}, part {k}, and the skull", LIMBS[i]));
            }
            for (m, other) in limbs.iter().enumerate().skip(i + 1) {
                let near = |b: &(Vec3, Vec3, f32)| segment_distance(bone.0, bone.1, b.0, b.1) <= bone.2 + b.2;
                if let Some(n) = other.iter().position(near) {
                    return Some(format!("{}, part {k}, and {}, part {n}", LIMBS[i], LIMBS[m]));
                }
            }
        }
    }
    None
}

const LIMBS: [&str; 4] = ["left leg", "right leg", "left arm", "right arm"];

/// Smallest distance between two line segments, from `a` to `b` and from `c` to `d` (C. Ericson, Real-Time Collision
/// Detection, section 5.1.9).
fn segment_distance(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> f32 {
    let (u, v, w) = (b - a, d - c, a - c);
    let (uu, uv, vv, uw, vw) = (u.dot(u), u.dot(v), v.dot(v), u.dot(w), v.dot(w));
    let across = uu * vv - uv * uv;
    let s = if across > 1e-6 { ((uv * vw - uw * vv) / across).clamp(0.0, 1.0) } else { 0.0 };
    let t = ((uv * s + vw) / vv).clamp(0.0, 1.0);
    let s = ((uv * t - uw) / uu).clamp(0.0, 1.0);
    (a + u * s).distance(c + v * t)
}

/// Frame of the sole: origin at the ankle, y away from the sole, z to the toes.
fn sole(leg: &Leg) -> Isometry {
    let up = (leg.knee - leg.ankle).normalize();
    Isometry::from_axes(leg.ankle, up - leg.toes * up.dot(leg.toes), leg.toes)
}

/// Foot 38 mm long, in the frame of the sole.
fn foot() -> Solid {
    let v = Vec3::new;
    let core = sweep(&[(v(0.0, -4.0, -6.5), 4.6), (v(0.0, -3.5, 3.0), 4.9), (v(0.0, -6.5, 20.0), 3.2)]);
    let toes = (0..5).map(|i| {
        let x = 2.2 * (i as f32 - 2.0);
        let tip = v(x, -7.0, 25.0 - 0.5 * (i as f32 - 1.5).powi(2));
        let thick = if i == 0 { 2.1 } else { 1.6 };
        round_cone(v(0.7 * x, -6.2, 17.0), tip, 2.4, thick)
    });
    smooth_union(std::iter::once(core).chain(toes), 1.0)
}

/// Frame of the palm: origin at the wrist, y to the fingers, z out of the palm.
fn palm(arm: &Arm) -> Isometry {
    Isometry::from_axes(arm.wrist, arm.fingers, (arm.elbow - arm.wrist).cross(Vec3::X))
}

/// Half-closed fingers as (root, knuckle, tip) in the frame of the palm.
fn fingers() -> [[Vec3; 3]; 5] {
    let v = Vec3::new;
    std::array::from_fn(|i| {
        let x = 2.3 * (i as f32 - 1.6);
        if i == 0 {
            [v(-3.4, 3.0, 0.0), v(-6.0, 6.5, 1.5), v(-6.5, 10.0, 3.2)]
        } else {
            // The middle finger is the longest.
            let long = [0.94, 1.0, 0.96, 0.84][i - 1];
            [v(x * 0.7, 9.0, 0.0), v(x, 9.0 + 5.5 * long, 0.8), v(x * 1.05, 9.0 + 8.8 * long, 4.0)]
        }
    })
}

/// Hand at 22 weeks, in the frame of the palm.
fn hand() -> Solid {
    let palm_pad = ellipsoid(Vec3::new(0.0, 6.0, 0.0), Vec3::new(5.0, 6.5, 3.0));
    let digits = fingers().map(|[a, b, c]| sweep(&[(a, 1.7), (b, 1.45), (c, 1.2)]));
    smooth_union(std::iter::once(palm_pad).chain(digits), 0.9)
}

/// Both tips of a shaft of `length_mm` that lies midway between two joints.
fn shaft_tips(from: Vec3, to: Vec3, length_mm: f32) -> [Vec3; 2] {
    let middle = 0.5 * (from + to);
    let half = 0.5 * length_mm * (to - from).normalize();
    [middle - half, middle + half]
}

/// Hip and knee tip of the ossified femur, fetal frame, mm; `side` is 0 for left, 1 for right.
pub(in crate::phantom) fn femur_tips(attitude: &Attitude, side: usize) -> [Vec3; 2] {
    let leg = &attitude.legs[side];
    shaft_tips(leg.hip, leg.knee, attitude.biometry.femur_mm)
}

/// Shoulder and elbow tip of the ossified humerus, fetal frame, mm; `side` is 0 for left, 1 for right.
pub(in crate::phantom) fn humerus_tips(attitude: &Attitude, side: usize) -> [Vec3; 2] {
    let arm = &attitude.arms[side];
    shaft_tips(arm.shoulder, arm.elbow, attitude.biometry.humerus_mm)
}

/// Knee and ankle tip of the ossified tibia, fetal frame, mm; `side` is 0 for left, 1 for right.
pub(in crate::phantom) fn tibia_tips(attitude: &Attitude, side: usize) -> [Vec3; 2] {
    let leg = &attitude.legs[side];
    shaft_tips(leg.knee, leg.ankle, attitude.biometry.tibia_mm)
}

/// Shaft of a bone from tip to tip, flared at its ends, slightly bowed along `bow`. Radii: `middle_mm`, `end_mm`.
fn shaft([a, b]: [Vec3; 2], middle_mm: f32, end_mm: f32, bow: Vec3) -> Solid {
    let along = (b - a).normalize();
    // The ends are balls with their centres one radius inside the tips.
    let (a, b) = (a + along * end_mm, b - along * end_mm);
    let knots = [
        (a, end_mm),
        (a.lerp(b, 0.18) + bow * 0.6, middle_mm),
        (a.lerp(b, 0.5) + bow, middle_mm * 0.95),
        (a.lerp(b, 0.82) + bow * 0.6, middle_mm),
        (b, end_mm),
    ];
    smooth_sweep(&knots, 5)
}

/// Shafts, cartilage ends, small bones and girdles.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let biometry = &attitude.biometry;
    let (l, a) = (biometry.leg_scale(), biometry.arm_scale());
    let mut shafts = Vec::new();
    let mut ends = Vec::new();
    let mut small = Vec::new();
    for (i, leg) in attitude.legs.iter().enumerate() {
        let thigh = (leg.knee - leg.hip).normalize();
        let shank = (leg.ankle - leg.knee).normalize();
        let front = (thigh - shank).normalize_or(Vec3::Z);
        let side = thigh.cross(shank).normalize_or(Vec3::X);
        let bow = (front - thigh * front.dot(thigh)) * l;
        shafts.push(shaft(femur_tips(attitude, i), 1.75 * l, 2.4 * l, bow));
        shafts.push(shaft(tibia_tips(attitude, i), 1.6 * l, 2.1 * l, Vec3::ZERO));
        let fibula = shaft_tips(leg.knee, leg.ankle, biometry.fibula_mm).map(|p| p + side * (3.1 * l));
        shafts.push(shaft(fibula, 0.85 * l, 1.0 * l, Vec3::ZERO));
        ends.push(sphere(leg.hip, 4.0 * l));
        ends.push(smooth_union(
            [sphere(leg.knee - thigh * (1.5 * l), 4.4 * l), sphere(leg.knee.lerp(leg.ankle, 0.06), 4.0 * l)],
            1.0,
        ));
        ends.push(sphere(leg.ankle, 2.9 * l));
        small.push(foot_bones().scaled(l).placed(sole(leg)));
    }
    for (i, arm) in attitude.arms.iter().enumerate() {
        let side = (arm.elbow - arm.shoulder).cross(arm.wrist - arm.elbow).normalize_or(Vec3::X) * (1.4 * a);
        let fore = |length_mm: f32, by: Vec3| shaft_tips(arm.elbow, arm.wrist, length_mm).map(|p| p + by);
        shafts.push(shaft(humerus_tips(attitude, i), 1.6 * a, 2.1 * a, Vec3::ZERO));
        shafts.push(shaft(fore(biometry.ulna_mm, -side), 0.95 * a, 1.2 * a, Vec3::ZERO));
        shafts.push(shaft(fore(biometry.radius_mm, side), 0.9 * a, 1.15 * a, Vec3::ZERO));
        ends.push(sphere(arm.shoulder, 3.6 * a));
        ends.push(sphere(arm.elbow, 3.1 * a));
        ends.push(sphere(arm.wrist, 2.0 * a));
        small.push(hand_bones().scaled(a).placed(palm(arm)));
    }
    let trunk = biometry.trunk_scale();
    vec![
        Fetus.organ("cartilage", "cartilage", 122, 0.8, 3.2 * a, union(ends)),
        Fetus.organ("long_bones", "bone_fetal", 124, 0.6, 1.6 * a, union(shafts)),
        Fetus.organ("hand_and_foot_bones", "bone_fetal", 126, 0.5, 1.05 * a, union(small)),
        Fetus.organ("limb_girdles", "bone_fetal", 128, 0.6, 1.15 * trunk, girdles(attitude)),
    ]
}

/// Metacarpals and phalanges.
fn hand_bones() -> Solid {
    let rods = fingers().map(|[a, b, c]| {
        let wrist = a * Vec3::new(0.8, 0.0, 1.0) + Vec3::Y * 2.0;
        let rod = |p: Vec3, q: Vec3| round_cone(p.lerp(q, 0.14), p.lerp(q, 0.86), 0.7, 0.65);
        union([rod(wrist, a), rod(a, b), rod(b, c)])
    });
    union(rods)
}

/// Metatarsals, phalanges and heel bone of a foot 38 mm long.
fn foot_bones() -> Solid {
    let v = Vec3::new;
    let rods = (0..5).map(|i| {
        let x = 2.0 * (i as f32 - 2.0);
        let (root, head, tip) = (v(0.55 * x, -4.2, 7.0), v(0.8 * x, -5.8, 16.0), v(0.92 * x, -6.6, 22.5));
        union([
            round_cone(root, root.lerp(head, 0.86), 0.8, 0.7),
            round_cone(head.lerp(tip, 0.12), head.lerp(tip, 0.8), 0.7, 0.65),
        ])
    });
    let calcaneus = ellipsoid(v(0.0, -4.5, -4.5), v(1.6, 1.6, 2.2));
    let talus = ellipsoid(v(0.0, -2.0, 0.5), v(1.3, 1.0, 1.5));
    union(rods.chain([calcaneus, talus]))
}

/// Iliac wings, ischia, scapulae and clavicles.
fn girdles(attitude: &Attitude) -> Solid {
    let parts = [(0usize, 1.0f32), (1, -1.0)].into_iter().flat_map(|(i, side)| {
        let at = |level: f32, left: f32, ventral: f32| attitude.trunk(level, side * left, ventral);
        let scale = attitude.biometry.trunk_scale();
        let tube = |knots: &[(Vec3, f32)]| {
            let knots: Vec<_> = knots.iter().map(|&(p, r)| (p, r * scale)).collect();
            smooth_sweep(&knots, 5)
        };
        let wing = union([
            tube(&[(at(24.4, 6.5, 0.0), 1.1), (at(23.2, 10.5, 3.5), 1.2), (at(23.4, 13.0, 8.5), 1.0)]),
            tube(&[(at(25.4, 6.8, 1.5), 1.1), (at(24.4, 10.0, 5.0), 1.3), (at(24.2, 12.2, 9.0), 1.0)]),
            tube(&[(at(24.4, 9.0, 3.0), 1.2), (at(25.6, 9.2, 6.0), 1.4), (at(26.4, 9.0, 8.0), 1.2)]),
        ]);
        let ischium = tube(&[(at(27.2, 8.0, 8.0), 1.2), (at(28.2, 7.0, 9.0), 1.2)]);
        let shoulder = attitude.arms[i].shoulder;
        // The clavicle lies between the ribs and the skin.
        let neck = shoulder.lerp(at(9.0, 12.5, 0.0), 0.3);
        let (inner, tip) = (at(9.4, 8.6, -3.8), at(12.2, 10.6, -3.1));
        let blade = union([
            tube(&[(neck, 1.0), (at(8.8, 12.3, -0.6), 0.9), (inner, 0.8)]),
            tube(&[(inner, 0.8), (at(10.8, 9.4, -4.0), 0.8), (tip, 0.8)]),
            tube(&[(neck, 0.9), (at(10.6, 13.6, -0.4), 0.8), (tip, 0.8)]),
        ]);
        let clavicle = tube(&[
            (shoulder.lerp(at(8.0, 2.0, 18.0), 0.15), 0.85),
            (shoulder.lerp(at(8.0, 2.0, 18.0), 0.5) + Vec3::new(0.0, 0.6, 1.4) * scale, 0.8),
            (at(8.6, 2.0, 18.5), 0.9),
        ]);
        [smooth_union([wing, ischium], 0.5), blade, clavicle]
    });
    union(parts)
}
