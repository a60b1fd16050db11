//! Fetal great arteries and veins, and the umbilical, portal and hepatic vessels in the belly.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Solid, smooth_sweep, union};

use super::trunk::NAVEL_LEVEL;
use crate::phantom::attitude::Attitude;
use crate::phantom::organ::{Body::Fetus, Organ};

/// Thickness of a great vessel's wall, mm as drawn.
const WALL_MM: f32 = 0.4;

/// Knot of a vessel's centre line: level, distances left and ventral of the spine, and radius, mm as drawn.
type Knot = (f32, f32, f32, f32);

/// Ascending aorta from the left ventricle, arch, descending aorta to its bifurcation.
const AORTA: &[Knot] = &[
    (13.3, 3.6, 21.5, 1.5),
    (12.4, 0.6, 19.6, 1.7),
    (11.2, -1.2, 18.0, 1.75),
    (10.1, 0.2, 14.5, 1.75),
    (10.2, 3.0, 9.2, 1.65),
    (11.8, 3.4, 6.2, 1.65),
    (14.5, 3.0, 5.6, 1.65),
    (18.0, 2.2, 5.4, 1.6),
    (22.3, 0.8, 5.4, 1.4),
];
/// Pulmonary trunk from the right ventricle, crossing in front of the aorta, and the arterial duct to the descending
/// aorta.
const PULMONARY: &[Knot] = &[
    (13.0, -1.0, 25.5, 1.6),
    (12.0, 2.2, 23.2, 1.8),
    (11.3, 4.2, 18.5, 1.75),
    (11.0, 4.6, 13.0, 1.5),
    (11.5, 4.0, 7.6, 1.4),
];
const PULMONARY_BRANCHES: [&[Knot]; 2] = [
    &[(11.4, 3.6, 18.0, 1.0), (11.7, -0.6, 14.0, 1.0), (11.9, -7.0, 12.8, 0.9)],
    &[(11.3, 4.5, 15.0, 1.0), (11.8, 8.0, 13.0, 0.9)],
];
const PULMONARY_VEINS: [&[Knot]; 2] = [
    &[(13.3, 3.2, 15.0, 1.0), (13.2, 7.6, 11.6, 0.8), (13.0, 11.0, 10.4, 0.7)],
    &[(13.3, -0.4, 13.2, 1.0), (13.2, -5.0, 10.8, 0.8), (13.0, -9.0, 10.4, 0.7)],
];
const SUPERIOR_CAVA: &[Knot] = &[(9.0, -4.5, 12.5, 1.3), (11.5, -5.0, 14.0, 1.45), (12.8, -4.4, 15.8, 1.5)];
const INFERIOR_CAVA: &[Knot] =
    &[(13.9, -4.4, 15.2, 1.5), (15.5, -4.6, 13.0, 1.5), (18.0, -4.4, 8.4, 1.4), (22.3, -2.2, 5.6, 1.2)];
/// Umbilical vein. In the plane of the abdominal circumference it runs backward and turns right like a hockey stick;
/// the bend is the portal sinus.
const UMBILICAL_VEIN: &[Knot] = &[
    (NAVEL_LEVEL, 0.0, 41.5, 1.6),
    (19.6, 0.3, 38.5, 1.7),
    (18.2, 0.3, 31.0, 1.8),
    (17.95, -0.6, 25.0, 1.9),
    PORTAL_SINUS,
    (17.9, -9.0, 18.6, 1.6),
    (17.8, -13.0, 18.2, 1.2),
];
const PORTAL_SINUS: Knot = (17.9, -4.0, 20.4, 1.9);
const LIVER_VEINS: [&[Knot]; 7] = [
    // Anterior and posterior branches of the right portal vein, the left portal vein's branch, the main portal vein.
    &[(17.8, -13.0, 18.2, 1.1), (17.0, -17.5, 22.5, 0.7)],
    &[(17.8, -13.0, 18.2, 1.1), (18.6, -18.0, 13.0, 0.7)],
    &[(17.95, -0.6, 25.0, 1.2), (17.2, 6.0, 27.5, 0.9), (16.8, 10.0, 28.5, 0.6)],
    &[(18.0, -6.0, 19.4, 1.2), (19.0, -4.0, 14.0, 1.1), (20.2, -1.0, 13.0, 0.9)],
    // Three hepatic veins to the cava below the diaphragm.
    &[(15.4, -4.8, 13.4, 0.9), (16.2, -11.0, 18.0, 0.8), (16.9, -16.0, 25.0, 0.6)],
    &[(15.4, -4.6, 13.6, 0.9), (16.0, -5.0, 21.0, 0.8), (16.6, -6.0, 29.0, 0.6)],
    &[(15.4, -4.2, 13.6, 0.9), (15.9, 1.5, 21.0, 0.7), (16.4, 6.0, 27.0, 0.6)],
];
/// Venous duct, narrow, from the portal sinus to the cava.
const VENOUS_DUCT: &[Knot] = &[(17.7, -1.6, 23.0, 0.6), (16.6, -3.2, 18.0, 0.6), (15.6, -4.4, 14.0, 0.9)];

