//! Liver, gall bladder, stomach, spleen, kidneys, bowel, bladder and the umbilical vessels within the belly.

use glam::Vec3;

use super::trunk::NAVEL_LEVEL;
use super::{organ, trunk};
use crate::anatomy::phantom::attitude::Attitude;
use crate::anatomy::phantom::biometry::Biometry;
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{Solid, catmull_rom, ellipsoid, smooth_union, sweep, union};

/// Organs of the belly.
pub(super) fn organs(biometry: &Biometry, attitude: &Attitude) -> Vec<Organ> {
    let cavity = trunk::trunk(biometry, attitude, 5.2);
    let v = Vec3::new;
    let at = |level: f32, centre: Vec3, semi: Vec3| ellipsoid(centre, semi).placed(attitude.vertebra(level));
    let liver = smooth_union(
        [
            at(17.3, v(-8.5, 0.0, 20.0), v(16.0, 11.5, 17.5)),
            at(16.8, v(6.0, 0.0, 28.0), v(14.0, 8.0, 10.5)),
            at(18.8, v(-14.0, 0.0, 15.0), v(8.0, 10.0, 12.0)),
        ],
        5.0,
    )
    .smooth_intersect(cavity.clone(), 2.0);
    let spleen = at(17.7, v(16.5, 0.0, 7.5), v(3.6, 6.0, 5.5)).smooth_intersect(cavity.clone(), 1.5);
    let kidneys = union([1.0, -1.0].map(|side| at(20.4 + 0.15 * side, v(side * 9.5, 0.0, 3.6), v(4.9, 10.2, 5.2))));
    let pelves = union([1.0, -1.0].map(|side| at(20.4 + 0.15 * side, v(side * 8.0, 0.0, 4.2), v(1.9, 4.2, 1.3))));
    let gall = sweep(&[
        (attitude.trunk(19.0, -9.0, 24.0), 1.2),
        (attitude.trunk(19.2, -10.5, 29.0), 2.3),
        (attitude.trunk(19.3, -11.0, 32.0), 2.5),
    ]);
    let bladder = at(BLADDER_LEVEL, v(0.0, 0.0, BLADDER_VENTRAL_MM), v(5.0, 6.0, 5.2));
    vec![
        organ("fetal_bowel", "bowel", 108, 0.95, 2.6, bowel(attitude).smooth_intersect(cavity, 1.5)),
        organ("liver", "liver", 110, 0.95, 5.0, liver),
        organ("spleen", "spleen", 111, 0.8, 2.6, spleen),
        organ("kidneys", "kidney", 112, 0.75, 3.5, kidneys),
        organ("renal_pelves", "urine", 114, 0.5, 1.2, pelves),
        organ("gall_bladder", "urine", 114, 0.55, 1.6, gall),
        organ("stomach", "amniotic_fluid", 115, 0.65, 2.4, stomach(attitude)),
        organ("fetal_bladder", "urine", 115, 0.65, 2.6, bladder),
    ]
}

const BLADDER_LEVEL: f32 = 27.2;
const BLADDER_VENTRAL_MM: f32 = 18.0;

/// Centre of the bladder, fetal frame.
pub(in crate::anatomy::phantom) fn bladder_centre(attitude: &Attitude) -> Vec3 {
    attitude.trunk(BLADDER_LEVEL, 0.0, BLADDER_VENTRAL_MM)
}

/// Middle of the stomach's body, fetal frame.
pub(in crate::anatomy::phantom) fn stomach_centre(attitude: &Attitude) -> Vec3 {
    attitude.trunk(18.0, 13.0, 17.0)
}

/// The bubble: fundus at the left back, body, and the bend to the pylorus.
fn stomach(attitude: &Attitude) -> Solid {
    let knots = [
        (attitude.trunk(17.4, 13.2, 12.5), 4.2),
        (stomach_centre(attitude), 5.3),
        (attitude.trunk(18.5, 10.0, 21.5), 4.0),
        (attitude.trunk(18.8, 5.0, 22.5), 2.4),
    ];
    sweep(&catmull_rom(&knots, 6))
}

/// Coils of small bowel between liver and bladder.
fn bowel(attitude: &Attitude) -> Solid {
    let coils = (0..3).map(|row| {
        let level = 21.2 + 1.35 * row as f32;
        let knots: Vec<(Vec3, f32)> = (0..9)
            .map(|i| {
                let left = -14.0 + 3.5 * i as f32;
                let ventral = if i % 2 == 0 { 17.0 } else { 33.0 } - 2.2 * row as f32;
                (attitude.trunk(level + 0.2 * (i % 3) as f32, left * (1.0 - 0.14 * row as f32), ventral), 2.5)
            })
            .collect();
        sweep(&catmull_rom(&knots, 5))
    });
    union(coils)
}

/// The umbilical vein to the portal sinus, and the arteries beside the bladder.
pub(super) fn umbilical_vessels(attitude: &Attitude) -> Vec<Solid> {
    let at = |level: f32, left: f32, ventral: f32, radius: f32| (attitude.trunk(level, left, ventral), radius);
    let tube = |knots: &[(Vec3, f32)]| sweep(&catmull_rom(knots, 6));
    // In the plane of the circumference the vein runs backward and turns to the right like a hockey stick.
    let vein = tube(&[
        at(NAVEL_LEVEL, 0.0, 41.5, 1.6),
        at(19.6, 0.3, 38.5, 1.7),
        at(18.2, 0.3, 31.0, 1.75),
        at(17.9, -0.8, 24.5, 1.8),
        at(17.9, -4.5, 20.5, 1.8),
        at(18.0, -10.0, 19.5, 1.4),
    ]);
    let arteries = [1.0, -1.0].map(|side| {
        tube(&[
            at(25.3, 8.0 * side, 9.0, 0.9),
            at(27.2, 7.0 * side, 14.0, 0.9),
            at(26.4, 6.6 * side, 22.5, 0.9),
            at(23.2, 2.6 * side, 34.5, 0.9),
            at(NAVEL_LEVEL, 1.5 * side, 41.0, 0.9),
        ])
    });
    std::iter::once(vein).chain(arteries).collect()
}
