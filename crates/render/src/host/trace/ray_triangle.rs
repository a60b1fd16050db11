//! Intersection of a ray with a triangle, as in `shaders/shared/bvh.wgsl`.

use glam::Vec3;

use insonify_core::anatomy::bvh::{EDGE_TOLERANCE_PER_MM, PackedTriangle};
use insonify_core::simd::{at_least, at_most};

/// Greatest distance between a path and its first straight line, mm: see `candidates`.
pub(super) const DRIFT_MM: f32 = 8.0e-3;

/// A ray against a triangle's plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayTriangle {
    /// Distance along the ray to its point nearest to the first corner, mm. From there to the plane it is `rest` /
    /// `magnitude`.
    pub(super) t0: f32,
    pub(super) rest: f32,
    /// Barycentric coordinates of the second and third corner, times `magnitude`.
    pub(super) u: f32,
    pub(super) v: f32,
    /// Cosine of the ray's angle with the normal, without its sign, times twice the triangle's area.
    pub(super) magnitude: f32,
    /// Whether the ray enters the surface.
    pub(super) enters: bool,
}

impl RayTriangle {
    /// Möller–Trumbore about the ray's point nearest to the first corner, which keeps f32 precise far from the ray's
    /// origin.
    #[inline(always)]
    pub(super) fn new(triangle: &PackedTriangle, origin: Vec3, direction: Vec3) -> Self {
        let (edge1, edge2) = (Vec3::from(triangle.edge1), Vec3::from(triangle.edge2));
        let to_corner = Vec3::from(triangle.corner) - origin;
        let t0 = to_corner.dot(direction);
        let s = direction * t0 - to_corner;
        let p = direction.cross(edge2);
        let determinant = edge1.dot(p);
        let side = if determinant >= 0.0 { 1.0 } else { -1.0 };
        let q = s.cross(edge1);
        Self {
            t0,
            rest: edge2.dot(q) * side,
            u: s.dot(p) * side,
            v: direction.dot(q) * side,
            magnitude: determinant.abs(),
            // edge1 × edge2 points outward, and the determinant is −direction · (edge1 × edge2).
            enters: determinant > 0.0,
        }
    }

    /// Distance to the plane, mm.
    #[inline(always)]
    pub(super) fn t(&self) -> f32 {
        self.t0 + self.rest / at_least(self.magnitude, 1.0e-30)
    }

    /// Tolerance of a triangle's edges at this distance, in the units of `u` and `v`.
    #[inline(always)]
    pub(super) fn tolerance(&self, triangle: &PackedTriangle) -> f32 {
        triangle.tolerance * (self.t0.abs() + 100.0)
    }

    /// Whether the ray passes within the edges, moved outward by a tolerance.
    #[inline(always)]
    pub(super) fn within(&self, tolerance: f32) -> bool {
        (self.u >= -tolerance) & (self.v >= -tolerance) & (self.u + self.v <= self.magnitude + tolerance)
    }
}

/// Intersects a ray with a triangle. Edges extend outward by a tolerance, so a shared edge is never missed. Returns the
/// distance (mm), whether the ray hits the triangle, and whether it enters the surface.
#[inline(always)]
pub(super) fn intersection(triangle: &PackedTriangle, origin: Vec3, direction: Vec3) -> (f32, bool, bool) {
    let met = RayTriangle::new(triangle, origin, direction);
    let tolerance = met.tolerance(triangle);
    let hit = (met.magnitude > 2.0 * tolerance) & met.within(tolerance);
    (met.t(), hit, met.enters)
}

/// Least and greatest distance, mm, at which rays within [`DRIFT_MM`] of this ray may hit a triangle, and whether any
/// of them may.
#[inline(always)]
pub(super) fn possible_distances(triangle: &PackedTriangle, origin: Vec3, direction: Vec3) -> (f32, f32, bool) {
    /// Distance at which the tolerance of an edge is two drifts: one of them along each edge.
    const DRIFTED_MM: f32 = 2.0 * DRIFT_MM / EDGE_TOLERANCE_PER_MM;
    let met = RayTriangle::new(triangle, origin, direction);
    // A triangle that the ray grazes is possible, too: a small magnitude excludes none.
    let hit = met.within(triangle.tolerance * (met.t0.abs() + (100.0 + DRIFTED_MM)));
    let per_magnitude = 1.0 / at_least(met.magnitude, 1.0e-30);
    let t = met.t0 + met.rest * per_magnitude;
    // A drift moves the intersection along the ray by up to its length over the cosine of incidence. The cross product
    // of two edges is at most the longest edge squared.
    let longest_mm = triangle.tolerance * (1.001 / EDGE_TOLERANCE_PER_MM);
    let error_mm = DRIFT_MM * (1.0 + longest_mm * longest_mm * per_magnitude);
    // A point within the tolerance of the edges is within three longest edges of the first corner. These bounds are
    // numbers, even if the others are NaN.
    let around_mm = 3.0 * longest_mm + DRIFT_MM;
    (at_least(t - error_mm, met.t0 - around_mm), at_most(t + error_mm, met.t0 + around_mm), hit)
}

/// Outcome of a test of a ray against a triangle.
pub(super) enum Hit {
    Misses,
    /// At a distance in mm, within the tolerance of an edge.
    AtEdge(f32),
    /// Inside the edges: distance in mm, and whether the ray enters the surface.
    Inside(f32, bool),
}

/// Like [`intersection`], but distinguishes hits within the tolerance of an edge.
#[inline(always)]
pub(super) fn hit(triangle: &PackedTriangle, origin: Vec3, direction: Vec3) -> Hit {
    let met = RayTriangle::new(triangle, origin, direction);
    let tolerance = met.tolerance(triangle);
    if !((met.magnitude > 2.0 * tolerance) & met.within(tolerance)) {
        Hit::Misses
    } else if met.within(-tolerance) {
        Hit::Inside(met.t(), met.enters)
    } else {
        Hit::AtEdge(met.t())
    }
}
