//! The placenta: a lobed lens on the anterior left fundal wall, with the vessels on its fetal side.

use std::f32::consts::TAU;

use glam::Vec3;

use super::{organ, uterus};
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::parameters::{Parameters, PlacentaSite};
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
    let cavity = uterus::cavity(uterus::CAVITY_SEMI);
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
pub(in crate::anatomy::phantom) fn placenta_centre(parameters: &Parameters) -> (Vec3, Vec3) {
    let semi = super::cavity_semi_mm(parameters);
    let towards = match parameters.placenta {
        PlacentaSite::Anterior => TOWARDS,
        PlacentaSite::Posterior => TOWARDS * Vec3::new(1.0, 1.0, -1.0),
        PlacentaSite::Fundal => Vec3::new(0.1, 0.97, 0.2),
        PlacentaSite::Left => Vec3::new(0.95, 0.25, 0.15),
        PlacentaSite::Right => Vec3::new(-0.95, 0.25, 0.15),
    };
    let cavity = uterus::cavity(semi);
    let direction = (towards * semi).normalize();
    let (mut inside, mut outside) = (0.0f32, 400.0f32);
    for _ in 0..40 {
        let middle = 0.5 * (inside + outside);
        if cavity.distance_mm(direction * middle) < 0.0 { inside = middle } else { outside = middle }
    }
    let wall = direction * inside;
    let outward = cavity.normal(wall);
    (wall - outward * (0.5 * THICKNESS_MM), outward)
}

/// Where the cord enters, on the fetal side, and the direction away from the placenta. Off the middle, to the left
/// and caudal, where the fluid is.
pub(super) fn insertion() -> (Vec3, Vec3) {
    let (wall, _) = seat();
    let cavity = uterus::cavity(uterus::CAVITY_SEMI);
    let beside = wall + INSERTION_OFFSET;
    let on_fetal_side = under_wall(&cavity, beside, fetal_side_mm(beside.distance(wall)) - 0.5);
    (on_fetal_side, -cavity.normal(on_fetal_side))
}

/// From the placenta's middle to the cord's insertion, about, mm.
const INSERTION_OFFSET: Vec3 = Vec3::new(22.0, -22.0, 0.0);

/// Thickness of the placenta at `along` from its middle, lobes left out, mm.
fn fetal_side_mm(along: f32) -> f32 {
    THICKNESS_MM * (1.0 - (along / RADIUS_MM).powi(2)).max(0.0).sqrt()
}

/// The point near `p` that lies `depth_mm` under the wall.
fn under_wall(cavity: &Solid, p: Vec3, depth_mm: f32) -> Vec3 {
    (0..8).fold(p, |p, _| p - cavity.normal(p) * (cavity.distance_mm(p) + depth_mm))
}

/// The placenta, from just within the wall to its fetal side.
pub(in crate::anatomy::phantom) fn placenta() -> Solid {
    let cavity = uterus::cavity(uterus::CAVITY_SEMI);
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
    let (root, _) = insertion();
    let cavity = uterus::cavity(uterus::CAVITY_SEMI);
    let across = outward.any_orthonormal_vector();
    let tangent = |angle: f32| across * angle.cos() + outward.cross(across) * angle.sin();
    let vessels = (0..7).map(|i| {
        let angle = TAU * i as f32 / 7.0 + 0.3;
        let rim = wall + tangent(angle) * 54.0;
        let knots: Vec<(Vec3, f32)> = (0..=5)
            .map(|k| {
                let t = 0.2 * k as f32;
                let sway = tangent(angle + 0.25 * TAU) * (3.0 * (7.0 * t + i as f32).sin() * t * (1.0 - t) * 4.0);
                let above = root.lerp(rim, t) + sway;
                // The middle of the placenta is `seat`: depth counts from there.
                let along = under_wall(&cavity, above, 0.0).distance(wall);
                (under_wall(&cavity, above, (fetal_side_mm(along) - 3.2).max(2.0)), 1.9 - 1.1 * t)
            })
            .collect();
        sweep(&catmull_rom(&knots, 5))
    });
    let lakes = (0..5).map(|i| {
        let angle = TAU * i as f32 / 5.0 + 0.9;
        let along = [24.0f32, 38.0, 16.0, 45.0, 31.0][i];
        let at = |angle: f32, along: f32, part: f32| {
            under_wall(&cavity, wall + tangent(angle) * along, part * fetal_side_mm(along))
        };
        sweep(&[(at(angle, along, 0.35), 2.6), (at(angle + 0.16, along + 2.0, 0.5), 1.9)])
    });
    let blood = vessels.chain(lakes).collect::<Vec<_>>();
    vec![
        organ("placenta", "placenta", 60, 1.8, 9.0, placenta()),
        organ("placental_vessels", "blood", 64, 0.9, 1.8, union(blood)),
    ]
}