/// Bend of the umbilical vein into the portal sinus, fetal frame, mm.
pub(in crate::phantom) fn portal_sinus(attitude: &Attitude) -> Vec3 {
    attitude.trunk(PORTAL_SINUS.0, PORTAL_SINUS.1, PORTAL_SINUS.2)
}

/// Centre of the descending aorta at `level`, fetal frame, mm.
pub(in crate::phantom) fn descending_aorta(attitude: &Attitude, level: f32) -> Vec3 {
    let i = AORTA.iter().position(|k| k.0 >= level && k.2 < 7.0).unwrap_or(AORTA.len() - 1).max(1);
    let (a, b) = (AORTA[i - 1], AORTA[i]);
    let t = ((level - a.0) / (b.0 - a.0)).clamp(0.0, 1.0);
    attitude.trunk(level, a.1 + (b.1 - a.1) * t, a.2 + (b.2 - a.2) * t)
}

/// Organs of the vessels: blood and walls.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let scale = attitude.biometry.trunk_scale();
    let blood = union([great_vessels(attitude, 0.0), small_vessels(attitude)]);
    vec![
        Fetus.organ("fetal_vessel_walls", "vessel_wall", 116, 0.7, 2.0 * scale, great_vessels(attitude, WALL_MM)),
        Fetus.organ("fetal_vessels", "blood", 119, 0.55, 1.2 * scale, blood),
    ]
}

fn tubes<'a>(attitude: &Attitude, lines: impl IntoIterator<Item = &'a [Knot]>, grown: f32) -> Solid {
    let tube = |line: &[Knot]| {
        let knots: Vec<_> =
            line.iter().map(|&(l, left, ventral, r)| attitude.knot(l, left, ventral, r + grown)).collect();
        smooth_sweep(&knots, 6)
    };
    union(lines.into_iter().map(tube))
}

fn great_vessels(attitude: &Attitude, grown: f32) -> Solid {
    tubes(attitude, [AORTA, PULMONARY, SUPERIOR_CAVA, INFERIOR_CAVA, UMBILICAL_VEIN], grown)
}

fn small_vessels(attitude: &Attitude) -> Solid {
    let iliacs = [1.0, -1.0]
        .map(|side| vec![(22.3, 0.3 * side, 5.2, 1.2), (24.0, 4.5 * side, 6.5, 1.05), (25.3, 8.0 * side, 9.0, 0.9)]);
    // Umbilical arteries run lateral of the bladder and up to the navel.
    let umbilical = [1.0, -1.0].map(|side| {
        vec![
            (25.3, 8.0 * side, 9.0, 0.9),
            (27.2, 7.0 * side, 14.0, 0.9),
            (26.4, 6.6 * side, 22.5, 0.9),
            (23.2, 2.6 * side, 34.5, 0.9),
            (NAVEL_LEVEL, 1.5 * side, 41.0, 0.9),
        ]
    });
    let renal = [1.0, -1.0].map(|side| vec![(20.2, 1.5 + 0.5 * side, 5.4, 0.7), (20.4, 6.5 * side, 4.6, 0.6)]);
    let paired = iliacs.iter().chain(&umbilical).chain(&renal).map(Vec::as_slice);
    let single = PULMONARY_BRANCHES.into_iter().chain(PULMONARY_VEINS).chain(LIVER_VEINS).chain([VENOUS_DUCT]);
    tubes(attitude, paired.chain(single), 0.0)
}
