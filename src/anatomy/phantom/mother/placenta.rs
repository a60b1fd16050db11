//! The placenta: a lobed lens on the anterior left fundal wall, with the vessels on its fetal side.

use std::f32::consts::TAU;

use glam::Vec3;

use super::{organ, uterus};
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{Solid, catmull_rom, sweep, union};

/// From the cavity's centre to the placenta's middle, in units of the cavity's half axes.
const TOWARDS: Vec3 = Vec3::new(0.34, 0.44, 0.83);

const RADIUS_MM: f32 = 72.0;
const THICKNESS_MM: f32 = 26.0;
/// How far it reaches into the wall, so that no film of fluid is left between.
const SEATED_MM: f32 = 1.0;
/// Height of the lobes.
const LOBES_MM: f32 = 1.6;

/// The point of the wall at the middle of the placenta, and the outward normal there.
fn seat() -> (Vec3, Vec3) {
    let cavity = uterus::cavity();
    let direction = (TOWARDS * uterus::CAVITY_SEMI).normalize();
    // The cavity is convex about the origin: bisect along the ray.
    let (mut inside, mut outside) = (0.0f32, 200.0f32);
    for _ in 0..40 {
        let middle = 0.5 * (inside + outside);
        if cavity.distance_mm(direction * middle) < 0.0 { inside = middle } else { outside = middle }
    }
    let wall = direction * inside;
    (wall, cavity.normal(wall))
}

/// Middle of its thickness, and the direction to the wall.
pub(in crate::anatomy::phantom) fn centre() -> (Vec3, Vec3) {
    let (wall, outward) = seat();
    (wall - outward * (0.5 * THICKNESS_MM), outward)
}

/// Where the cord enters, on the fetal side, and the direction away from the placenta.
pub(super) fn insertion() -> (Vec3, Vec3) {
    let (wall, outward) = seat();
    (wall - outward * (THICKNESS_MM - 0.5), -outward)
}

/// The placenta, from just within the wall to its fetal side.
pub(in crate::anatomy::phantom) fn placenta() -> Solid {
    let cavity = uterus::cavity();
    let (wall, _) = seat();
    let seated = cavity.grown(SEATED_MM);
    let bounds = seated.bounds();
    let lens = Solid::new(bounds, move |p| {
        let depth = -cavity.distance_mm(p);
        // Distance from the middle along the wall, about: the depth taken out of the straight distance.
        let along = (p.distance_squared(wall) - depth * depth).max(0.0).sqrt();
        let k = (along / RADIUS_MM).hypot(depth.max(0.0) / THICKNESS_MM);
        // First-order distance of the ellipse in (along, depth).
        let slope = (along / RADIUS_MM.powi(2)).hypot(depth.max(0.0) / THICKNESS_MM.powi(2));
        if slope < 1e-6 { -THICKNESS_MM } else { k * (k - 1.0) / slope }
    });
    let lobed = lens.displaced(LOBES_MM, |p| {
        let wave = |d: Vec3, length_mm: f32, phase: f32| (p.dot(d.normalize()) * TAU / length_mm + phase).sin();
        let a = wave(Vec3::new(1.0, 0.3, -0.4), 31.0, 0.4) * wave(Vec3::new(-0.4, 1.0, -0.2), 27.0, 1.3);
        let b = wave(Vec3::new(0.8, -0.7, 0.2), 17.0, 2.1) * wave(Vec3::new(0.5, 0.8, -0.6), 19.0, 0.2);
        LOBES_MM * (0.7 * a + 0.3 * b)
    });
    lobed.smooth_intersect(seated, 3.0)
}

/// Placenta, its lakes of blood and the vessels on the chorionic plate.
pub(super) fn organs() -> Vec<Organ> {
    let (wall, outward) = seat();
    let across = outward.any_orthonormal_vector();
    let tangent = |angle: f32| across * angle.cos() + outward.cross(across) * angle.sin();
    let cavity = uterus::cavity();
    // A point at `along` from the middle, `depth` under the wall.
    let at = move |angle: f32, along: f32, depth: f32| {
        let mut p = wall + tangent(angle) * along - outward * depth;
        for _ in 0..6 {
            p -= cavity.normal(p) * (cavity.distance_mm(p) + depth);
        }
        p
    };
    let fetal_side = |along: f32| THICKNESS_MM * (1.0 - (along / RADIUS_MM).powi(2)).max(0.0).sqrt();
    let vessels = (0..6).map(|i| {
        let angle = TAU * i as f32 / 6.0 + 0.3;
        let knots: Vec<_> = [0.0f32, 9.0, 20.0, 33.0, 46.0]
            .into_iter()
            .enumerate()
            .map(|(k, along)| {
                let bend = 0.25 * (k as f32 * 1.7 + i as f32).sin();
                (at(angle + bend, along, fetal_side(along) - 3.0), 1.9 - 0.22 * k as f32)
            })
            .collect();
        sweep(&catmull_rom(&knots, 5))
    });
    let lakes = (0..5).map(|i| {
        let angle = TAU * i as f32 / 5.0 + 0.9;
        let along = [24.0f32, 38.0, 16.0, 45.0, 31.0][i];
        let (a, b) =
            (at(angle, along, 0.35 * fetal_side(along)), at(angle + 0.16, along + 2.0, 0.5 * fetal_side(along)));
        sweep(&[(a, 2.6), (b, 1.9)])
    });
    vec![
        organ("placenta", "placenta", 60, 1.8, 6.0, placenta()),
        organ("placental_vessels", "blood", 64, 0.9, 1.8, union(vessels.chain(lakes))),
    ]
}
