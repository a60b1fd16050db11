//! Signed-distance modelling: closed solids as functions that are negative inside.
//!
//! A [`Solid`] pairs such a function with a box that contains the solid. The function needs to approximate the true
//! distance only near the surface. Operations use the box to skip distant parts. Lengths are in mm.

mod isometry;
mod operations;
mod primitives;
mod sweep;

use std::sync::Arc;

use glam::Vec3;

pub use crate::anatomy::Bounds;
pub use isometry::Isometry;
pub use operations::{smooth_union, union};
pub use primitives::{capsule, ellipsoid, round_cone, rounded_box};
pub use primitives::{half_space, plate, sphere};
pub use sweep::smooth_sweep;
pub use sweep::{catmull_rom, sweep};

/// Border between `inside` and `outside`, found by `steps` bisections; returns the last value that is inside.
pub fn bisect(inside: f32, outside: f32, steps: usize, is_inside: impl Fn(f32) -> bool) -> f32 {
    let (mut inside, mut outside) = (inside, outside);
    for _ in 0..steps {
        let middle = 0.5 * (inside + outside);
        if is_inside(middle) { inside = middle } else { outside = middle }
    }
    inside
}

/// Signed distance of a solid, mm, at a point in mm; negative inside.
type Field = dyn Fn(Vec3) -> f32 + Send + Sync;

/// A closed solid.
#[derive(Clone)]
pub struct Solid {
    field: Arc<Field>,
    bounds: Bounds,
}

impl Solid {
    /// Solid of the points at which `field` is negative; `bounds` must contain all of them.
    pub fn new(bounds: Bounds, field: impl Fn(Vec3) -> f32 + Send + Sync + 'static) -> Self {
        Self { field: Arc::new(field), bounds }
    }

    /// Signed distance at `p`, mm, negative inside; accurate to first order near the surface.
    pub fn distance_mm(&self, p: Vec3) -> f32 {
        (self.field)(p)
    }

    /// Box that contains the solid.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// Unit outward normal near the surface, by central differences.
    pub fn normal(&self, p: Vec3) -> Vec3 {
        self.gradient(p).normalize_or_zero()
    }

    /// Gradient of the distance, per mm, by central differences.
    pub fn gradient(&self, p: Vec3) -> Vec3 {
        const STEP_MM: f32 = 0.02;
        let d = |e: Vec3| self.distance_mm(p + e) - self.distance_mm(p - e);
        Vec3::new(d(Vec3::X * STEP_MM), d(Vec3::Y * STEP_MM), d(Vec3::Z * STEP_MM)) / (2.0 * STEP_MM)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest deviation of the gradient's length from 1 on the surface, over rays from the middle.
    fn slope_error(solid: &Solid) -> f32 {
        let centre = 0.5 * (solid.bounds().min + solid.bounds().max);
        (0..200)
            .map(|i| {
                let (s, c) = (i as f32 * 2.4).sin_cos();
                let z = 1.0 - 2.0 * (i as f32 + 0.5) / 200.0;
                let direction = Vec3::new(c, s, 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z;
                let far = solid.bounds().size().length();
                let inside = bisect(0.0, far, 40, |t| solid.distance_mm(centre + direction * t) < 0.0);
                (solid.gradient(centre + direction * inside).length() - 1.0).abs()
            })
            .fold(0.0, f32::max)
    }

    #[test]
    fn primitives_are_distances_at_their_surface() {
        let solids = [
            sphere(Vec3::ONE, 3.0),
            ellipsoid(Vec3::ZERO, Vec3::new(20.0, 7.0, 3.0)),
            round_cone(Vec3::ZERO, Vec3::new(9.0, 2.0, 1.0), 4.0, 2.0),
            rounded_box(Vec3::ZERO, Vec3::new(8.0, 5.0, 4.0), 2.0),
            sweep(&catmull_rom(&[(Vec3::ZERO, 3.0), (Vec3::X * 4.0, 4.0), (Vec3::X * 8.0, 2.0)], 4)),
        ];
        for (i, solid) in solids.iter().enumerate() {
            // At edges between faces, the central difference is slightly below 1.
            assert!(slope_error(solid) < 0.02, "solid {i}: slope off by {}", slope_error(solid));
        }
    }

    #[test]
    fn distances_of_balls_and_rods_are_exact() {
        let rod = capsule(Vec3::ZERO, Vec3::X * 10.0, 2.0);
        assert!((rod.distance_mm(Vec3::new(5.0, 5.0, 0.0)) - 3.0).abs() < 1e-5);
        assert!((rod.distance_mm(Vec3::new(14.0, 0.0, 0.0)) - 2.0).abs() < 1e-5);
        assert!((rod.distance_mm(Vec3::new(5.0, 0.0, 0.0)) + 2.0).abs() < 1e-5);
        // A ball inside the other: their convex hull is the larger ball.
        let nested = round_cone(Vec3::ZERO, Vec3::X, 5.0, 2.0);
        assert!((nested.distance_mm(Vec3::Y * 7.0) - 2.0).abs() < 1e-5);
    }

    #[test]
    fn a_union_is_the_minimum_of_its_parts_everywhere() {
        // Boxes of deep and shallow parts overlap; a shallow part must not make the union skip a deep one.
        let parts = [
            capsule(Vec3::ZERO, Vec3::new(9.0, 9.0, 0.0), 1.0),
            sphere(Vec3::new(4.0, 4.0, 0.0), 5.0),
            ellipsoid(Vec3::new(-6.0, 0.0, 2.0), Vec3::new(4.0, 8.0, 3.0)),
        ];
        let all = union(parts.clone());
        for i in 0..4000 {
            let at = |k: i32, m: i32| ((i * k) % m) as f32 / m as f32 * 30.0 - 15.0;
            let p = Vec3::new(at(7, 97), at(13, 89), at(29, 83));
            let least = parts.iter().map(|s| s.distance_mm(p)).fold(f32::MAX, f32::min);
            let d = all.distance_mm(p);
            assert!((d < 0.0) == (least < 0.0), "sign at {p}");
            assert!(least > 0.0 || d == least, "{d} for {least} at {p}");
        }
    }

    #[test]
    fn isometries_invert_and_compose() {
        let a = Isometry::from_axes(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, 1.0, 1.0), Vec3::X);
        let b = Isometry::from_axes(Vec3::new(-4.0, 0.0, 1.0), Vec3::new(1.0, 2.0, 0.3), Vec3::Z);
        let p = Vec3::new(0.3, -7.0, 2.0);
        assert!((a.local_point(a.point(p)) - p).length() < 1e-5);
        assert!((a.then(&b).point(p) - a.point(b.point(p))).length() < 1e-5);
    }

    #[test]
    fn a_mirror_image_is_symmetric_and_bounded() {
        let both = capsule(Vec3::new(2.0, 0.0, 0.0), Vec3::new(9.0, 3.0, 1.0), 1.5).with_mirror_image();
        let p = Vec3::new(6.0, 1.0, 0.5);
        assert_eq!(both.distance_mm(p), both.distance_mm(p.with_x(-p.x)));
        assert!((both.bounds().min.x + both.bounds().max.x).abs() < 1e-6);
        assert!(both.distance_mm(Vec3::new(-5.5, 1.5, 0.5)) < 0.0);
    }
}
