//! Intersection of a ray with a triangle, as in `shaders/shared/bvh.wgsl`.

use glam::Vec3;
use insonify_core::anatomy::bvh::PackedTriangle;
use insonify_core::simd::at_least;

/// Intersects a ray with a triangle. Edges extend outward by a tolerance, so a shared edge is never missed. Returns the
/// distance (mm), whether the ray hits the triangle, and whether it enters the surface.
///
/// Möller–Trumbore about the ray's point nearest to the first corner, which keeps f32 precise far from the ray's origin.
#[inline(always)]
pub(super) fn intersection(triangle: &PackedTriangle, origin: Vec3, direction: Vec3) -> (f32, bool, bool) {
    let (edge1, edge2) = (Vec3::from(triangle.edge1), Vec3::from(triangle.edge2));
    let to_corner = Vec3::from(triangle.corner) - origin;
    // Distance along the ray to its point nearest to the first corner.
    let t0 = to_corner.dot(direction);
    let s = direction * t0 - to_corner;
    let p = direction.cross(edge2);
    let determinant = edge1.dot(p);
    let side = if determinant >= 0.0 { 1.0 } else { -1.0 };
    let q = s.cross(edge1);
    // Barycentric coordinates of the second and third corner, times the magnitude.
    let (u, v) = (s.dot(p) * side, direction.dot(q) * side);
    // Cosine of the ray's angle with the normal, without its sign, times twice the triangle's area.
    let magnitude = determinant.abs();
    let tolerance = triangle.tolerance * (t0.abs() + 100.0);
    let within = (u >= -tolerance) & (v >= -tolerance) & (u + v <= magnitude + tolerance);
    let t = t0 + edge2.dot(q) * side / at_least(magnitude, 1.0e-30);
    // edge1 × edge2 points outward, and the determinant is −direction · (edge1 × edge2).
    (t, (magnitude > 2.0 * tolerance) & within, determinant > 0.0)
}
