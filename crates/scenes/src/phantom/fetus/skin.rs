//! Fetal skin of head, trunk and limbs, and the soft tissue under it.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Solid, catmull_rom, smooth_union, union};

use super::{head, limbs, trunk};
use crate::phantom::attitude::Attitude;
use crate::phantom::organ::{Body::Fetus, Organ};

/// The fetus up to its skin, fetal frame.
pub(in crate::phantom) fn outline(attitude: &Attitude) -> Solid {
    let blend = 6.0 * attitude.biometry.trunk_scale();
    let core = smooth_union([trunk::trunk(attitude, 0.0), head::outline(attitude)], blend);
    union([core, limbs::outline(attitude)])
}

/// Balls that cover the fetus up to its skin: centre and radius, fetal frame, mm.
pub(in crate::phantom) fn balls(attitude: &Attitude) -> Vec<(Vec3, f32)> {
    let trunk = catmull_rom(&trunk::knots(attitude), 2);
    trunk.into_iter().chain(head::balls(attitude)).chain(limbs::balls(attitude)).collect()
}

/// Skin, and the soft tissue inside.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let scale = attitude.biometry.trunk_scale();
    let outline = outline(attitude);
    let body = outline.grown(-attitude.biometry.skin_thickness_mm);
    vec![
        Fetus.organ("fetal_skin", "skin", 100, 1.2, 5.0 * scale, outline),
        Fetus.organ("fetal_body", "soft_tissue", 102, 1.3, 5.0 * scale, body),
    ]
}
