//! The mother: abdominal wall, uterus with placenta and cord, and what lies around it.

mod abdominal_wall;
mod cord;
mod pelvis;
mod placenta;
mod uterus;
mod viscera;

use super::attitude::Attitude;
use super::organ::{Body, Organ};
use super::sdf::Solid;

pub(super) use abdominal_wall::BELLY_TOP_MM;
pub(super) use placenta::centre as placenta_centre;
pub(super) use uterus::CAVITY_SEMI;
pub(super) use viscera::BLADDER_CENTRE;

/// Every surface of the mother, with placenta, cord and fluid.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
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
