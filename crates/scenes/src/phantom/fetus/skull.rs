//! Vault of the fetal skull with its sutures and fontanelles.
//!
//! The skull is a solid that contains the brain's surfaces. Sutures and fontanelles are membrane instead of bone: a
//! surface of higher priority that replaces the bone in the gaps.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Solid, bisect, ellipsoid, sweep, union};

use super::head;
use crate::phantom::attitude::Attitude;
use crate::phantom::biometry::Biometry;
use crate::phantom::organ::{Body::Fetus, Organ};

/// Skull, and the membranes in the gaps between its bones.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let biometry = &attitude.biometry;
    let scale = biometry.head_scale();
    vec![
        Fetus.organ("skull", "calvaria_fetal", 140, 0.85, 6.0 * scale, attitude.in_head(head::cranium(biometry, 0.0))),
        Fetus.organ("sutures", "fascia", 141, 0.75, 1.2 * scale, attitude.in_head(gaps(biometry))),
    ]
}

/// Half widths of a suture and of the narrow metopic suture, mm as drawn.
const SUTURE_MM: f32 = 0.95;
const METOPIC_MM: f32 = 0.7;
/// Extent of the membranes beyond the bone's outer and inner side, mm as drawn.
const MEMBRANE_MARGIN_MM: f32 = 0.35;

fn gaps(biometry: &Biometry) -> Solid {
    let v = Vec3::new;
    let semi = head::semi(biometry);
    let outer = head::cranium(biometry, MEMBRANE_MARGIN_MM);
    let inner = head::cranium(biometry, -(head::table(biometry) + MEMBRANE_MARGIN_MM));
    // Point of the skull on a ray from the head's centre. `x`, `y` and `z` give the ray for the skull as drawn, with
    // semi-axes of 27.9, 29.75 and 35 mm.
    let on_skull = {
        let skull = head::cranium(biometry, 0.0);
        move |x: f32, y: f32, z: f32| {
            let direction = (v(x, y, z) * semi / v(27.9, 29.75, 35.0)).normalize();
            direction * bisect(0.0, 80.0, 24, |t| skull.distance_mm(direction * t) < 0.0)
        }
    };
    // A suture is a tube along the bone's edge, thicker than the bone and trimmed at the bone's outer and inner side.
    let line = |points: &[Vec3], half_width: f32| {
        let fine: Vec<(Vec3, f32)> = points
            .windows(2)
            .flat_map(|pair| (0..6).map(move |i| pair[0].lerp(pair[1], i as f32 / 6.0)))
            .chain(points.last().copied())
            .map(|p| on_skull(p.x, p.y, p.z) - p.normalize() * (0.5 * head::table(biometry)))
            .map(|p| (p, half_width.hypot(0.5 * head::table(biometry))))
            .collect();
        sweep(&fine)
    };
    let bregma = on_skull(0.0, 26.0, 10.0);
    let lambda = on_skull(0.0, 19.0, -27.0);
    let pterion = on_skull(24.0, -7.0, 15.0);
    let asterion = on_skull(21.0, -9.0, -20.0);
    let middle = [
        line(&[bregma, on_skull(0.0, 29.0, -8.0), lambda], SUTURE_MM),
        line(&[bregma, on_skull(0.0, 17.0, 29.0), on_skull(0.0, 5.0, 35.0)], METOPIC_MM),
        // The anterior fontanelle is a diamond, the posterior one a small triangle.
        ellipsoid(bregma, v(5.6, 4.0, 7.6)),
        ellipsoid(lambda, v(2.8, 3.0, 2.6)),
    ];
    let sides = union([
        line(&[bregma, on_skull(17.0, 19.0, 11.5), on_skull(25.0, 7.0, 13.5), pterion], SUTURE_MM),
        line(&[lambda, on_skull(10.0, 9.0, -29.0), on_skull(17.0, 0.0, -26.0), asterion], SUTURE_MM),
        // The squamosal suture, below the plane of the biparietal diameter.
        line(&[pterion, on_skull(27.0, -4.5, 6.0), on_skull(27.0, -4.5, -8.0), asterion], 0.8 * SUTURE_MM),
        ellipsoid(pterion, v(2.4, 2.6, 2.6)),
        ellipsoid(asterion, v(2.4, 2.6, 2.6)),
    ]);
    union(middle.into_iter().chain([sides.with_mirror_image()])).intersect(outer).subtract(inner)
}
