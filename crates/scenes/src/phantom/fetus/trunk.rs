//! Shape of the fetal trunk: circles along a line in front of the spine.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Solid, bisect, catmull_rom, sweep};

use crate::phantom::attitude::Attitude;

/// Level of the stomach and the umbilical vein, where the abdominal circumference is measured: between T11 and T12.
pub(in crate::phantom) const ABDOMEN_LEVEL: f32 = 18.0;
/// Level of the umbilical cord's insertion in the belly.
pub(in crate::phantom) const NAVEL_LEVEL: f32 = 21.2;

/// Profile of the trunk: level along the spine, and radius at the skin, relative to the radius of the abdomen.
const PROFILE: [(f32, f32); 11] = [
    (2.5, 0.42),
    (5.0, 0.46),
    (7.2, 0.60),
    (9.5, 0.78),
    (12.5, 0.88),
    (15.5, 0.955),
    (18.0, 1.0),
    (20.5, 0.975),
    (23.0, 0.87),
    (25.5, 0.74),
    (28.0, 0.56),
];

/// Radius of the drawn abdomen, mm: its circumference is 175 mm.
const ABDOMEN_RADIUS_MM: f32 = 175.0 / std::f32::consts::TAU;
/// Distance of the skin behind the centres of the vertebral bodies, mm as drawn.
const BACK_MM: f32 = 9.0;

/// Knots of the trunk: centre and radius at the skin, mm.
pub(super) fn knots(attitude: &Attitude) -> Vec<(Vec3, f32)> {
    let knots = PROFILE.iter().map(|&(level, relative)| {
        let radius = relative * ABDOMEN_RADIUS_MM;
        attitude.knot(level, 0.0, radius - BACK_MM, radius)
    });
    knots.collect()
}

/// Solid of trunk and neck up to the depth `under_skin` (mm as drawn) below the skin, fetal frame.
pub(super) fn trunk(attitude: &Attitude, under_skin: f32) -> Solid {
    let under_skin = under_skin * attitude.biometry.trunk_scale();
    let line = catmull_rom(&knots(attitude), 8);
    sweep(&line.into_iter().map(|(p, r)| (p, r - under_skin)).collect::<Vec<_>>())
}

/// Radius of the trunk at the skin at `level`, mm as drawn.
pub(super) fn drawn_radius(level: f32) -> f32 {
    let i = PROFILE.partition_point(|&(l, _)| l < level).clamp(1, PROFILE.len() - 1);
    let ((la, ra), (lb, rb)) = (PROFILE[i - 1], PROFILE[i]);
    ABDOMEN_RADIUS_MM * (ra + (rb - ra) * ((level - la) / (lb - la)).clamp(0.0, 1.0))
}

/// Centre of the trunk's circle at `level`, fetal frame, mm.
pub(in crate::phantom) fn trunk_centre(attitude: &Attitude, level: f32) -> Vec3 {
    attitude.trunk(level, 0.0, drawn_radius(level) - BACK_MM)
}

/// Point at `depth` (mm as drawn) under the trunk's skin at `level`, fetal frame, mm. `angle`, rad, is measured around
/// the trunk from the back towards `side` (1 for left, −1 for right).
pub(super) fn under_skin(attitude: &Attitude, level: f32, side: f32, angle: f32, depth: f32) -> Vec3 {
    let radius = drawn_radius(level);
    let out = radius - depth;
    attitude.trunk(level, side * angle.sin() * out, radius - BACK_MM - angle.cos() * out)
}

/// Points where rays from the trunk's centre at `level` pass its skin; fetal frame, mm. `directions` are unit vectors
/// in the vertebra's frame.
pub(in crate::phantom) fn skin_points<const N: usize>(
    attitude: &Attitude,
    level: f32,
    directions: [Vec3; N],
) -> [Vec3; N] {
    let (trunk, centre, frame) = (trunk(attitude, 0.0), trunk_centre(attitude, level), attitude.vertebra(level));
    directions.map(|direction| {
        let direction = frame.vector(direction);
        let far = 3.0 * attitude.biometry.abdominal_radius_mm();
        centre + direction * bisect(0.0, far, 30, |t| trunk.distance_mm(centre + direction * t) < 0.0)
    })
}

/// Insertion of the umbilical cord in the belly's skin, fetal frame, mm.
pub(in crate::phantom) fn navel(attitude: &Attitude) -> Vec3 {
    let [navel] = skin_points(attitude, NAVEL_LEVEL, [Vec3::Z]);
    navel
}
