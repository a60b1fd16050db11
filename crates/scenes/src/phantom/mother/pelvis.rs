//! The mother's pelvis: pubis with its symphysis, iliac wings, sacrum with its wings.

use glam::Vec3;
use insonify_core::anatomy::sdf::{
    Isometry, Solid, capsule, ellipsoid, round_cone, rounded_box, smooth_union, sphere, union,
};

use super::proportions::Proportions;
use super::spine::SACRUM_TOP_22_MM;
use crate::phantom::organ::{Body::Mother, Organ};
use crate::phantom::parameters::Parameters;

/// Pelvic bones and the symphysis.
pub(super) fn organs(parameters: &Parameters) -> Vec<Organ> {
    let shift = Isometry { translation: Proportions::of(parameters).skeleton_shift(), ..Isometry::IDENTITY };
    vec![
        Mother.organ("symphysis", "cartilage", 29, 1.8, 6.0, symphysis().placed(shift)),
        Mother.organ("maternal_pelvis", "bone_adult", 30, 3.4, 10.0, hip_bones().placed(shift)),
        Mother.organ("sacrum", "bone_adult", 31, 3.2, 9.5, sacrum().placed(shift)),
    ]
}

/// Cartilage between the pubic bones, 5 mm wide and more in pregnancy.
fn symphysis() -> Solid {
    rounded_box(Vec3::new(0.0, -143.0, -2.0), Vec3::new(5.0, 16.0, 9.0), 3.0)
}

fn hip_bones() -> Solid {
    // Left half; x ≥ 0.
    let body = ellipsoid(Vec3::new(11.5, -143.0, -2.0), Vec3::new(8.5, 17.0, 11.0));
    let pubis = smooth_union(
        [
            body,
            capsule(Vec3::new(14.0, -136.0, 3.0), Vec3::new(58.0, -122.0, -22.0), 6.5),
            capsule(Vec3::new(12.0, -152.0, -8.0), Vec3::new(48.0, -158.0, -52.0), 5.5),
        ],
        6.0,
    );
    let ischium = round_cone(Vec3::new(62.0, -130.0, -46.0), Vec3::new(50.0, -158.0, -58.0), 12.0, 10.0);
    let socket = sphere(Vec3::new(66.0, -122.0, -38.0), 19.0);
    // A curved plate: the shell between two balls, cut to a fan.
    let centre = Vec3::new(10.0, -70.0, 10.0);
    let wing = sphere(centre, 104.0)
        .subtract(sphere(centre, 95.0))
        .smooth_intersect(ellipsoid(Vec3::new(88.0, -82.0, -48.0), Vec3::new(46.0, 52.0, 44.0)), 6.0);
    // A buttress from the back of the iliac wing to its joint with the sacrum.
    let buttress = round_cone(Vec3::new(70.0, -88.0, -72.0), Vec3::new(54.0, -84.0, -90.0), 8.0, 9.0);
    smooth_union([pubis, ischium, socket, wing, buttress], 8.0).with_mirror_image()
}

/// Five fused bodies that curve back, wings lateral of the upper two, and a crest.
fn sacrum() -> Solid {
    let top = SACRUM_TOP_22_MM;
    let at = |y: f32, z: f32| top + Vec3::new(0.0, y, z);
    let bodies = smooth_union(
        [
            round_cone(at(-9.0, -4.0), at(-36.0, -14.0), 16.0, 12.0),
            round_cone(at(-36.0, -14.0), at(-64.0, -16.0), 12.0, 7.0),
            round_cone(at(-64.0, -16.0), at(-86.0, -4.0), 6.0, 4.0),
        ],
        5.0,
    );
    let ala = smooth_union(
        [
            round_cone(at(-8.0, -8.0) + Vec3::X * 10.0, at(-14.0, -14.0) + Vec3::X * 42.0, 10.0, 8.5),
            round_cone(at(-14.0, -14.0) + Vec3::X * 40.0, at(-46.0, -20.0) + Vec3::X * 14.0, 7.5, 6.0),
        ],
        6.0,
    )
    .with_mirror_image();
    let crest = union([capsule(at(-14.0, -22.0), at(-56.0, -26.0), 3.5)]);
    smooth_union([bodies, ala, crest], 6.0)
}
