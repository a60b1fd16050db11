//! The mother's great vessels in front of the spine.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Solid, smooth_sweep, union};

use super::proportions::Proportions;
use crate::phantom::organ::{Body::Mother, Organ};
use crate::phantom::parameters::Parameters;

/// Thickness of the walls, mm.
const WALL_MM: f32 = 1.1;

/// Aorta left of the midline and vena cava right of it. Each has both common iliac branches, and the external branches
/// along the pelvic brim.
fn vessels(shift: Vec3, top_mm: f32, grown_mm: f32) -> Solid {
    let v = Vec3::new;
    let tube = |knots: &[(Vec3, f32)]| {
        let knots: Vec<(Vec3, f32)> = knots.iter().map(|&(p, r)| (p + shift, r + grown_mm)).collect();
        smooth_sweep(&knots, 5)
    };
    // Arteries run in front of the veins; the aorta ends higher than the vena cava begins.
    let trunk = |x: f32, radius: f32, fork: Vec3| {
        tube(&[(v(x, top_mm - shift.y, -74.0), radius), (v(x, 30.0, -68.5), radius), (fork, 0.95 * radius)])
    };
    let branch = |fork: Vec3, side: f32, radius: f32, behind: f32| {
        tube(&[
            (fork, 0.85 * radius),
            (v(side * 16.0, -62.0, -70.0 - behind), 0.8 * radius),
            (v(side * 36.0, -92.0, -74.0 - behind), 0.75 * radius),
            (v(side * 52.0, -126.0, -44.0 - behind), 0.7 * radius),
            (v(side * 56.0, -142.0, -18.0 - behind), 0.65 * radius),
        ])
    };
    let (aortic_fork, caval_fork) = (v(5.0, -38.0, -69.0), v(-10.0, -46.0, -72.0));
    union([
        trunk(9.0, 6.8, aortic_fork),
        branch(aortic_fork, 1.0, 5.4, 0.0),
        branch(aortic_fork, -1.0, 5.4, 0.0),
        trunk(-16.0, 7.6, caval_fork),
        branch(caval_fork, 1.0, 6.4, 9.0),
        branch(caval_fork, -1.0, 6.4, 9.0),
    ])
}

/// Organs of the vessels: walls and blood.
pub(super) fn organs(parameters: &Parameters) -> Vec<Organ> {
    let proportions = Proportions::of(parameters);
    let (shift, top) = (proportions.skeleton_shift(), 150.0 + proportions.excess.y.abs());
    vec![
        Mother.organ("maternal_vessel_walls", "vessel_wall", 28, 3.2, 9.0, vessels(shift, top, WALL_MM)),
        Mother.organ("maternal_vessels", "blood", 29, 3.0, 8.5, vessels(shift, top, 0.0)),
    ]
}
