//! What the skull holds: fluid around the brain, falx, ventricles with choroid plexus, posterior fossa.

use glam::Vec3;

use super::{head, organ};
use crate::anatomy::phantom::attitude::Attitude;
use crate::anatomy::phantom::biometry::Biometry;
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{
    Solid, catmull_rom, ellipsoid, half_space, plate, round_cone, rounded_box, smooth_union, sphere, sweep, union,
};

/// Fluid between the skull and the brain, mm.
const SUBARACHNOID_MM: f32 = 1.6;

/// Head frame to fetal frame is applied here; all functions below work in the head frame.
pub(super) fn organs(biometry: &Biometry, attitude: &Attitude) -> Vec<Organ> {
    let place = |solid: Solid| solid.placed(attitude.fetus_from_head);
    let inside = head::cranium(biometry, -biometry.skull_thickness_mm);
    let brain = brain(biometry);
    vec![
        organ("subarachnoid_space", "csf", 142, 0.95, 6.0, place(inside.clone())),
        organ("brain", "brain", 144, 0.85, 5.0, place(brain.clone())),
        organ("falx", "falx", 148, 0.55, 1.1, place(falx(&inside))),
        organ("ventricles", "csf", 150, 0.55, 2.0, place(ventricles(&inside))),
        organ("choroid_plexus", "choroid_plexus", 152, 0.5, 1.9, place(choroid_plexus())),
        organ("cerebellum", "brain", 151, 0.7, 3.2, place(cerebellum())),
    ]
}

/// The hemispheres: parted by a shallow fissure, an insula pressed in on each side.
fn brain(biometry: &Biometry) -> Solid {
    let v = Vec3::new;
    let whole = head::cranium(biometry, -(biometry.skull_thickness_mm + SUBARACHNOID_MM));
    let semi = biometry.skull_semi_mm();
    let insula = ellipsoid(v(semi.x - 2.5, -1.0, 5.0), v(4.6, 4.2, 7.5)).with_mirror_image();
    let fissure = rounded_box(v(0.0, semi.y - 1.0, 0.0), v(0.9, 6.0, 30.0), 0.9);
    whole.smooth_subtract(union([insula, fissure]), 2.0)
}

/// The midline plate: a crescent over the corpus callosum, and the tentorium's ridge behind.
fn falx(inside: &Solid) -> Solid {
    let v = Vec3::new;
    let crescent = ellipsoid(v(0.0, -9.0, -1.0), v(40.0, 20.0, 21.5));
    let above = half_space(v(0.0, -9.0, 0.0), v(0.0, -0.96, 0.28));
    plate(Vec3::ZERO, Vec3::X, 0.5).intersect(inside.grown(-0.4)).intersect(above).subtract(crescent)
}

/// Lateral, third and fourth ventricle, cavum septi pellucidi and cisterna magna.
fn ventricles(inside: &Solid) -> Solid {
    let v = Vec3::new;
    let tube = |knots: &[(Vec3, f32)]| sweep(&catmull_rom(knots, 6));
    let lateral = smooth_union(
        [
            tube(&[
                (v(5.0, 2.5, 20.0), 1.1),
                (v(6.0, 5.5, 13.0), 2.1),
                (v(7.5, 8.5, 3.0), 2.1),
                (v(10.0, 7.0, -7.0), 2.7),
                (v(12.2, 3.0, -13.5), 3.4),
                (v(14.2, -3.5, -10.0), 2.2),
                (v(15.5, -7.0, -1.0), 1.4),
            ]),
            tube(&[(v(12.0, 3.0, -13.0), 3.2), (v(10.8, 2.5, -19.0), 2.4), (v(9.0, 2.0, -24.0), 1.2)]),
        ],
        2.5,
    )
    .with_mirror_image();
    let cavum = rounded_box(v(0.0, 2.5, 13.5), v(1.9, 3.2, 5.0), 1.5);
    let third = rounded_box(v(0.0, -3.5, 0.0), v(0.75, 4.5, 6.0), 0.7);
    let fourth = ellipsoid(v(0.0, -14.5, -11.5), v(2.0, 2.2, 1.6));
    let cisterna = ellipsoid(v(0.0, -15.0, -21.0), v(15.5, 8.5, 9.5)).intersect(inside.grown(-0.3));
    union([lateral, cavum, third, fourth, cisterna])
}

/// Choroid plexus of the bodies and atria.
fn choroid_plexus() -> Solid {
    let v = Vec3::new;
    let glomus = sweep(&catmull_rom(
        &[(v(7.6, 8.0, 2.0), 1.1), (v(10.0, 6.6, -6.0), 1.9), (v(12.2, 2.8, -13.0), 2.7), (v(13.9, -3.0, -9.8), 1.6)],
        6,
    ));
    glomus.displaced(0.25, |p| 0.25 * (p.x * 2.9).sin() * (p.y * 2.5).sin() * (p.z * 2.7).sin()).with_mirror_image()
}

/// Two hemispheres and the vermis: 22 mm across.
fn cerebellum() -> Solid {
    let v = Vec3::new;
    let lobe = ellipsoid(v(5.8, -15.5, -18.5), v(5.4, 6.0, 5.4)).with_mirror_image();
    let vermis = ellipsoid(v(0.0, -14.5, -17.0), v(3.0, 5.0, 4.2));
    let stem = round_cone(v(0.0, -10.0, -6.0), v(0.0, -22.5, -12.0), 5.0, 3.0);
    let pons = sphere(v(0.0, -14.0, -6.5), 4.6);
    smooth_union([smooth_union([lobe, vermis], 2.0), smooth_union([stem, pons], 2.0)], 0.6)
}
