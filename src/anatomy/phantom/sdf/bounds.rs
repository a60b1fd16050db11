//! Axis-aligned boxes.

use glam::Vec3;

/// An axis-aligned box, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least corner.
    pub min: Vec3,
    /// Greatest corner.
    pub max: Vec3,
}

impl Bounds {
    /// The empty box; its hull with any box is that box.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// A box far larger than any scene, for half-spaces.
    pub const EVERYWHERE: Self = Self { min: Vec3::splat(-1.0e6), max: Vec3::splat(1.0e6) };

    /// Box about `centre` that extends by `half` to each side.
    pub fn around(centre: Vec3, half: Vec3) -> Self {
        Self { min: centre - half, max: centre + half }
    }

    /// The box grown by `margin` on every side.
    pub fn grown(self, margin: f32) -> Self {
        Self { min: self.min - margin, max: self.max + margin }
    }

    /// Smallest box that contains both.
    pub fn hull(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Intersection of both, which may be empty.
    pub fn overlap(self, other: Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
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
        std::array::from_fn(|i| {
            let pick = |bit: usize, lo: f32, hi: f32| if i >> bit & 1 == 0 { lo } else { hi };
            Vec3::new(pick(0, self.min.x, self.max.x), pick(1, self.min.y, self.max.y), pick(2, self.min.z, self.max.z))
        })
    }
}
