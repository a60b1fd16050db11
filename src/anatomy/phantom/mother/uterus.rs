//! Uterine wall, cervix and the fluid in the cavity.

use glam::Vec3;

use super::organ;
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{Bounds, Solid, round_cone, smooth_union, sphere, sweep};

/// Half axes of the cavity, mm.
pub(in crate::anatomy::phantom) const CAVITY_SEMI: Vec3 = Vec3::new(63.0, 103.0, 53.0);

/// Thickness of the wall, mm.
const WALL_MM: f32 = 8.0;

/// Exponent of the cavity's superellipsoid: a little fuller than an ellipsoid.
const FULLNESS: f32 = 2.25;

/// The uterine cavity.
pub(in crate::anatomy::phantom) fn cavity(semi: Vec3) -> Solid {
    Solid::new(Bounds::around(Vec3::ZERO, semi), move |p| {
        let q = (p / semi).abs();
        let f = q.to_array().iter().map(|x| x.powf(FULLNESS)).sum::<f32>().powf(1.0 / FULLNESS);
        if f < 1e-3 {
            return -semi.min_element();
        }
        let gradient = (q / f).to_array().map(|x| x.powf(FULLNESS - 1.0));
        (f - 1.0) / (Vec3::from(gradient) / semi).length()
    })
}

/// Wall, cervix with its canal, and fluid.
pub(super) fn organs(semi: Vec3) -> Vec<Organ> {
    let cavity = cavity(semi);
    let bottom = Vec3::new(0.0, -100.0, -6.0);
    let os = Vec3::new(0.0, -130.0, -27.0);
    let neck = round_cone(bottom, os, 17.0, 13.0);
    let wall = smooth_union([cavity.grown(WALL_MM), round_cone(bottom, bottom.lerp(os, 0.3), 18.0, 14.0)], 12.0);
    // A plug of mucus in a closed canal.
    let canal = sweep(&[(bottom.lerp(os, 0.25), 1.1), (bottom.lerp(os, 0.6), 1.6), (os, 1.2)]);
    let lips = smooth_union(
        [neck, sphere(os + Vec3::new(0.0, 2.0, 7.0), 8.0), sphere(os + Vec3::new(0.0, 5.0, -7.0), 8.0)],
        5.0,
    );
    vec![
        organ("uterus", "uterus_wall", 40, 2.6, 18.0, wall),
        organ("cervix", "cervix", 42, 2.2, 8.0, lips),
        organ("cervical_canal", "csf", 44, 0.9, 1.4, canal),
        organ("amniotic_cavity", "amniotic_fluid", 50, 2.4, 18.0, cavity),
    ]
}
