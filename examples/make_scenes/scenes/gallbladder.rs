//! Scene: gallbladder with stones below the liver.

use glam::{Quat, Vec3};
use insonify::anatomy::Mesh;
use insonify::anatomy::analytic::{Part, joined, sphere};

use super::{layer, wavy_layer};

/// Centre of the gallbladder, mm.
const CENTRE_MM: Vec3 = Vec3::new(2.0, 0.0, 62.0);
/// Semi-axes of the gallbladder's lumen, mm. It measures about 70 × 28 mm, as when fasting.
const SEMI_AXES_MM: Vec3 = Vec3::new(35.0, 14.0, 14.0);
/// Thickness of the gallbladder's wall, mm; up to 3 is normal.
const WALL_MM: f32 = 2.0;
/// Stones: position along the gallbladder (−1 to 1), and radius, mm.
const STONES: [(f32, f32); 3] = [(-0.36, 5.5), (0.12, 4.0), (0.48, 3.0)];

/// Skin, fat, muscle and liver over a gallbladder with bile and three stones on its posterior wall. Deeper than the
/// liver, the lung gives a bright line, on which shadow and enhancement are visible.
pub(crate) fn gallbladder_stones() -> Vec<Part> {
    let half = (140.0, 60.0);
    vec![
        layer("skin", "skin", 1, half, (0.0, 2.0)),
        wavy_layer("fat", "fat", 2, half, (1.9, 12.0), 0.3),
        wavy_layer("muscle", "muscle", 3, half, (11.0, 20.0), 0.6),
        wavy_layer("liver", "liver", 4, half, (18.0, 160.0), 0.6),
        Part { name: "lung", tissue: "lung_aerated", priority: 5, mesh: lung() },
        Part { name: "gallbladder wall", tissue: "gallbladder_wall", priority: 6, mesh: gallbladder(WALL_MM) },
        Part { name: "bile", tissue: "bile", priority: 7, mesh: gallbladder(0.0) },
        Part { name: "stones", tissue: "gallstone", priority: 8, mesh: joined(STONES.map(|(at, r)| stone(at, r))) },
    ]
}

/// Pear-shaped surface `wall_mm` outside the lumen. The fundus points to +x.
fn gallbladder(wall_mm: f32) -> Mesh {
    let mut mesh = sphere(Vec3::ZERO, 1.0, 4);
    for v in &mut mesh.vertices_mm {
        *v = in_scene(*v, wall_mm);
    }
    mesh
}

/// Scene point in a direction from the gallbladder's centre, on the surface `wall_mm` outside the lumen.
fn in_scene(direction: Vec3, wall_mm: f32) -> Vec3 {
    let axes = SEMI_AXES_MM + wall_mm;
    let wide = 1.0 + 0.22 * direction.x;
    CENTRE_MM + Quat::from_rotation_y(0.2) * (axes * direction * Vec3::new(1.0, wide, wide))
}

/// Dome of the lung, deeper than the liver.
fn lung() -> Mesh {
    let mut mesh = sphere(Vec3::ZERO, 1.0, 4);
    for v in &mut mesh.vertices_mm {
        *v = Vec3::new(10.0, 0.0, 146.0) + *v * Vec3::new(120.0, 58.0, 27.0);
    }
    mesh
}

/// Lumpy stone on the posterior wall.
fn stone(at: f32, radius_mm: f32) -> Mesh {
    let floor = in_scene(Vec3::new(at, 0.0, (1.0 - at * at).sqrt()), 0.0);
    let centre = floor - Vec3::Z * (radius_mm - 0.4);
    let mut mesh = sphere(Vec3::ZERO, 1.0, 3);
    for v in &mut mesh.vertices_mm {
        let lump = 1.0 + 0.05 * (7.0 * v.x + 3.0 * v.y).sin() + 0.04 * (6.0 * v.z - 5.0 * v.y).cos();
        *v = centre + *v * (radius_mm * lump);
    }
    mesh
}
