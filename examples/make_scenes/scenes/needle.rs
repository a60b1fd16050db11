//! Scenes with a needle: one on its way into a vessel, with a guide wire, and two for a tracked needle.

use glam::Vec3;
use insonify::anatomy::Mesh;
use insonify::anatomy::analytic::{Part, sphere, tube};

use super::{layer, wavy_layer};

/// Position of the needle's tip, inside the vessel, mm.
const TIP_MM: Vec3 = Vec3::new(-2.0, 0.0, 20.0);
/// Radius of an 18-gauge needle, mm (ISO 9626: 1.2 to 1.3 mm wide).
const NEEDLE_RADIUS_MM: f32 = 0.63;
/// Radius of a guide wire of 0.035 inch, mm.
const WIRE_RADIUS_MM: f32 = 0.445;

/// Half widths of the layers in x and y, mm.
const HALF_MM: (f32, f32) = (60.0, 30.0);

/// The scene with the needle at 32° to the skin.
pub(crate) fn vessel_needle() -> Vec<Part> {
    vessel_needle_at(32.0)
}

/// Vessel with a steel needle and a steel guide wire.
///
/// The vessel runs along x at a depth of 20 mm and is 8 mm wide, below skin, fat, fascia and muscle. The needle enters
/// from the left at `angle_deg` (10 to 80) to the skin. The wire runs from the needle's tip along the vessel.
///
/// The needle reflects the beam to the side, and all of it beyond 15.5° (Snell, from muscle into steel; solids have no
/// shear waves here). The steeper it is, the fainter it appears. The wire is perpendicular to the beam, which enters it
/// and reverberates between its sides.
pub(crate) fn vessel_needle_at(angle_deg: f32) -> Vec<Part> {
    let angle = angle_deg.clamp(10.0, 80.0).to_radians();
    let along = Vec3::new(angle.cos(), 0.0, angle.sin());
    // From 12 mm above the skin, next to the probe, to the tip. Over the last 2 mm the needle narrows.
    let length = (TIP_MM.z + 12.0) / along.z;
    let on_needle = |at: f32, radius: f32| (TIP_MM - along * at, (radius, radius));
    let needle = tube(
        &[on_needle(length, NEEDLE_RADIUS_MM), on_needle(2.0, NEEDLE_RADIUS_MM), on_needle(0.0, WIRE_RADIUS_MM)],
        32,
    );
    let mut parts = needle_vessel();
    parts.push(Part { name: "guide wire", tissue: "steel", priority: 7, mesh: guide_wire(along) });
    parts.push(Part { name: "needle", tissue: "steel", priority: 8, mesh: needle });
    parts
}

/// The vessel of [`vessel_needle_at`] alone, for a tracked needle.
pub(crate) fn needle_vessel() -> Vec<Part> {
    vec![
        layer("skin", "skin", 1, HALF_MM, (0.3, 2.0)),
        wavy_layer("fat", "fat", 2, HALF_MM, (1.8, 7.0), 0.1),
        wavy_layer("muscle", "muscle", 3, HALF_MM, (6.6, 80.0), 0.3),
        wavy_layer("fascia", "fascia", 4, HALF_MM, (6.5, 6.9), 0.3),
        Part { name: "vessel wall", tissue: "vessel_wall", priority: 5, mesh: vessel(4.8) },
        Part { name: "blood", tissue: "blood", priority: 6, mesh: vessel(4.0) },
    ]
}

/// Cyst in a block of soft tissue, for a tracked needle.
///
/// The cyst is 16 mm wide at a depth of 30 mm. An artery 5 mm wide runs along y, 15 mm to its left and a little deeper.
pub(crate) fn needle_cyst() -> Vec<Part> {
    let artery = |radius_mm: f32| {
        let ring = |i: i32| {
            let y = 6.0 * i as f32;
            (Vec3::new(-15.0 + 1.5 * (y / 14.0).sin(), y, 36.0), (radius_mm, radius_mm))
        };
        tube(&(-4..=4).map(ring).collect::<Vec<_>>(), 24)
    };
    let cyst = |radius_mm: f32| sphere(Vec3::new(0.0, 0.0, 30.0), radius_mm, 3);
    vec![
        layer("skin", "skin", 1, HALF_MM, (0.3, 2.0)),
        wavy_layer("fat", "fat", 2, HALF_MM, (1.8, 6.0), 0.1),
        wavy_layer("soft tissue", "soft_tissue", 3, HALF_MM, (5.7, 80.0), 0.3),
        Part { name: "artery wall", tissue: "vessel_wall", priority: 4, mesh: artery(2.5) },
        Part { name: "artery", tissue: "blood", priority: 5, mesh: artery(2.0) },
        Part { name: "cyst wall", tissue: "vessel_wall", priority: 6, mesh: cyst(8.0) },
        Part { name: "cyst", tissue: "water", priority: 7, mesh: cyst(7.6) },
    ]
}

/// Tube along x that undulates slightly, as vessels do.
fn vessel(radius_mm: f32) -> Mesh {
    let ring = |i: i32| {
        let x = 4.0 * i as f32;
        (Vec3::new(x, 0.0, 20.0 + 0.5 * (x / 16.0).sin()), (radius_mm, radius_mm))
    };
    tube(&(-14..=14).map(ring).collect::<Vec<_>>(), 48)
}

/// Wire that begins inside the needle, bends to the lower half of the vessel, and continues along the vessel.
fn guide_wire(along: Vec3) -> Mesh {
    let start = TIP_MM - along * 3.0;
    let (p1, end) = (TIP_MM + along * 3.0, Vec3::new(9.0, 0.0, 22.0));
    let p2 = end - Vec3::X * 4.0;
    let bend = (0..=10).map(|i| {
        let t = i as f32 / 10.0;
        let u = 1.0 - t;
        start * (u * u * u) + p1 * (3.0 * u * u * t) + p2 * (3.0 * u * t * t) + end * (t * t * t)
    });
    let level = [14.0, 20.0, 60.0].map(|x| Vec3::new(x, 0.0, 22.0));
    let rings: Vec<_> = bend.chain(level).map(|p| (p, (WIRE_RADIUS_MM, WIRE_RADIUS_MM))).collect();
    tube(&rings, 32)
}
