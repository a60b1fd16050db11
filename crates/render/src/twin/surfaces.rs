//! Membership of points in closed surfaces, and crossings of straight rays with them.

use glam::DVec3;

use super::inputs::{Inputs, Ray, Triangle};
use crate::constants::TOUCH_MM;

/// The surfaces that a point is inside, one bit each, surface 0 in the lowest bit of the first word.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Membership(pub [u32; 8]);

impl Membership {
    /// Marks the point as inside or outside of a surface.
    pub fn set(&mut self, surface: u32, inside: bool) {
        let (word, bit) = ((surface >> 5) as usize, 1 << (surface & 31));
        if inside {
            self.0[word] |= bit;
        } else {
            self.0[word] &= !bit;
        }
    }

    /// Index of the highest surface that the point is inside; `None` outside of all.
    pub fn highest(&self) -> Option<u32> {
        (0..256).rev().find(|s| self.0[(s >> 5) as usize] >> (s & 31) & 1 == 1)
    }

    /// Index of the tissue at the point `here_mm`: the highest surface's tissue. Outside of all surfaces it is the
    /// background, or air beyond the film of gel.
    pub fn medium(&self, inputs: &Inputs, here_mm: DVec3) -> usize {
        let depth_mm = inputs.below_face_mm(here_mm);
        let outside =
            if inputs.film_mm.is_some_and(|film| depth_mm > film) { inputs.beyond } else { inputs.background };
        self.highest().map_or(outside, |s| inputs.surface_tissue[s as usize])
    }

    /// Enters and leaves surfaces at coincident crossings. A surface both entered and left there has a crease or a
    /// silhouette: its membership is unchanged.
    pub(super) fn cross(&mut self, coincident: &[Crossing<'_>]) {
        for crossing in coincident {
            let surface = crossing.triangle.surface;
            let any = |enters: bool| coincident.iter().any(|c| c.triangle.surface == surface && c.enters == enters);
            if any(true) != any(false) {
                self.set(surface, any(true));
            }
        }
    }
}

/// Intersection of a ray with a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing<'a> {
    /// Distance along the ray, mm.
    pub(super) t_mm: f64,
    /// Whether the ray enters the surface there.
    pub(super) enters: bool,
    pub(super) triangle: &'a Triangle,
}

/// Every crossing of `ray` with t in (t_min, t_max], nearest first.
pub(super) fn crossings<'a>(inputs: &'a Inputs, ray: &Ray, t_min_mm: f64, t_max_mm: f64) -> Vec<Crossing<'a>> {
    let hits = inputs.triangles.iter().filter_map(|t| intersect(t, ray));
    let mut found: Vec<_> = hits.filter(|c| c.t_mm > t_min_mm && c.t_mm <= t_max_mm).collect();
    found.sort_by(|a, b| a.t_mm.total_cmp(&b.t_mm));
    found
}

/// Möller and Trumbore's test; a triangle reaches beyond its edges by its tolerance, as on the device.
fn intersect<'a>(triangle: &'a Triangle, ray: &Ray) -> Option<Crossing<'a>> {
    let to_corner = triangle.corner_mm - ray.origin_mm;
    let t0 = to_corner.dot(ray.direction);
    // From the corner to the ray's point nearest to it.
    let s: DVec3 = ray.direction * t0 - to_corner;
    let p = ray.direction.cross(triangle.edge2_mm);
    let determinant = triangle.edge1_mm.dot(p);
    let q = s.cross(triangle.edge1_mm);
    let u = s.dot(p) * determinant.signum();
    let v = ray.direction.dot(q) * determinant.signum();
    let tolerance = triangle.tolerance * (t0.abs() + 100.0);
    let hit = determinant.abs() > 2.0 * tolerance
        && u >= -tolerance
        && v >= -tolerance
        && u + v <= determinant.abs() + tolerance;
    // edge1 × edge2 points outward, and the determinant is −direction · (edge1 × edge2).
    hit.then(|| Crossing { t_mm: t0 + triangle.edge2_mm.dot(q) / determinant, enters: determinant > 0.0, triangle })
}

/// Splits sorted crossings into groups, each within TOUCH_MM of its first.
pub(super) fn coincident<'a, 'b>(mut crossings: &'b [Crossing<'a>]) -> impl Iterator<Item = &'b [Crossing<'a>]> {
    std::iter::from_fn(move || {
        let limit = crossings.first()?.t_mm + TOUCH_MM;
        let (coincident, rest) = crossings.split_at(crossings.partition_point(|c| c.t_mm <= limit));
        crossings = rest;
        Some(coincident)
    })
}
