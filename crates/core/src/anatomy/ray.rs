//! Intersection of a line and a triangle.

use glam::{DVec3, Vec3};

/// Ray–triangle test (Möller & Trumbore, J Graph Tools 2:21, 1997). Returns the distance of the hit from `from_mm`
/// along `direction`, mm, and whether the line leaves through the outer side. `None` for a miss.
///
/// The distance may be negative. The triangle is enlarged by the fraction `margin` of its size.
pub fn intersect(corners: [Vec3; 3], margin: f64, from_mm: DVec3, direction: DVec3) -> Option<(f64, bool)> {
    let [a, b, c] = corners.map(|v| v.as_dvec3());
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let det = ab.dot(p);
    if det == 0.0 {
        return None;
    }
    let from_a = from_mm - a;
    let q = from_a.cross(ab);
    let (u, v, t) = (from_a.dot(p) / det, direction.dot(q) / det, ac.dot(q) / det);
    // The determinant is −direction · normal.
    (u >= -margin && v >= -margin && u + v <= 1.0 + margin).then_some((t, det < 0.0))
}
