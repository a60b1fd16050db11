//! Fetal ribs, twelve pairs, and the ossification centres of the sternum.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Isometry, ellipsoid, smooth_sweep, union};

use super::trunk::under_skin;
use crate::phantom::attitude::Attitude;
use crate::phantom::organ::{Body::Fetus, Organ};

/// Depth of the ribs below the skin, mm as drawn.
const UNDER_SKIN_MM: f32 = 4.6;
const RIB_RADIUS_MM: f32 = 0.85;
/// For each rib, the angle around the trunk at which it ends, measured from the back, degrees.
const REACH_DEG: [f32; 12] = [115.0, 122.0, 128.0, 130.0, 130.0, 128.0, 124.0, 118.0, 110.0, 100.0, 76.0, 52.0];
/// Descent of a rib from the back to the front midline, in vertebrae; most ribs end before the midline.
const FALL_LEVELS: f32 = 2.4;

/// Ribs and sternum.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let scale = attitude.biometry.trunk_scale();
    let ribs = (0..12).flat_map(|i| [1.0, -1.0].map(|side| (i, side))).map(|(i, side)| {
        let vertebra = 7.45 + i as f32;
        let mut knots = vec![attitude.knot(vertebra, side * 3.6, -0.8, RIB_RADIUS_MM)];
        let from = 26f32.to_radians();
        let to = REACH_DEG[i].to_radians();
        for k in 0..=9 {
            let t = k as f32 / 9.0;
            let angle = from + (to - from) * t;
            let level = vertebra + FALL_LEVELS * (angle / std::f32::consts::PI).powf(1.3);
            let at = under_skin(attitude, level, side, angle, UNDER_SKIN_MM);
            knots.push((at, scale * RIB_RADIUS_MM * (1.0 - 0.12 * t)));
        }
        smooth_sweep(&knots, 4)
    });
    let sternum = (0..4).map(|i| {
        let level = 10.6 + 1.5 * i as f32;
        let at = under_skin(attitude, level, 0.0, std::f32::consts::PI, 3.6);
        ellipsoid(Vec3::ZERO, Vec3::new(1.7, 1.5, 1.0) * scale)
            .placed(Isometry { translation: at, ..attitude.vertebra(level) })
    });
    let cage: Vec<_> = ribs.collect();
    vec![Fetus.organ("ribs", "bone_fetal", 136, 0.55, 1.05 * scale, union(cage.into_iter().chain(sternum)))]
}
