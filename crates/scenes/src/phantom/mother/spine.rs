//! The mother's lumbar spine: vertebral bodies with arches and processes, discs, psoas muscles.

use glam::Vec3;
use insonify_core::anatomy::sdf::{
    Isometry, Solid, capsule, round_cone, rounded_box, smooth_sweep, smooth_union, union,
};

use super::proportions::Proportions;
use crate::phantom::organ::{Body::Mother, Organ};
use crate::phantom::parameters::Parameters;

/// Number of lumbar vertebrae, L5 to L1.
const VERTEBRAE: usize = 5;
/// Distance between the centres of adjacent bodies, mm: body 27, disc 9.
const SPACING_MM: f32 = 36.0;
/// Half of a body's height, mm.
const HALF_BODY_MM: f32 = 13.5;

/// Centre of the sacrum's upper end in the reference body (22 weeks), mm.
pub(super) const SACRUM_TOP_22_MM: Vec3 = Vec3::new(0.0, -62.0, -93.0);

/// Centre of the body of lumbar vertebra `i`, counted from L5 upward, mm.
fn body(i: usize) -> Vec3 {
    // Lordosis: the middle is further to the front.
    Vec3::new(0.0, -40.0 + SPACING_MM * i as f32, -91.0 + 3.0 * (1.0 - (0.5 * i as f32 - 1.0).powi(2)))
}

/// Organs of the lumbar spine: bones, discs and psoas.
pub(super) fn organs(parameters: &Parameters) -> Vec<Organ> {
    let shift = Isometry { translation: Proportions::of(parameters).skeleton_shift(), ..Isometry::IDENTITY };
    let discs = union((0..VERTEBRAE).map(|i| {
        let lower = if i == 0 { SACRUM_TOP_22_MM + Vec3::Y * 6.0 } else { body(i - 1) };
        rounded_box(0.5 * (lower + body(i)), Vec3::new(22.0, 8.0, 16.0), 6.0)
    }));
    vec![
        Mother.organ("psoas_muscles", "muscle", 18, 4.0, 17.0, psoas().placed(shift)),
        Mother.organ("intervertebral_discs", "cartilage", 31, 2.8, 9.5, discs.placed(shift)),
        Mother.organ("lumbar_vertebrae", "bone_adult", 32, 3.0, 10.0, vertebrae().placed(shift)),
    ]
}

fn vertebrae() -> Solid {
    union((0..VERTEBRAE).map(|i| {
        let at = body(i);
        let v = |x: f32, y: f32, z: f32| at + Vec3::new(x, y, z);
        let body = rounded_box(at, Vec3::new(21.0, HALF_BODY_MM, 15.0), 6.0);
        let spinous = smooth_union(
            [
                capsule(v(0.0, -3.0, -24.0), v(0.0, -8.0, -31.0), 3.5),
                capsule(v(0.0, 2.0, -23.0), v(0.0, -1.0, -30.0), 3.0),
            ],
            3.0,
        );
        // Pedicle, lamina and joint processes lie around the canal, which stays free.
        let arch = union([
            capsule(v(13.0, 4.0, -11.0), v(13.5, 3.0, -19.0), 3.8),
            capsule(v(13.5, 2.0, -19.0), v(2.0, -2.0, -25.0), 3.6),
            capsule(v(14.0, 12.0, -19.5), v(14.0, -14.0, -20.5), 4.2),
        ])
        .with_mirror_image();
        let transverse = round_cone(v(14.0, 3.0, -15.0), v(40.0, 5.0, -19.0), 4.0, 3.2).with_mirror_image();
        union([body, smooth_union([spinous, arch, transverse], 2.5)])
    }))
}

/// Psoas: lateral of the vertebral bodies, then forward over the pelvic brim.
fn psoas() -> Solid {
    let line = [
        (Vec3::new(24.0, 128.0, -98.0), 9.0),
        (Vec3::new(30.0, 80.0, -94.0), 15.0),
        (Vec3::new(36.0, 20.0, -91.0), 18.0),
        (Vec3::new(43.0, -40.0, -84.0), 18.0),
        (Vec3::new(54.0, -90.0, -66.0), 16.0),
        (Vec3::new(60.0, -130.0, -30.0), 13.0),
    ];
    smooth_sweep(&line, 5).with_mirror_image()
}
