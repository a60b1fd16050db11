//! Fetal heart: four chambers, septa, valves and the moderator band. Its vessels are in `vessels`.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Isometry, Solid, ellipsoid, round_cone, smooth_union, sphere, union};

use crate::phantom::attitude::Attitude;
use crate::phantom::organ::{Body::Fetus, Organ};

/// Level of the four-chamber plane: T6 to T7.
pub(in crate::phantom) const LEVEL: f32 = 13.4;

/// Scale from the model as drawn to the heart's size: it fills a quarter of the chest's area (0.25 to 0.33; Paladini et
/// al., Obstet Gynecol 75:1003, 1990).
const SIZE: f32 = 1.15;

/// `fetus_from_heart`: origin at the heart's centre, y cranial (normal of the four-chamber plane), z ventral; in mm.
pub(in crate::phantom) fn heart_frame(attitude: &Attitude) -> Isometry {
    let frame = attitude.vertebra(LEVEL);
    Isometry { translation: attitude.trunk(LEVEL, 3.0, 20.5), ..frame }
}

/// Axes of the heart in the heart frame: to the apex (45° to the left), from the right heart to the left, and out of
/// the four-chamber plane.
fn axes() -> (Vec3, Vec3, Vec3) {
    let apex = Vec3::new(0.68, -0.16, 0.72).normalize();
    let leftward = Vec3::new(0.73, 0.0, -0.69);
    let leftward = (leftward - apex * leftward.dot(apex)).normalize();
    (apex, leftward, leftward.cross(apex))
}

/// Point in the heart frame: `a` towards the apex, `b` towards the left heart, `c` out of the four-chamber plane.
fn at(a: f32, b: f32, c: f32) -> Vec3 {
    let (apex, leftward, out) = axes();
    apex * a + leftward * b + out * c
}

/// Ellipsoid centred at `(a, b)` in the four-chamber plane, its long axis parallel to the heart's.
fn lobe(a: f32, b: f32, semi: Vec3) -> Solid {
    let (apex, leftward, _) = axes();
    // Local axes: y to the apex, z to the left heart.
    ellipsoid(Vec3::ZERO, semi).placed(Isometry::from_axes(at(a, b, 0.0), apex, leftward))
}

/// Centres `(a, b)` of left ventricle, right ventricle, left atrium and right atrium, mm as drawn.
const CHAMBERS: [(f32, f32); 4] = [(3.0, 3.6), (2.4, -3.8), (-6.4, 3.8), (-6.4, -3.9)];
/// Centres `(a, b)` of the mitral and the tricuspid ring, mm as drawn; the tricuspid ring is nearer to the apex.
const RINGS: [(f32, f32); 2] = [(-3.2, 3.7), (-2.5, -3.8)];

/// Centres of left ventricle, right ventricle, left atrium and right atrium, and the crux between them; fetal frame,
/// mm.
pub(in crate::phantom) fn chamber_centres(attitude: &Attitude) -> ([Vec3; 4], Vec3) {
    let frame = heart_frame(attitude);
    let scale = SIZE * attitude.biometry.trunk_scale();
    let place = |a: f32, b: f32| frame.point(at(a, b, 0.0) * scale);
    (CHAMBERS.map(|(a, b)| place(a, b)), place(-2.9, 0.0))
}

/// Heart muscle, chambers, and the structures in them.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let frame = heart_frame(attitude);
    let scale = attitude.biometry.trunk_scale();
    let place = |solid: Solid| solid.scaled(SIZE * scale).placed(frame);
    let v = Vec3::new;
    let muscle = smooth_union([lobe(1.5, 0.0, v(7.6, 11.0, 8.8)), lobe(-5.6, 0.0, v(6.8, 6.2, 8.6))], 3.0);
    let [lv, rv, la, ra] = CHAMBERS;
    let chambers = [
        lobe(lv.0, lv.1, v(3.9, 6.2, 2.6)),
        lobe(rv.0, rv.1, v(4.2, 5.4, 2.9)),
        lobe(la.0, la.1, v(4.2, 3.5, 3.3)),
        lobe(ra.0, ra.1, v(4.4, 3.7, 3.4)),
    ];
    // Orifices, and the oval foramen.
    let orifices = RINGS.map(|(a, b)| round_cone(at(a - 1.6, b, 0.0), at(a + 1.6, b, 0.0), 2.1, 2.1));
    let foramen = round_cone(at(-6.4, -1.6, 0.0), at(-6.4, 1.6, 0.0), 1.2, 1.2);
    let blood = union(chambers.into_iter().chain(orifices).chain([foramen]));
    vec![
        Fetus.organ("heart", "heart", 118, 0.75, 3.5 * scale, place(muscle)),
        Fetus.organ("heart_chambers", "blood", 120, 0.5, 1.6 * scale, place(blood)),
        Fetus.organ("heart_valves", "heart", 121, 0.4, 0.75 * scale, place(leaflets())),
    ]
}

/// Both leaflets of the mitral and tricuspid valve, half closed, the flap of the oval foramen and the moderator band.
fn leaflets() -> Solid {
    let leaflet = |from: Vec3, to: Vec3| {
        // A leaflet is a thin plate, as broad as the valve's ring.
        let along = to - from;
        let frame = Isometry::from_axes(0.5 * (from + to), along, axes().2);
        ellipsoid(Vec3::ZERO, Vec3::new(0.32, 0.5 * along.length() + 0.3, 2.1)).placed(frame)
    };
    let valves = RINGS.into_iter().flat_map(|(a, b)| {
        [1.0, -1.0].map(|side| leaflet(at(a, b + side * 2.3, 0.0), at(a + 2.2, b + side * 0.45, 0.0)))
    });
    // The flap bulges into the left atrium.
    let flap = leaflet(at(-8.2, 0.3, 0.0), at(-5.2, 1.9, 0.0));
    let band = round_cone(at(5.0, -1.2, -0.6), at(4.4, -6.2, 0.6), 0.6, 0.5);
    let papillary = [2.2, 5.0].map(|b| round_cone(at(6.6, b, 1.4), at(3.6, b, 0.8), 0.75, 0.4));
    union(valves.chain([flap, band, sphere(at(5.0, -1.0, -0.6), 0.7)]).chain(papillary))
}
