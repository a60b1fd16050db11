//! Heart with four chambers, the great vessels, aorta and vena cava.

use glam::Vec3;

use super::abdomen;
use super::organ;
use crate::anatomy::phantom::attitude::Attitude;
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{Isometry, Solid, catmull_rom, ellipsoid, smooth_union, sweep, union};

/// Level of the four-chamber plane: T6 to T7.
const LEVEL: f32 = 13.4;

/// `fetus_from_heart`: origin at the heart's centre, y cranial (normal of the four-chamber plane), z ventral.
pub(in crate::anatomy::phantom) fn heart_frame(attitude: &Attitude) -> Isometry {
    let frame = attitude.vertebra(LEVEL);
    Isometry { translation: frame.point(Vec3::new(3.0, 0.0, 20.5)), ..frame }
}

/// The heart's own axes in the heart frame: to the apex (45° to the left), and from right to left heart.
fn axes() -> (Vec3, Vec3, Vec3) {
    let apex = Vec3::new(0.68, -0.16, 0.72).normalize();
    let leftward = Vec3::new(0.73, 0.0, -0.69);
    let leftward = (leftward - apex * leftward.dot(apex)).normalize();
    (apex, leftward, leftward.cross(apex))
}

/// An ellipsoid at `(a, b)` of the four-chamber plane, its long axis along the heart's.
fn lobe(a: f32, b: f32, semi: Vec3) -> Solid {
    let (apex, leftward, _) = axes();
    let frame = Isometry::from_axes(apex * a + leftward * b, apex, leftward);
    // Local axes: y to the apex, z to the left heart.
    ellipsoid(Vec3::ZERO, semi).placed(frame)
}

/// Muscle, chambers and vessels.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let place = heart_frame(attitude);
    let v = Vec3::new;
    let muscle = smooth_union([lobe(1.5, 0.0, v(7.6, 11.0, 8.6)), lobe(-5.2, 0.0, v(6.6, 6.0, 8.2))], 3.0);
    let chambers = [
        lobe(3.0, 3.5, v(3.6, 6.0, 2.7)),
        lobe(2.6, -3.6, v(3.9, 5.7, 2.9)),
        lobe(-6.0, 3.6, v(3.5, 3.0, 2.9)),
        lobe(-6.2, -3.7, v(3.7, 3.2, 3.1)),
    ];
    vec![
        organ("heart", "heart", 118, 0.75, 3.5, muscle.placed(place)),
        organ("heart_chambers", "blood", 120, 0.55, 1.6, union(chambers).placed(place)),
        organ("fetal_vessels", "blood", 116, 0.55, 1.9, vessels(attitude)),
    ]
}

/// Great arteries, aorta to the iliacs, vena cava, umbilical vein and arteries.
fn vessels(attitude: &Attitude) -> Solid {
    let at = |level: f32, left: f32, ventral: f32, radius: f32| (attitude.trunk(level, left, ventral), radius);
    let tube = |knots: &[(Vec3, f32)]| sweep(&catmull_rom(knots, 6));
    let arch = tube(&[
        at(13.2, 1.5, 18.0, 1.6),
        at(11.2, -0.5, 18.0, 1.7),
        at(10.0, 1.0, 14.5, 1.7),
        at(10.2, 3.2, 9.0, 1.6),
        at(11.8, 3.4, 6.0, 1.6),
    ]);
    let descending =
        tube(&[at(11.8, 3.4, 6.0, 1.6), at(14.5, 3.0, 5.4, 1.6), at(18.0, 2.2, 5.2, 1.55), at(22.3, 0.8, 5.2, 1.4)]);
    let pulmonary =
        tube(&[at(13.4, 0.0, 22.0, 1.6), at(11.8, 2.2, 19.5, 1.7), at(11.0, 3.6, 13.5, 1.5), at(11.4, 3.6, 7.5, 1.3)]);
    let superior_cava = tube(&[at(9.0, -4.5, 12.5, 1.2), at(11.5, -5.0, 14.5, 1.35), at(13.0, -4.6, 16.0, 1.5)]);
    let inferior_cava = tube(&[
        at(13.8, -4.4, 15.5, 1.5),
        at(15.5, -4.6, 13.0, 1.45),
        at(18.0, -4.4, 8.2, 1.35),
        at(22.3, -2.2, 5.4, 1.2),
    ]);
    let iliacs = [1.0, -1.0].map(|side| {
        tube(&[at(22.3, 0.3 * side, 5.2, 1.2), at(24.0, 4.5 * side, 6.5, 1.05), at(25.3, 8.0 * side, 9.0, 0.9)])
    });
    let mut parts = vec![arch, descending, pulmonary, superior_cava, inferior_cava];
    parts.extend(iliacs);
    parts.extend(abdomen::umbilical_vessels(attitude));
    union(parts)
}
