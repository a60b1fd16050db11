//! Uterine wall, cervix, membranes and the fluid in the cavity.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Bounds, Solid, capsule, round_cone, smooth_union, sphere, sweep};

use super::placenta::Placenta;
use super::proportions::{Proportions, UTERINE_WALL_MM};
use crate::phantom::organ::{Body::Mother, Organ};
use crate::phantom::parameters::Parameters;

/// Exponent of the cavity's superellipsoid: a little fuller than an ellipsoid.
const FULLNESS: f32 = 2.25;

/// Thickness of the fused amnion and chorion, mm.
const MEMBRANES_MM: f32 = 0.35;
/// Thickness of the fluid between amnion and chorion at the centre of their separation, mm.
const PARTED_MM: f32 = 2.6;
/// Depth to which the solid of the fluid between the membranes extends into the cavity, hidden by them, mm.
const DEEP_MM: f32 = 5.0;
/// Age from which vernix floats in the fluid, weeks.
const VERNIX_WEEKS: f64 = 28.0;

/// The uterine cavity.
pub(super) fn cavity(semi: Vec3) -> Solid {
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

/// Organs of the uterus: wall, cervix with its canal, membranes and fluid.
pub(super) fn organs(parameters: &Parameters, placenta: &Placenta) -> Vec<Organ> {
    let proportions = Proportions::of(parameters);
    let cavity = cavity(proportions.cavity_semi);
    let shift = proportions.skeleton_shift();
    // The upper end of the cervix is attached to the uterus, its lower end is in the pelvis.
    let bottom = Vec3::new(0.0, 3.0 - proportions.cavity_semi.y, -6.0 + 0.5 * shift.z);
    let os = bottom + Vec3::new(0.0, -30.0, -21.0);
    let along = |part: f32| bottom.lerp(os, part);
    let neck = round_cone(bottom, os, 17.0, 13.0);
    let wall = smooth_union([cavity.grown(UTERINE_WALL_MM), round_cone(bottom, along(0.3), 18.0, 14.0)], 12.0);
    // A plug of mucus in a closed canal, spindle-shaped, surrounded by the glands of its lining.
    let canal = sweep(&[(along(0.22), 1.0), (along(0.6), 1.5), (along(1.0), 1.1)]);
    let lining = sweep(&[(along(0.22), 2.8), (along(0.6), 4.2), (along(0.98), 3.2)]);
    let lips = smooth_union(
        [neck, sphere(os + Vec3::new(0.0, 2.0, 7.0), 8.0), sphere(os + Vec3::new(0.0, 5.0, -7.0), 8.0)],
        5.0,
    );
    let vagina_end = os + Vec3::new(0.0, -27.0, 6.0);
    let vagina = smooth_union([capsule(os, vagina_end, 9.0), sphere(os, 19.0)], 8.0);
    let fluid = if parameters.gestational_weeks < VERNIX_WEEKS { "amniotic_fluid" } else { "amniotic_fluid_vernix" };
    vec![
        Mother.organ("vagina", "muscle", 38, 3.0, 9.0, vagina),
        Mother.organ("uterus", "uterus_wall", 40, 2.8, 18.0, wall),
        Mother.organ("cervix", "cervix", 42, 2.2, 8.0, lips),
        Mother.organ("cervical_lining", "cervical_mucosa", 43, 1.4, 3.2, lining),
        Mother.organ("cervical_canal", "csf", 44, 0.9, 1.8, canal),
        Mother.organ("chorionic_fluid", fluid, 48, 2.0, 6.2, parted(&cavity, placenta)),
        Mother.organ("membranes", "amnion", 50, 3.2, 18.0, cavity.grown(MEMBRANES_MM)),
        Mother.organ("amniotic_cavity", fluid, 51, 2.6, 18.0, cavity),
    ]
}

/// Fluid between amnion and chorion where they have not fused: a lens at the rim of the placenta.
fn parted(cavity: &Solid, placenta: &Placenta) -> Solid {
    let middle = placenta.outside_rim();
    let radius = 0.55 * placenta.radius_mm();
    let cavity = cavity.clone();
    // The lens tapers towards its rim and ends DEEP_MM inside the membranes.
    let reach = radius * (1.0 + (DEEP_MM + MEMBRANES_MM) / PARTED_MM).sqrt();
    let bounds = Bounds::around(middle, Vec3::splat(reach + 2.0));
    Solid::new(bounds, move |p| {
        let along = p.distance(middle) / radius;
        let outer = cavity.distance_mm(p) - MEMBRANES_MM - PARTED_MM * (1.0 - along * along);
        // The membranes hide the part inside them.
        outer.max(-DEEP_MM - cavity.distance_mm(p))
    })
}
