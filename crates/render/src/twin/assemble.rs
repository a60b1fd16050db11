//! Moved triangles, from the displacements of their vertices.

use glam::DVec3;

use super::inputs::Triangle;
use super::motion::Motion;
use crate::constants::EDGE_TOLERANCE_PER_MM;

/// The moving triangles, from the displacement of each vertex. Surface and index come from `before`, the scene's
/// triangles.
pub fn assemble(motion: &Motion, displaced_mm: &[DVec3], before: &[Triangle]) -> Vec<Triangle> {
    let moving = motion.corners.iter().zip(&before[motion.first_triangle..]);
    let triangle = |(corners, before): (&[usize; 3], &Triangle)| {
        let [a, b, c] = corners.map(|v| motion.vertices[v].rest_mm + displaced_mm[v]);
        let longest_mm = [b - a, c - a, c - b].into_iter().map(DVec3::length).fold(0.0, f64::max);
        Triangle {
            corner_mm: a,
            edge1_mm: b - a,
            edge2_mm: c - a,
            tolerance: longest_mm * EDGE_TOLERANCE_PER_MM,
            displacement_mm: corners.iter().map(|&v| displaced_mm[v]).sum::<DVec3>() / 3.0,
            ..*before
        }
    };
    moving.map(triangle).collect()
}
