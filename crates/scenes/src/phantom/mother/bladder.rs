//! The mother's bladder.

use glam::Vec3;
use insonify_core::anatomy::sdf::{ellipsoid, smooth_union};

use super::abdominal_wall::AbdominalWall;
use super::proportions::Proportions;
use crate::phantom::organ::{Body::Mother, Organ};
use crate::phantom::parameters::Parameters;

/// Centre of the bladder's lumen in the reference body (22 weeks), mm.
const CENTRE_22_MM: Vec3 = Vec3::new(0.0, -118.0, 19.0);

/// Centre of the bladder's lumen, mm.
pub(in crate::phantom) fn bladder_centre(parameters: &Parameters) -> Vec3 {
    let shift = Proportions::of(parameters).skeleton_shift();
    CENTRE_22_MM + shift
}

/// Organs of the bladder: wall and urine.
pub(super) fn organs(parameters: &Parameters, wall: &AbdominalWall) -> Vec<Organ> {
    let centre = bladder_centre(parameters);
    let urine = smooth_union(
        [
            ellipsoid(centre, Vec3::new(30.0, 14.0, 13.0)),
            ellipsoid(centre + Vec3::new(0.0, 8.0, 6.0), Vec3::new(22.0, 12.0, 8.0)),
        ],
        8.0,
    )
    // The uterus indents the roof of the bladder; the wall of the belly bounds it.
    .smooth_intersect(wall.interior().grown(-4.0), 6.0);
    vec![
        Mother.organ("maternal_bladder_wall", "muscle", 24, 2.8, 8.0, urine.grown(3.0)),
        Mother.organ("maternal_bladder", "urine", 26, 2.6, 8.0, urine),
    ]
}
