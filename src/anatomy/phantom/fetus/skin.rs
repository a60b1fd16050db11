//! Skin of head, trunk and limbs, and the soft tissue under it.

use super::{head, limbs, organ, trunk};
use crate::anatomy::phantom::attitude::Attitude;
use crate::anatomy::phantom::biometry::Biometry;
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{Solid, smooth_union, union};

/// The fetus up to its skin, fetal frame.
pub(in crate::anatomy::phantom) fn outline(biometry: &Biometry, attitude: &Attitude) -> Solid {
    let core = smooth_union([trunk::trunk(biometry, attitude, 0.0), head::outline(biometry, attitude)], 6.0);
    union([core, limbs::outline(biometry, attitude)])
}

/// Skin, and soft tissue within.
pub(super) fn organs(biometry: &Biometry, attitude: &Attitude) -> Vec<Organ> {
    let outline = outline(biometry, attitude);
    let body = outline.grown(-biometry.skin_thickness_mm);
    vec![organ("fetal_skin", "skin", 100, 1.2, 5.0, outline), organ("fetal_body", "soft_tissue", 102, 1.3, 5.0, body)]
}
