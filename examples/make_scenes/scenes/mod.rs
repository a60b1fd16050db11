//! Scenes of `assets/scenes`. Four of them each call for a particular set of effects, for measurement, teaching and
//! demonstration:
//!
//! | scene | effects |
//! |---|---|
//! | [`qa_phantom`] | point-spread function, speckle levels, attenuation |
//! | [`needle::vessel_needle`] | a mirror at an angle, reverberation within steel, anechoic blood |
//! | [`gallbladder_stones`] | shadows behind stones, enhancement behind fluid, refraction at the wall |
//! | [`lung_air`] | total reflection, A-lines between pleura and probe, shadows of ribs |
//!
//! x is lateral, y elevational and z the depth from the skin, which is at z = 0.

mod gallbladder;
mod lung;
pub(crate) mod needle;
mod qa;

pub(crate) use gallbladder::gallbladder_stones;
pub(crate) use lung::lung_air;
pub(crate) use needle::{needle_cyst, needle_vessel, vessel_needle};
pub(crate) use qa::qa_phantom;

use glam::Vec3;
use insonify::anatomy::Mesh;
use insonify::anatomy::analytic::{self, Part};

/// Constructor of a scene's parts.
pub(crate) type MakeParts = fn() -> Vec<Part>;

/// Scenes of `assets/scenes`, by file name without suffix. `cargo run --example make_scenes` writes them.
pub(crate) const SCENES: [(&str, MakeParts); 10] = [
    ("speckle_block", analytic::speckle_block),
    ("sphere", analytic::cyst),
    ("slabs", analytic::slabs),
    ("bone_plate", analytic::bone_plate),
    ("qa_phantom", qa_phantom),
    ("vessel_needle", vessel_needle),
    ("needle_vessel", needle_vessel),
    ("needle_cyst", needle_cyst),
    ("gallbladder_stones", gallbladder_stones),
    ("lung_air", lung_air),
];

/// Flat layer over the whole scene, from depth `top_mm` to `bottom_mm`. Its half widths in x and y are `half_mm`.
fn layer(
    name: &'static str,
    tissue: &'static str,
    priority: i32,
    half_mm: (f32, f32),
    (top_mm, bottom_mm): (f32, f32),
) -> Part {
    let half = Vec3::new(half_mm.0, half_mm.1, 0.0);
    let mesh = analytic::cuboid(Vec3::Z * top_mm - half, Vec3::Z * bottom_mm + half);
    Part { name, tissue, priority, mesh }
}

/// As [`layer`], but its faces undulate with amplitude `wave_mm` and periods of some centimetres, as in a body.
fn wavy_layer(
    name: &'static str,
    tissue: &'static str,
    priority: i32,
    half_mm: (f32, f32),
    (top_mm, bottom_mm): (f32, f32),
    wave_mm: f32,
) -> Part {
    const COLUMNS: u32 = 64;
    const ROWS: u32 = 10;
    let mut mesh = Mesh::default();
    // Gives each layer another phase.
    let phase = top_mm;
    for depth in [top_mm, bottom_mm] {
        for j in 0..=ROWS {
            for i in 0..=COLUMNS {
                let x = half_mm.0 * (2.0 * i as f32 / COLUMNS as f32 - 1.0);
                let y = half_mm.1 * (2.0 * j as f32 / ROWS as f32 - 1.0);
                let wave = 0.7 * (x / 8.3 + phase).sin() + 0.3 * (x / 3.7 - y / 13.0 + 2.0 * phase).sin();
                mesh.vertices_mm.push(Vec3::new(x, y, depth + wave_mm * wave));
            }
        }
    }
    let (stride, under) = (COLUMNS + 1, (COLUMNS + 1) * (ROWS + 1));
    let mut quad = |[a, b, c, d]: [u32; 4]| mesh.triangles.extend([[a, b, c], [a, c, d]]);
    for j in 0..ROWS {
        for i in 0..COLUMNS {
            let a = j * stride + i;
            // The upper face points to −z.
            quad([a, a + stride, a + stride + 1, a + 1]);
            quad([under + a, under + a + 1, under + a + stride + 1, under + a + stride]);
        }
    }
    for i in 0..COLUMNS {
        let far = ROWS * stride + i;
        quad([i, i + 1, under + i + 1, under + i]);
        quad([far + 1, far, under + far, under + far + 1]);
    }
    for j in 0..ROWS {
        let (left, right) = (j * stride, j * stride + COLUMNS);
        quad([left + stride, left, under + left, under + left + stride]);
        quad([right, right + stride, under + right + stride, under + right]);
    }
    Part { name, tissue, priority, mesh }
}
