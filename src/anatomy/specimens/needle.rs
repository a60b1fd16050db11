//! A needle on its way into a vessel, both in the imaging plane.

use glam::Vec3;

use super::layer;
use crate::anatomy::analytic::{Part, tube};

/// Where the needle's tip lies, in the middle of the vessel, mm.
const TIP_MM: Vec3 = Vec3::new(4.0, 0.0, 20.0);
/// Outer and inner radius of a 20-gauge needle, mm (ISO 9626: 0.9 mm outside, thin wall).
const NEEDLE_RADII_MM: (f32, f32) = (0.45, 0.32);

/// The scene with the needle at 32° to the skin.
pub fn vessel_needle() -> Vec<Part> {
    vessel_needle_at(32.0)
}

/// A vessel 8 mm wide at a depth of 20 mm along x below skin, fat, fascia and muscle, and a steel needle that enters from
/// the left at `angle_deg` (10 to 80) to the skin.
pub fn vessel_needle_at(angle_deg: f32) -> Vec<Part> {
    let half = (60.0, 30.0);
    let angle = angle_deg.clamp(10.0, 80.0).to_radians();
    let along = Vec3::new(angle.cos(), 0.0, angle.sin());
    // From 12 mm above the skin, beside the probe, to the tip, which narrows over 1.5 mm.
    let length = (TIP_MM.z + 12.0) / along.z;
    let needle = |radius: f32, end: f32, point: f32| {
        let ring = |at: f32, radius: f32| (TIP_MM - along * at, (radius, radius));
        tube(&[ring(length, radius), ring(end + 1.5, radius), ring(end, point)], 32)
    };
    let (outer, inner) = NEEDLE_RADII_MM;
    vec![
        layer("skin", "skin", 1, half, (0.3, 1.8)),
        layer("fat", "fat", 2, half, (1.7, 6.5)),
        layer("muscle", "muscle", 3, half, (6.4, 80.0)),
        layer("fascia", "fascia", 4, half, (6.3, 6.8)),
        Part { name: "vessel wall", tissue: "vessel_wall", priority: 5, mesh: vessel(4.8) },
        Part { name: "blood", tissue: "blood", priority: 6, mesh: vessel(4.0) },
        Part { name: "needle", tissue: "steel", priority: 7, mesh: needle(outer, 0.0, 0.08) },
        Part { name: "needle lumen", tissue: "water", priority: 8, mesh: needle(inner, 1.6, 0.05) },
    ]
}

/// A tube along x that sinks and rises a little, as vessels do.
fn vessel(radius_mm: f32) -> crate::anatomy::Mesh {
    let rings: Vec<_> = (-14..=14)
        .map(|i| {
            let x = 4.0 * i as f32;
            (Vec3::new(x, 0.0, 20.0 + 1.2 * (x / 16.0).sin()), (radius_mm, radius_mm))
        })
        .collect();
    tube(&rings, 48)
}
