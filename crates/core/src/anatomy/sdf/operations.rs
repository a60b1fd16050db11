//! Operations on solids.

use std::sync::Arc;

use glam::Vec3;

use super::{Bounds, Isometry, Solid};

/// Smooth minimum of width `k`: equal to `min` if the two values differ by `k` or more (quadratic, after I. Quilez).
fn smooth_min(a: f32, b: f32, k: f32) -> f32 {
    let h = (k - (a - b).abs()).max(0.0);
    a.min(b) - h * h / (4.0 * k)
}

/// Union of `parts`.
pub fn union(parts: impl IntoIterator<Item = Solid>) -> Solid {
    combine(parts.into_iter().collect(), 0.0, f32::min)
}

/// Union of `parts`, blended over `width` mm where they touch.
pub fn smooth_union(parts: impl IntoIterator<Item = Solid>, width: f32) -> Solid {
    combine(parts.into_iter().collect(), width, move |a, b| smooth_min(a, b, width))
}

fn combine(parts: Vec<Solid>, reach: f32, join: impl Fn(f32, f32) -> f32 + Send + Sync + 'static) -> Solid {
    // A blend extends beyond its parts by a quarter of the width for each further part.
    let bounds = parts.iter().fold(Bounds::EMPTY, |hull, part| hull.hull(part.bounds)).grown(0.5 * reach);
    let parts: Arc<[Solid]> = parts.into();
    Solid::new(bounds, move |p| {
        let mut best = f32::MAX;
        for part in parts.iter() {
            // For a point outside a part's box, the part is no nearer than the box. For a point inside, it may be the
            // deepest.
            let to_box = part.bounds.distance_mm(p);
            if to_box == 0.0 || to_box < best + reach {
                best = join(best, part.distance_mm(p));
            }
        }
        best
    })
}

impl Solid {
    /// Intersection with `other`.
    pub fn intersect(self, other: Self) -> Self {
        let bounds = self.bounds.overlap(other.bounds);
        Self::new(bounds, move |p| self.distance_mm(p).max(other.distance_mm(p)))
    }

    /// Intersection with `other`, with the edge rounded over `width` mm.
    pub fn smooth_intersect(self, other: Self, width: f32) -> Self {
        let bounds = self.bounds.overlap(other.bounds);
        Self::new(bounds, move |p| -smooth_min(-self.distance_mm(p), -other.distance_mm(p), width))
    }

    /// Difference: the part of this solid outside `other`.
    pub fn subtract(self, other: Self) -> Self {
        let bounds = self.bounds;
        Self::new(bounds, move |p| self.distance_mm(p).max(-other.distance_mm(p)))
    }

    /// Difference: the part of this solid outside `other`, with the edge rounded over `width` mm.
    pub fn smooth_subtract(self, other: Self, width: f32) -> Self {
        let bounds = self.bounds;
        Self::new(bounds, move |p| -smooth_min(-self.distance_mm(p), other.distance_mm(p), width))
    }

    /// The solid with its surface moved outward by `margin` mm; inward if negative.
    pub fn grown(&self, margin: f32) -> Self {
        let solid = self.clone();
        Self::new(self.bounds.grown(margin), move |p| solid.distance_mm(p) - margin)
    }

    /// The solid transformed by `outer_from_local`.
    pub fn placed(self, outer_from_local: Isometry) -> Self {
        let bounds = outer_from_local.bounds(self.bounds);
        Self::new(bounds, move |p| self.distance_mm(outer_from_local.local_point(p)))
    }

    /// The solid scaled by `factor` about the origin.
    pub fn scaled(self, factor: f32) -> Self {
        let bounds = Bounds { min: self.bounds.min * factor, max: self.bounds.max * factor };
        Self::new(bounds, move |p| factor * self.distance_mm(p / factor))
    }

    /// The part of the solid at x ≥ 0, together with its mirror image in the plane x = 0.
    pub fn with_mirror_image(self) -> Self {
        let Bounds { min, max } = self.bounds;
        let bounds = self.bounds.hull(Bounds { min: min.with_x(-max.x), max: max.with_x(-min.x) });
        Self::new(bounds, move |p| self.distance_mm(p.with_x(p.x.abs())))
    }

    /// The solid with its surface moved outward by `height` mm, a function of position whose magnitude is at most
    /// `most`.
    pub fn displaced(self, most: f32, height: impl Fn(Vec3) -> f32 + Send + Sync + 'static) -> Self {
        let bounds = self.bounds.grown(most);
        Self::new(bounds, move |p| {
            let d = self.distance_mm(p);
            // Far from the surface, the height doesn't matter.
            if d.abs() > 4.0 * most + 8.0 { d } else { d - height(p) }
        })
    }
}
