//! Eyes, nose, lips, jaws and the bones of the fetal face and skull base, in the head's frame, in mm as drawn.

use glam::Vec3;
use insonify_core::anatomy::sdf::{
    Solid, capsule, ellipsoid, round_cone, smooth_sweep, smooth_union, sphere, sweep, union,
};

use crate::phantom::attitude::Attitude;
use crate::phantom::biometry::Biometry;
use crate::phantom::organ::{Body::Fetus, Organ};

/// Centre and radius of the left eye.
pub(super) fn eye(biometry: &Biometry) -> (Vec3, f32) {
    let scale = biometry.head_scale();
    let apart = 0.5 * (biometry.binocular_mm - biometry.ocular_mm) / scale;
    (Vec3::new(apart, -13.0, 25.0), 0.5 * biometry.ocular_mm / scale)
}

/// Centres of the left and right eye, fetal frame, mm.
pub(in crate::phantom) fn eye_centres(attitude: &Attitude) -> [Vec3; 2] {
    let (eye, _) = eye(&attitude.biometry);
    [1.0, -1.0].map(|side| attitude.head_point(eye * Vec3::new(side, 1.0, 1.0)))
}

/// Centre of the ball at the tip of the nose.
pub(super) const NOSE_TIP: Vec3 = Vec3::new(0.0, -18.3, 36.0);

/// Protruding nose, lips and chin.
pub(super) fn features() -> Solid {
    let v = Vec3::new;
    let bridge = sweep(&[(v(0.0, -10.5, 31.5), 2.0), (v(0.0, -14.5, 33.6), 2.0), (NOSE_TIP, 2.2)]);
    let wings = sphere(v(2.9, -19.2, 33.4), 2.0).with_mirror_image();
    let septum = round_cone(NOSE_TIP, v(0.0, -21.6, 31.6), 1.6, 1.3);
    let arch = |y: f32, z: f32, width: f32, radius: f32| {
        let knots = [
            (v(-width, y - 0.6, z - 3.4), 0.55 * radius),
            (v(-0.5 * width, y, z - 0.8), 0.95 * radius),
            (v(0.0, y - 0.1, z), radius),
            (v(0.5 * width, y, z - 0.8), 0.95 * radius),
            (v(width, y - 0.6, z - 3.4), 0.55 * radius),
        ];
        smooth_sweep(&knots, 4)
    };
    let upper_lip =
        union([arch(-23.7, 29.7, 6.0, 1.75), round_cone(v(0.0, -21.5, 29.4), v(0.0, -23.4, 29.8), 1.6, 1.6)]);
    let lower_lip = arch(-27.3, 28.8, 5.4, 1.8);
    let chin = sphere(v(0.0, -33.4, 25.4), 3.5);
    smooth_union([smooth_union([bridge, wings, septum], 1.2), upper_lip, lower_lip, chin], 0.5)
}

/// Bones of face and skull base, eyes with their lenses.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let scale = attitude.biometry.head_scale();
    let (eye, radius) = eye(&attitude.biometry);
    let eyes = sphere(eye, radius).with_mirror_image();
    let lens = eye + Vec3::new(0.3, 0.0, 0.62 * radius);
    let lenses = ellipsoid(lens, Vec3::new(0.34, 0.34, 0.25) * radius).with_mirror_image();
    let place = |solid: Solid| attitude.in_head(solid);
    vec![
        Fetus.organ("face_and_skull_base", "bone_fetal", 154, 0.6, 1.7 * scale, place(bones(eye, radius))),
        Fetus.organ("eyes", "csf", 156, 0.6, 1.8 * scale, place(eyes)),
        Fetus.organ("lenses", "cartilage", 158, 0.4, 0.9 * scale, place(lenses)),
    ]
}

/// Bones other than the vault. Each side is built at x ≥ 0.
fn bones(eye: Vec3, radius: f32) -> Solid {
    let v = Vec3::new;
    let tube = |knots: &[(Vec3, f32)]| smooth_sweep(knots, 6);
    // Walls of the orbit: a cup about the eye, open to the front.
    let orbit = sphere(eye - Vec3::Z * 0.6, radius + 2.0)
        .subtract(sphere(eye - Vec3::Z * 0.2, radius + 0.8))
        .subtract(ellipsoid(eye + v(0.5, 0.0, 8.0), v(radius + 4.0, radius + 4.0, 8.5)));
    let cheek = eye.x + radius + 0.9;
    let zygoma = tube(&[(v(cheek, -14.5, 21.5), 1.0), (v(cheek + 0.6, -18.5, 17.0), 1.1), (v(21.5, -18.0, 6.0), 0.9)]);
    // Upper jaw with the ridge of its tooth buds.
    let maxilla = tube(&[
        (v(0.0, -22.6, 27.6), 1.5),
        (v(4.5, -22.6, 26.4), 1.5),
        (v(8.4, -22.0, 21.5), 1.4),
        (v(10.0, -21.2, 16.0), 1.3),
        (v(10.5, -20.5, 11.0), 1.0),
    ]);
    let frontal_process = round_cone(v(3.6, -20.5, 27.2), v(3.0, -13.0, 29.2), 0.9, 0.7);
    let mandible = tube(&[
        (v(0.0, -31.8, 25.6), 1.4),
        (v(5.0, -31.2, 23.8), 1.4),
        (v(9.6, -30.0, 17.0), 1.35),
        (v(12.6, -28.6, 10.0), 1.35),
        (v(15.2, -25.4, 4.0), 1.4),
        (v(16.4, -19.5, 1.0), 1.1),
    ]);
    let petrous = round_cone(v(19.5, -17.0, -5.0), v(6.5, -18.5, 2.0), 2.4, 1.5);
    let sphenoid = round_cone(v(20.0, -13.5, 13.0), v(4.5, -16.0, 6.0), 0.9, 1.6);
    let sides = union([orbit, zygoma, maxilla, frontal_process, mandible, petrous, sphenoid]).with_mirror_image();
    let nasal = capsule(v(0.0, -12.5, 31.4), v(0.0, -16.6, 33.8), 0.95);
    let palate = ellipsoid(v(0.0, -21.3, 18.5), v(8.5, 0.9, 8.0));
    let vomer = ellipsoid(v(0.0, -18.5, 22.0), v(0.6, 2.6, 6.0));
    let clivus = round_cone(v(0.0, -17.5, 3.0), v(0.0, -25.0, -6.0), 2.0, 1.4);
    union([sides, nasal, palate, vomer, clivus])
}
