//! Displacement of moving vertices from their rest positions.

use glam::{DQuat, DVec3};
use insonify_core::anatomy::motion::Shape;

use super::motion::Motion;
use crate::constants::{ATRIA, FADE, OUTER_WALL};

/// Displacement of each moving vertex, mm.
pub fn displace(motion: &Motion) -> Vec<DVec3> {
    let of = |fields: u32, place_mm: DVec3| -> DVec3 {
        let moves = |i: usize| fields & 1 << i != 0;
        let fields = motion.shapes.iter().zip(&motion.amounts).enumerate().filter(|(i, _)| moves(*i));
        fields.map(|(_, (shape, amounts))| displacement(shape, place_mm, *amounts)).sum()
    };
    motion.vertices.iter().map(|vertex| of(vertex.fields, vertex.rest_mm + motion.centre_mm)).collect()
}

/// 0 up to `low`, 1 from `high` on, smooth between.
fn smooth_step(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Displacement of the scene point `p` by one displacement field, mm.
fn displacement(shape: &Shape, p: DVec3, amounts: [f64; 2]) -> DVec3 {
    match *shape {
        Shape::Beat { centre_mm, axis, radius_mm, squeeze, shorten } => {
            let [radius_mm, squeeze, shorten] = [radius_mm, squeeze, shorten].map(f64::from);
            let (axis, q) = (axis.as_dvec3().normalize(), p - centre_mm.as_dvec3());
            let reach = q.length() / radius_mm;
            let along = q.dot(axis) / radius_mm;
            let ventricular = smooth_step(-0.25, 0.15, along);
            let amount = amounts[0] * ventricular + ATRIA * amounts[1] * (1.0 - ventricular);
            let depth = 1.0 - (1.0 - OUTER_WALL) * smooth_step(0.3, 1.0, reach);
            let valves = (-4.0 * along * along).exp();
            let narrowing = (q - along * radius_mm * axis) * amount * squeeze * depth;
            (1.0 - smooth_step(1.0, 1.0 + FADE, reach)) * (axis * amounts[0] * shorten * radius_mm * valves - narrowing)
        }
        Shape::Breath { centre_mm, axis, half_length_mm, radius_mm, widen, shift_mm } => {
            let [half_length_mm, radius_mm] = [half_length_mm, radius_mm].map(f64::from);
            let (axis, q) = (axis.as_dvec3().normalize(), p - centre_mm.as_dvec3());
            let along_mm = q.dot(axis);
            let about_axis = q - along_mm * axis;
            let aside = about_axis.length() / radius_mm;
            let fade = (1.0 - smooth_step(0.3, 1.0 + FADE, along_mm.abs() / half_length_mm))
                * (1.0 - smooth_step(1.0, 1.0 + FADE, aside));
            let inside = 1.0 - smooth_step(0.3, 1.0, aside);
            amounts[0] * fade * (f64::from(widen) * about_axis + f64::from(shift_mm) * inside * axis)
        }
        Shape::Swing { joint_mm, end_mm, axis, radius_mm, angle_deg } => {
            let (limb, q) = ((end_mm - joint_mm).as_dvec3(), p - joint_mm.as_dvec3());
            let (length_mm, radius_mm) = (limb.length(), f64::from(radius_mm));
            let along = (q.dot(limb) / limb.length_squared()).clamp(0.0, 1.0);
            let aside = (q - along * limb).length() / radius_mm;
            let distal = smooth_step(0.0, 1.0, q.dot(limb) / (length_mm * radius_mm.min(length_mm)));
            let weight = (1.0 - smooth_step(1.0, 1.0 + FADE, aside)) * distal;
            let turn_rad = weight * amounts[0] * f64::from(angle_deg).to_radians();
            DQuat::from_axis_angle(axis.as_dvec3().normalize(), turn_rad) * q - q
        }
    }
}
