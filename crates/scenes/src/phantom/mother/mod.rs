//! The mother: abdominal wall, uterus with placenta and cord, and surrounding organs.
//!
//! Sizes follow [`Parameters`]. [`proportions`] gives the size of the cavity and the resulting displacement of all
//! other organs; [`vary`] gives the small differences between individuals.

mod abdominal_wall;
mod bladder;
mod bowel;
mod cord;
mod cord_path;
mod fat_septa;
mod muscle_border;
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
use insonify_core::anatomy::sdf::Solid;

use super::attitude::Attitude;
use super::fetus;
use super::organ::Organ;
use super::parameters::Parameters;
use super::vary;
use abdominal_wall::AbdominalWall;
use cord::Cord;
use cord_path::{End, Surroundings};
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

/// Solid of the fetus up to its skin, and the cord's end at the navel; scene frame.
fn fetus_in_scene(attitude: &Attitude) -> (Solid, End) {
    let scene_from_fetus = attitude.scene_from_fetus;
    let ventral = attitude.vertebra(fetus::NAVEL_LEVEL).vector(Vec3::Z);
    let navel = End { at: scene_from_fetus.point(fetus::navel(attitude)), away: scene_from_fetus.vector(ventral) };
    (fetus::outline(attitude).placed(scene_from_fetus), navel)
}

/// Placenta and cord of a fetus.
struct Afterbirth {
    placenta: Placenta,
    body: Solid,
    /// Insertion of the cord in the placenta.
    root: End,
    cord: Cord,
}

impl Afterbirth {
    fn of(parameters: &Parameters, fetus: &Solid, navel: End) -> Self {
        let placenta = Placenta::of(parameters);
        let body = placenta.body(fetus);
        let root = placenta.insertion(&body, fetus);
        let around = Surroundings { cavity: &placenta.cavity, placenta: &body, fetus };
        let cord = Cord::of(parameters, &around, root, navel);
        Self { placenta, body, root, cord }
    }
}

/// All surfaces of the mother, with placenta, cord and fluid.
pub(super) fn organs(parameters: &Parameters, attitude: &Attitude) -> Vec<Organ> {
    let wall = AbdominalWall::of(parameters);
    let (fetus, navel) = fetus_in_scene(attitude);
    let Afterbirth { placenta, body, root, cord } = Afterbirth::of(parameters, &fetus, navel);
    let vessels = placental_vessels::tree(&placenta, &body, root.at);
    let parts = [
        wall.organs(),
        muscle_border::organs(parameters, &wall),
        fat_septa::organs(parameters, &wall),
        spine::organs(parameters),
        bowel::organs(parameters, &wall),
        bladder::organs(parameters, &wall),
        vessels::organs(parameters),
        pelvis::organs(parameters),
        uterus::organs(parameters, &placenta),
        placenta.organs(&body, vessels),
        cord.organs(),
    ];
    parts.into_iter().flatten().collect()
}
