//! Signed-distance modelling: closed solids as functions that are negative inside.
//!
//! A [`Solid`] pairs such a function with a box that holds the solid. Values need only be near the true distance
//! close to the surface; operations use the box to skip what is far. Lengths are in mm.

mod bounds;
mod isometry;
mod operations;
mod primitives;
mod sweep;

use std::sync::Arc;

use glam::Vec3;

pub use bounds::Bounds;
pub use isometry::Isometry;
pub use operations::{smooth_union, union};
pub use primitives::{capsule, ellipsoid, half_space, plate, round_cone, rounded_box, sphere, torus};
pub use sweep::{catmull_rom, sweep};

/// The function of a solid: signed distance in mm at a point in mm, negative inside.
type Field = dyn Fn(Vec3) -> f32 + Send + Sync;

/// A closed solid.
#[derive(Clone)]
pub struct Solid {
    field: Arc<Field>,
    bounds: Bounds,
}

impl Solid {
    /// A solid that lies within `bounds` and is where `field` is negative.
    pub fn new(bounds: Bounds, field: impl Fn(Vec3) -> f32 + Send + Sync + 'static) -> Self {
        Self { field: Arc::new(field), bounds }
    }

    /// Signed distance at `p`, mm, negative inside; near the surface right to first order.
    pub fn distance_mm(&self, p: Vec3) -> f32 {
        (self.field)(p)
    }

    /// A box that holds the solid.
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
