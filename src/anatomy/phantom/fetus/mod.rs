//! The fetus: every organ in the fetal frame, placed in the scene at the end.

mod abdomen;
mod brain;
mod head;
mod heart;
mod limbs;
mod ribs;
mod skin;
mod spine;
mod thorax;
mod trunk;

use super::attitude::Attitude;
use super::biometry::Biometry;
use super::organ::{Body, Organ};
use super::sdf::Solid;

pub(super) use abdomen::{bladder_centre, stomach_centre};
pub(super) use heart::heart_frame;
pub(super) use limbs::femur_tips;
pub(super) use skin::outline;
pub(super) use trunk::{ABDOMEN_LEVEL, NAVEL_LEVEL, navel, trunk_centre};

/// Every surface of the fetus, scene frame.
pub(super) fn organs(biometry: &Biometry, attitude: &Attitude) -> Vec<Organ> {
    let parts = [
        skin::organs(biometry, attitude),
        thorax::organs(biometry, attitude),
        heart::organs(attitude),
        abdomen::organs(biometry, attitude),
        ribs::organs(biometry, attitude),
        spine::organs(attitude),
        limbs::organs(biometry, attitude),
        head::organs(biometry, attitude),
        brain::organs(biometry, attitude),
    ];
    let place = |o: Organ| Organ { solid: o.solid.placed(attitude.scene_from_fetus), ..o };
    parts.into_iter().flatten().map(place).collect()
}

/// A surface of the fetus, in the fetal frame.
fn organ(
    name: &'static str,
    tissue: &'static str,
    priority: i32,
    grain_mm: f32,
    coarsest_mm: f32,
    solid: Solid,
) -> Organ {
    Organ { name, tissue, priority, body: Body::Fetus, grain_mm, coarsest_mm, solid }
}
