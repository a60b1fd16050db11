//! Fetal lungs, airway, and the diaphragm with the muscular wall of the belly.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Solid, smooth_union, sweep, union};

use super::trunk;
use crate::phantom::attitude::Attitude;
use crate::phantom::organ::{Body::Fetus, Organ};

/// Thickness of diaphragm and abdominal muscles, mm as drawn.
const MUSCLE_MM: f32 = 1.0;

/// Space enclosed by diaphragm and belly wall, enlarged by `margin` (mm as drawn): two domes, the right one higher.
pub(super) fn belly(attitude: &Attitude, margin: f32) -> Solid {
    let v = Vec3::new;
    let m = Vec3::splat(margin);
    let domes = smooth_union(
        [
            attitude.in_trunk_ellipsoid(18.5, v(-9.0, 0.0, 15.0), v(16.0, 11.0, 20.0) + m),
            attitude.in_trunk_ellipsoid(18.5, v(9.0, 0.0, 15.0), v(15.5, 9.0, 20.0) + m),
            attitude.in_trunk_ellipsoid(21.8, v(0.0, 0.0, 15.5), v(27.0, 22.0, 30.0) + m),
        ],
        4.0 * attitude.biometry.trunk_scale(),
    );
    domes.smooth_intersect(trunk::trunk(attitude, 5.0 - margin), 2.0)
}

/// Lungs, airway and diaphragm. Heart, diaphragm and vessels have a higher priority and indent the lungs.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let v = Vec3::new;
    let scale = attitude.biometry.trunk_scale();
    let lung = |side: f32| {
        let upper = attitude.in_trunk_ellipsoid(10.8, v(side * 8.5, 0.0, 12.5), v(7.5, 9.0, 11.0));
        let lower = attitude.in_trunk_ellipsoid(13.6, v(side * 10.5, 0.0, 14.0), v(9.5, 11.0, 16.5));
        smooth_union([upper, lower], 5.0 * scale)
    };
    // The chest wall bounds the lungs, inside the ribs.
    let cage = trunk::trunk(attitude, 6.0);
    let lungs = union([lung(1.0), lung(-1.0)]).smooth_intersect(cage, 2.0);
    let line = |level: f32, left: f32, ventral: f32, radius: f32| attitude.knot(level, left, ventral, radius);
    let head = |x: f32, y: f32, z: f32, radius: f32| {
        (attitude.head_point(v(x, y, z)), radius * attitude.biometry.head_scale())
    };
    let nostril = |side: f32| sweep(&[head(side * 1.5, -20.1, 33.4, 0.55), head(side * 1.4, -18.6, 31.5, 0.75)]);
    let airway = union([
        // Pharynx, larynx, trachea.
        sweep(&[
            head(0.0, -23.5, 8.0, 1.2),
            head(0.0, -31.0, 5.0, 1.7),
            line(2.6, 0.0, 7.0, 1.2),
            line(5.0, 0.0, 6.5, 1.2),
            line(8.0, 0.0, 7.5, 1.15),
            line(10.8, 0.0, 9.0, 1.1),
        ]),
        sweep(&[line(10.8, 0.0, 9.0, 1.0), line(11.8, 4.6, 10.2, 0.8)]),
        sweep(&[line(10.8, 0.0, 9.0, 1.0), line(11.8, -4.6, 10.2, 0.8)]),
        // Air between palate and tongue.
        sweep(&[head(0.0, -24.6, 26.0, 0.7), head(0.0, -23.8, 16.0, 0.9), head(0.0, -23.5, 8.0, 1.2)]),
        nostril(1.0),
        nostril(-1.0),
    ]);
    vec![
        Fetus.organ("lungs", "lung_fetal", 106, 0.9, 5.0 * scale, lungs),
        Fetus.organ("diaphragm_and_belly_wall", "muscle", 107, 1.3, 5.0 * scale, belly(attitude, MUSCLE_MM)),
        Fetus.organ("belly", "soft_tissue", 108, 1.3, 5.0 * scale, belly(attitude, 0.0)),
        Fetus.organ("airway", "amniotic_fluid", 117, 0.55, 1.2 * scale, airway),
    ]
}
