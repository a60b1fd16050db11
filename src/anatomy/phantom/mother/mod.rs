//! The mother: abdominal wall, uterus with placenta and cord, and what lies around it.

mod abdominal_wall;
mod cord;
mod pelvis;
mod placenta;
mod uterus;
mod viscera;

use super::attitude::Attitude;
use super::organ::{Body, Organ};
use super::parameters::Parameters;
use super::sdf::Solid;
use glam::Vec3;

pub(super) use placenta::centre as placenta_centre;
pub(super) use viscera::BLADDER_CENTRE;

/// Half axes of the uterine cavity, mm.
pub(super) fn cavity_semi_mm(_: &Parameters) -> Vec3 {
    uterus::CAVITY_SEMI
}

/// Height of the belly's skin above the origin, mm.
pub(super) fn belly_top_mm(_: &Parameters) -> f32 {
    abdominal_wall::BELLY_TOP_MM
}

/// The uterine cavity.
pub(super) fn cavity(_: &Parameters) -> Solid {
    uterus::cavity()
}

/// The placenta up to its fetal side.
pub(super) fn placenta(_: &Parameters) -> Solid {
    placenta::placenta()
}

/// Every surface of the mother, with placenta, cord and fluid.
pub(super) fn organs(_: &Parameters, attitude: &Attitude) -> Vec<Organ> {
    let parts = [
        abdominal_wall::organs(),
        viscera::organs(),
        pelvis::organs(),
        uterus::organs(),
        placenta::organs(),
        cord::organs(attitude),
    ];
    parts.into_iter().flatten().collect()
}

/// A surface of the mother.
fn organ(
    name: &'static str,
    tissue: &'static str,
    priority: i32,
    grain_mm: f32,
    coarsest_mm: f32,
    solid: Solid,
) -> Organ {
    Organ { name, tissue, priority, body: Body::Mother, grain_mm, coarsest_mm, solid }
}
