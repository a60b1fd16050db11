//! The mother: abdominal wall, uterus with placenta and cord, and what lies around it.

mod abdominal_wall;
mod cord;
mod pelvis;
mod placenta;
mod uterus;
mod viscera;

use super::attitude::Attitude;
use super::organ::{Body, Organ};
use super::parameters::{Lie, Parameters};
use super::sdf::Solid;
use glam::Vec3;

pub(super) use placenta::placenta_centre;

/// Half axes of the uterine cavity along x, y, z, mm: it grows with the fetus, is wide where that lies across, deep
/// where its belly looks forward or back, and swells with the fluid.
pub(super) fn cavity_semi_mm(parameters: &Parameters) -> Vec3 {
    let weeks = parameters.gestational_weeks as f32 - 22.0;
    let growth = 1.0 + 0.0583 * weeks - 0.000_28 * weeks * weeks;
    let turned = (parameters.roll_deg as f32).to_radians().sin().powi(2);
    let base = uterus::CAVITY_SEMI;
    let (broad, deep, long) = (base.x - 3.0 * turned, base.z + 8.0 * turned, base.y);
    let stretched = 1.0 + 0.16 * (0.5 - parameters.flexion as f32).max(0.0);
    let fluid = (parameters.fluid_index_mm as f32 - 140.0) / 100.0;
    let (aside, along) = if fluid < 0.0 { (0.05, 0.02) } else { (0.10, 0.06) };
    let (aside, along) = (1.0 + aside * fluid, stretched * (1.0 + along * fluid));
    let semi = match parameters.lie {
        Lie::Cephalic | Lie::Breech => Vec3::new(broad * aside, long * along, deep * aside),
        Lie::TransverseHeadLeft | Lie::TransverseHeadRight => Vec3::new(long * along, broad * aside, deep * aside),
    };
    semi * growth
}

/// Height of the belly's skin above the origin, mm.
pub(super) fn belly_top_mm(_: &Parameters) -> f32 {
    abdominal_wall::BELLY_TOP_MM
}

/// Middle of the bladder's urine, mm.
pub(super) fn bladder_centre(_: &Parameters) -> Vec3 {
    viscera::BLADDER_CENTRE
}

/// The uterine cavity.
pub(super) fn cavity(parameters: &Parameters) -> Solid {
    uterus::cavity(cavity_semi_mm(parameters))
}

/// Every surface of the mother, with placenta, cord and fluid.
pub(super) fn organs(parameters: &Parameters, attitude: &Attitude) -> Vec<Organ> {
    let parts = [
        abdominal_wall::organs(),
        viscera::organs(),
        pelvis::organs(),
        uterus::organs(cavity_semi_mm(parameters)),
        placenta::organs(),
        cord::organs(attitude),
    ];
    parts.into_iter().flatten().collect()
}

/// A surface of the mother.
fn organ(
    name: &'static str,
    tissue: &'static str,
    priority: i32,
    grain_mm: f32,
    coarsest_mm: f32,
    solid: Solid,
) -> Organ {
    Organ { name, tissue, priority, body: Body::Mother, grain_mm, coarsest_mm, solid }
}
