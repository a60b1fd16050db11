//! Axis-aligned boxes.

use glam::{BVec3, Vec3};

/// An axis-aligned box, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Minimum corner.
    pub min: Vec3,
    /// Maximum corner.
    pub max: Vec3,
}

impl Bounds {
    /// The empty box; its union with any box is that box.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// A box far larger than any scene, for half-spaces.
    pub const EVERYWHERE: Self = Self { min: Vec3::splat(-1.0e6), max: Vec3::splat(1.0e6) };

    /// Smallest box that contains all `points`; `None` if there are none.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Option<Self> {
        let all = points.into_iter().fold(Self::EMPTY, Self::with);
        (all != Self::EMPTY).then_some(all)
    }

    /// The box extended to contain `p`.
    #[must_use]
    pub fn with(self, p: Vec3) -> Self {
        Self { min: self.min.min(p), max: self.max.max(p) }
    }

    /// Box about `centre` that extends by `half` to each side.
    pub fn around(centre: Vec3, half: Vec3) -> Self {
        Self { min: centre - half, max: centre + half }
    }

    /// The box grown by `margin` on every side.
    pub fn grown(self, margin: f32) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// Smallest box that contains both boxes.
    pub(crate) fn hull(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Intersection of both boxes, which may be empty.
    pub fn overlap(self, other: Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// Whether the boxes share a point.
    pub fn meets(self, other: Self) -> bool {
        self.min.cmple(other.max).all() && self.max.cmpge(other.min).all()
    }

    /// Whether `other` is inside this box.
    pub fn holds(self, other: Self) -> bool {
        self.min.cmple(other.min).all() && self.max.cmpge(other.max).all()
    }

    /// Extent along the axes; not positive if the box is empty.
    pub fn size(self) -> Vec3 {
        self.max - self.min
    }

    /// Distance from `p` to the box, mm; zero inside.
    pub fn distance_mm(self, p: Vec3) -> f32 {
        (self.min - p).max(p - self.max).max(Vec3::ZERO).length()
    }

    /// The eight corners.
    pub fn corners(self) -> [Vec3; 8] {
        std::array::from_fn(|i| Vec3::select(BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), self.max, self.min))
    }
}
