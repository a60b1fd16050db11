//! Skull, face, eyes and the outline of the head.

use glam::Vec3;

use super::organ;
use crate::anatomy::phantom::attitude::Attitude;
use crate::anatomy::phantom::biometry::Biometry;
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{
    Solid, capsule, catmull_rom, ellipsoid, round_cone, smooth_union, sphere, sweep, union,
};

/// Skin and scalp over the skull, mm.
const SCALP_MM: f32 = 2.6;

/// The skull grown by `margin_mm`, head frame: a little narrower in front than behind.
pub(super) fn cranium(biometry: &Biometry, margin_mm: f32) -> Solid {
    let semi = biometry.skull_semi_mm();
    let whole = ellipsoid(Vec3::ZERO, semi + margin_mm);
    let brow = ellipsoid(Vec3::new(0.0, 3.0, 0.22 * semi.z), Vec3::new(0.84, 0.84, 0.74) * semi + margin_mm);
    smooth_union([whole, brow], 6.0)
}

/// Head and face up to the skin, fetal frame.
pub(super) fn outline(biometry: &Biometry, attitude: &Attitude) -> Solid {
    let v = Vec3::new;
    let cheek = ellipsoid(v(7.5, -23.0, 17.0), v(11.0, 12.0, 12.0)).with_mirror_image();
    let jaw = sweep(&[(v(0.0, -33.0, 24.0), 5.2), (v(0.0, -28.0, 12.0), 9.0), (v(0.0, -23.0, -4.0), 13.0)]);
    let lips = ellipsoid(v(0.0, -26.5, 27.0), v(6.5, 4.5, 5.0));
    let nose = sweep(&[(v(0.0, -11.0, 30.5), 2.4), (v(0.0, -16.5, 34.0), 2.8), (v(0.0, -19.0, 33.0), 3.2)]);
    let lids = sphere(v(11.0, -12.5, 25.5), 6.6).with_mirror_image();
    let face = smooth_union([cheek, jaw, lips, nose, lids], 4.0);
    let ear = ellipsoid(v(28.5, -10.0, -6.0), v(2.0, 6.5, 4.0)).with_mirror_image();
    let crown = smooth_union([cranium(biometry, SCALP_MM), face], 7.0);
    union([crown, ear]).placed(attitude.fetus_from_head)
}

/// Skull, bones of face and skull base, and eyes.
pub(super) fn organs(biometry: &Biometry, attitude: &Attitude) -> Vec<Organ> {
    let place = |solid: Solid| solid.placed(attitude.fetus_from_head);
    vec![
        organ("skull", "calvaria_fetal", 140, 0.85, 6.0, place(cranium(biometry, 0.0))),
        organ("face_and_skull_base", "bone_fetal", 154, 0.6, 1.7, place(bones())),
        organ("eyes", "csf", 156, 0.6, 1.8, place(eyes(5.0))),
        organ("lenses", "cartilage", 158, 0.4, 0.9, place(lenses())),
    ]
}

const EYE: Vec3 = Vec3::new(11.2, -13.0, 25.5);

fn eyes(radius_mm: f32) -> Solid {
    sphere(EYE, radius_mm).with_mirror_image()
}

fn lenses() -> Solid {
    ellipsoid(EYE + Vec3::new(0.5, 0.0, 3.1), Vec3::new(1.7, 1.7, 1.2)).with_mirror_image()
}

/// Bones that are not the vault. Each side is built at x ≥ 0.
fn bones() -> Solid {
    let v = Vec3::new;
    let tube = |knots: &[(Vec3, f32)]| sweep(&catmull_rom(knots, 6));
    // Walls of the orbit: a cup about the eye, open to the front.
    let orbit = sphere(EYE - Vec3::Z * 0.6, 7.2)
        .subtract(sphere(EYE - Vec3::Z * 0.2, 6.0))
        .subtract(ellipsoid(EYE + v(0.5, 0.0, 8.0), v(9.0, 9.0, 8.5)));
    let zygoma = tube(&[(v(17.5, -14.5, 22.0), 1.0), (v(18.5, -18.5, 18.0), 1.1), (v(21.5, -18.0, 6.0), 0.9)]);
    let maxilla = tube(&[
        (v(0.0, -23.0, 27.5), 1.4),
        (v(6.5, -22.5, 25.0), 1.4),
        (v(10.0, -21.5, 18.0), 1.3),
        (v(10.5, -20.5, 11.0), 1.0),
    ]);
    let mandible = tube(&[
        (v(0.0, -32.5, 25.5), 1.3),
        (v(6.0, -31.5, 23.0), 1.3),
        (v(11.5, -29.5, 14.0), 1.3),
        (v(14.8, -26.0, 5.0), 1.4),
        (v(16.2, -19.5, 1.5), 1.1),
    ]);
    let petrous = round_cone(v(19.5, -17.0, -5.0), v(6.5, -18.5, 2.0), 2.4, 1.5);
    let sphenoid = round_cone(v(20.0, -13.5, 13.0), v(4.5, -16.0, 6.0), 0.9, 1.6);
    let sides = union([orbit, zygoma, maxilla, mandible, petrous, sphenoid]).with_mirror_image();
    let nasal = capsule(v(0.0, -12.5, 31.0), v(0.0, -17.0, 33.5), 0.95);
    let palate = ellipsoid(v(0.0, -21.5, 18.5), v(8.5, 0.9, 8.0));
    let clivus = round_cone(v(0.0, -17.5, 3.0), v(0.0, -25.0, -6.0), 2.0, 1.4);
    union([sides, nasal, palate, clivus])
}
