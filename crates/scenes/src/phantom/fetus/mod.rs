//! The fetus: organs *as drawn*, at their size at 22 weeks, are scaled to their age and then placed in the scene.

mod abdomen;
mod brain;
mod face;
mod head;
mod heart;
mod limbs;
mod ribs;
mod skin;
mod skull;
mod spine;
mod thorax;
mod trunk;
mod vessels;

use super::attitude::Attitude;
use super::organ::Organ;

pub(super) use abdomen::{bladder_centre, kidney_poles, stomach_centre};
pub(super) use brain::{atrium_walls, cavum_centre, cerebellum_ends, cisterna_magna};
pub(super) use face::eye_centres;
pub(super) use head::{chin, nose_tip, occipitofrontal_ends};
pub(super) use heart::{LEVEL as HEART_LEVEL, chamber_centres, heart_frame};
pub(super) use limbs::{crossing_bones, femur_tips, humerus_tips, tibia_tips};
pub(super) use skin::{balls, outline};
pub(super) use spine::ossification_centres;
pub(super) use trunk::{ABDOMEN_LEVEL, NAVEL_LEVEL, navel, skin_points, trunk_centre};
pub(super) use vessels::{descending_aorta, portal_sinus};

/// All surfaces of the fetus, scene frame.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let parts = [
        skin::organs(attitude),
        thorax::organs(attitude),
        heart::organs(attitude),
        vessels::organs(attitude),
        abdomen::organs(attitude),
        ribs::organs(attitude),
        spine::organs(attitude),
        limbs::organs(attitude),
        skull::organs(attitude),
        face::organs(attitude),
        brain::organs(attitude),
    ];
    let place = |o: Organ| Organ { solid: o.solid.placed(attitude.scene_from_fetus), ..o };
    parts.into_iter().flatten().map(place).collect()
}
