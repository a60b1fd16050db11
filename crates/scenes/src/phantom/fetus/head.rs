//! Shape of the fetal head: the cranium's ellipsoids and the outline of head and face, in the head's frame, in mm as
//! drawn.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Solid, bisect, ellipsoid, smooth_union, sphere, sweep, union};

use super::face;
use crate::phantom::attitude::Attitude;
use crate::phantom::biometry::Biometry;

/// Thickness of skin and scalp over the skull, mm as drawn.
const SCALP_MM: f32 = 2.6;

/// Semi-axes of the skull's outer table, mm as drawn.
pub(super) fn semi(biometry: &Biometry) -> Vec3 {
    biometry.skull_semi_mm() / biometry.head_scale()
}

/// Thickness of the skull, mm as drawn.
pub(super) fn table(biometry: &Biometry) -> f32 {
    biometry.skull_thickness_mm / biometry.head_scale()
}

/// Solid of the skull grown by `margin`, mm as drawn; slightly narrower in front than at the back.
pub(super) fn cranium(biometry: &Biometry, margin: f32) -> Solid {
    let semi = semi(biometry);
    let whole = ellipsoid(Vec3::ZERO, semi + margin);
    let brow = ellipsoid(Vec3::new(0.0, 3.0, 0.22 * semi.z), Vec3::new(0.84, 0.84, 0.74) * semi + margin);
    smooth_union([whole, brow], 6.0)
}

/// Head and face up to the skin, fetal frame.
pub(super) fn outline(attitude: &Attitude) -> Solid {
    let biometry = &attitude.biometry;
    let v = Vec3::new;
    let cheek = ellipsoid(v(7.5, -23.0, 16.5), v(11.0, 11.5, 12.0)).with_mirror_image();
    let jaw = sweep(&[(v(0.0, -33.0, 23.0), 5.4), (v(0.0, -28.0, 12.0), 9.0), (v(0.0, -23.0, -4.0), 13.0)]);
    let muzzle = sweep(&[(v(0.0, -21.0, 24.5), 5.4), (v(0.0, -27.0, 22.8), 6.4), (v(0.0, -32.0, 22.6), 5.6)]);
    let (eye, radius) = face::eye(biometry);
    let lids = sphere(eye + v(0.0, 0.3, 0.2), radius + 1.4).with_mirror_image();
    let soft = smooth_union([cheek, jaw, muzzle, lids], 4.0);
    let crown = smooth_union([cranium(biometry, SCALP_MM), soft], 6.0);
    let features = smooth_union([crown, face::features()], 1.6);
    let ear = smooth_union(
        [
            ellipsoid(v(semi(biometry).x + 1.2, -10.0, -6.5), v(1.3, 6.0, 3.6)),
            ellipsoid(v(semi(biometry).x + 0.4, -14.5, -4.5), v(1.6, 2.4, 2.2)),
        ],
        1.0,
    )
    .with_mirror_image();
    attitude.in_head(union([features, ear]))
}

/// Front and back end of the skull on a line through the head's centre; fetal frame, mm.
pub(in crate::phantom) fn occipitofrontal_ends(attitude: &Attitude) -> [Vec3; 2] {
    let skull = cranium(&attitude.biometry, 0.0);
    [Vec3::Z, Vec3::NEG_Z].map(|direction| {
        attitude.head_point(direction * bisect(0.0, 80.0, 30, |t| skull.distance_mm(direction * t) < 0.0))
    })
}

/// Skin over the tip of the nose, fetal frame, mm.
pub(in crate::phantom) fn nose_tip(attitude: &Attitude) -> Vec3 {
    skin_before(attitude, face::NOSE_TIP)
}

/// Skin over the chin, fetal frame, mm.
pub(in crate::phantom) fn chin(attitude: &Attitude) -> Vec3 {
    skin_before(attitude, Vec3::new(0.0, -34.0, 24.0))
}

/// Point of the head's skin in front of `inner` (head frame, mm as drawn), in the fetal frame, mm.
fn skin_before(attitude: &Attitude, inner: Vec3) -> Vec3 {
    let outline = outline(attitude);
    let at = |forward: f32| attitude.head_point(inner + Vec3::Z * forward);
    at(bisect(0.0, 20.0, 24, |forward| outline.distance_mm(at(forward)) < 0.0))
}

/// Balls that cover the head up to the skin: centre and radius, fetal frame, mm.
pub(super) fn balls(attitude: &Attitude) -> Vec<(Vec3, f32)> {
    let s = semi(&attitude.biometry) + SCALP_MM;
    let v = Vec3::new;
    let drawn = [
        (v(0.0, 0.0, 0.0), s.y.max(s.x)),
        (v(0.0, 0.0, s.z - 0.93 * s.x), 0.93 * s.x),
        (v(0.0, 0.0, 0.93 * s.x - s.z), 0.93 * s.x),
        (v(8.0, -22.0, 16.5), 11.5),
        (v(-8.0, -22.0, 16.5), 11.5),
        (v(0.0, -33.0, 23.5), 6.0),
        (v(0.0, -22.0, 30.5), 5.5),
        (v(0.0, -18.5, 35.5), 2.8),
    ];
    drawn.map(|(at, radius)| (attitude.head_point(at), radius * attitude.biometry.head_scale())).to_vec()
}
