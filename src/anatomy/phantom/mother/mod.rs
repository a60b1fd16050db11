//! The mother: abdominal wall, uterus with placenta and cord, and surrounding organs.
//!
//! Sizes follow [`Parameters`]: [`proportions`] gives the size of the cavity and the resulting displacement of
//! everything else; [`vary`] gives the small differences between individuals.

mod abdominal_wall;
mod bladder;
mod bowel;
mod cord;
mod cord_path;
mod fat_septa;
mod pelvis;
mod placenta;
mod placental_vessels;
mod proportions;
mod spine;
#[cfg(test)]
mod tests;
mod uterus;
mod vessels;

use glam::Vec3;

use super::attitude::Attitude;
use super::fetus;
use super::organ::{Body, Organ};
use super::parameters::Parameters;
use super::sdf::Solid;
use super::vary;
use abdominal_wall::AbdominalWall;
use cord::Cord;
use cord_path::End;
use placenta::Placenta;

pub(super) use bladder::bladder_centre;
pub(super) use placenta::placenta_centre;
pub(super) use proportions::cavity_semi_mm;

/// The torso up to its skin.
pub(super) fn skin(parameters: &Parameters) -> Solid {
    AbdominalWall::of(parameters).under_skin(0.0)
}

/// Height of the belly's skin above the origin, mm.
pub(super) fn belly_top_mm(parameters: &Parameters) -> f32 {
    AbdominalWall::of(parameters).belly_top_mm()
}

/// The uterine cavity.
pub(super) fn cavity(parameters: &Parameters) -> Solid {
    uterus::cavity(cavity_semi_mm(parameters))
}

/// All surfaces of the mother, with placenta, cord and fluid.
pub(super) fn organs(parameters: &Parameters, attitude: &Attitude) -> Vec<Organ> {
    let outline = fetus::outline(attitude).placed(attitude.scene_from_fetus);
    let ventral = attitude.vertebra(fetus::NAVEL_LEVEL).vector(Vec3::Z);
    let navel = End { at: attitude.scene_point(fetus::navel(attitude)), away: attitude.scene_vector(ventral) };
    organs_around(parameters, &outline, navel)
}

/// All surfaces of the mother of a fetus with the given skin and navel, scene frame.
fn organs_around(parameters: &Parameters, fetus: &Solid, navel: End) -> Vec<Organ> {
    let wall = AbdominalWall::of(parameters);
    let placenta = Placenta::of(parameters);
    let body = placenta.body(fetus);
    let root = placenta.insertion(&body, fetus);
    let cord = Cord::of(parameters, &placenta, &body, root, fetus, navel);
    let parts = [
        wall.organs(),
        fat_septa::organs(parameters, &wall),
        spine::organs(parameters),
        bowel::organs(parameters, &wall),
        bladder::organs(parameters, &wall),
        vessels::organs(parameters),
        pelvis::organs(parameters),
        uterus::organs(parameters, &placenta),
        placenta.organs(&body, root.0),
        cord.organs(),
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
