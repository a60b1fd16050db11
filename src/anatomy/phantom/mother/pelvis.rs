//! The mother's bones: pubis, iliac wings, sacrum and lumbar vertebrae.

use glam::Vec3;

use super::organ;
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{Solid, capsule, ellipsoid, round_cone, rounded_box, smooth_union, sphere, union};

/// Pelvis and lumbar spine.
pub(super) fn organs() -> Vec<Organ> {
    vec![
        organ("maternal_pelvis", "bone_adult", 30, 3.4, 7.0, pelvis()),
        organ("lumbar_vertebrae", "bone_adult", 32, 3.0, 8.0, lumbar_vertebrae()),
    ]
}

fn pelvis() -> Solid {
    // Left half; x ≥ 0.
    let pubis = smooth_union(
        [
            ellipsoid(Vec3::new(10.0, -143.0, -2.0), Vec3::new(8.0, 12.0, 16.0)),
            capsule(Vec3::new(14.0, -138.0, 4.0), Vec3::new(58.0, -122.0, -22.0), 6.5),
            capsule(Vec3::new(12.0, -149.0, -12.0), Vec3::new(46.0, -149.0, -50.0), 5.5),
        ],
        6.0,
    );
    let socket = sphere(Vec3::new(66.0, -122.0, -38.0), 19.0);
    // A curved plate: the shell between two balls, cut to a fan.
    let centre = Vec3::new(10.0, -70.0, 10.0);
    let wing = sphere(centre, 104.0)
        .subtract(sphere(centre, 95.0))
        .smooth_intersect(ellipsoid(Vec3::new(88.0, -82.0, -48.0), Vec3::new(46.0, 52.0, 44.0)), 6.0);
    let half = smooth_union([pubis, socket, wing], 8.0);
    let sacrum = smooth_union(
        [
            round_cone(Vec3::new(0.0, -72.0, -78.0), Vec3::new(0.0, -122.0, -84.0), 17.0, 8.0),
            ellipsoid(Vec3::new(0.0, -80.0, -82.0), Vec3::new(46.0, 26.0, 11.0)),
        ],
        10.0,
    );
    let joint = capsule(Vec3::new(-3.5, -143.0, -2.0), Vec3::new(3.5, -143.0, -2.0), 3.0);
    union([half.with_mirror_image(), sacrum, joint])
}

fn lumbar_vertebrae() -> Solid {
    union((0..5).map(|i| {
        let y = -40.0 + 36.0 * i as f32;
        // Lordosis: the middle lies further to the front.
        let z = -82.0 + 3.0 * (1.0 - (0.5 * i as f32 - 1.0).powi(2));
        let at = Vec3::new(0.0, y, z);
        let body = rounded_box(at, Vec3::new(21.0, 13.5, 15.0), 6.0);
        let spinous = capsule(at + Vec3::new(0.0, -4.0, -20.0), at + Vec3::new(0.0, -8.0, -27.0), 3.5);
        let arch = capsule(at + Vec3::new(10.0, 2.0, -12.0), at + Vec3::new(3.0, -2.0, -22.0), 4.0).with_mirror_image();
        let transverse =
            capsule(at + Vec3::new(12.0, 2.0, -12.0), at + Vec3::new(38.0, 4.0, -15.0), 3.5).with_mirror_image();
        smooth_union([body, spinous, arch, transverse], 3.0)
    }))
}
