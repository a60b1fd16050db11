//! Sample points inside closed surfaces.

use glam::{DVec3, Vec3};

use super::RESOLUTION_MM;
use super::tree::Tree;

/// Sample points on the inward normal of a triangle.
pub(super) struct Probe {
    /// A point just inside the triangle, and a point half way to the opposite side of the surface.
    pub(super) points_mm: [DVec3; 2],
    /// Distance to the opposite side of the surface, mm.
    pub(super) thickness_mm: f64,
}

/// Distance of the first point from the triangle, mm. In a surface thinner than twice that, it is half the thickness.
const SKIN_DEEP_MM: f64 = 0.01;

/// Sample points inside a closed surface, below at most `count` of its triangles.
pub(super) fn probes(tree: &Tree<'_>, count: usize) -> Vec<Probe> {
    let mesh = tree.mesh;
    let step = mesh.triangles.len().div_ceil(count).max(1);
    // A mesh of few triangles has large ones, so each gets several samples.
    let each = (count / mesh.triangles.len().max(1)).clamp(1, POINTS_MAX_A_TRIANGLE);
    let below = |corners: [Vec3; 3], own: u32, sample: usize| {
        let [a, b, c] = corners.map(|v| v.as_dvec3());
        let inward = -(b - a).cross(c - a).try_normalize()?;
        let [u, v] = barycentric(sample);
        let middle = a + (b - a) * u + (c - a) * v;
        let mut thickness_mm = f64::INFINITY;
        tree.crossings(middle - inward * RESOLUTION_MM, inward, |crossing| {
            let t = crossing.t_mm - RESOLUTION_MM;
            if crossing.triangle != own && crossing.leaves && t >= 0.0 {
                thickness_mm = thickness_mm.min(t);
            }
        });
        let half_mm = 0.5 * thickness_mm;
        let points_mm = [SKIN_DEEP_MM.min(half_mm), half_mm].map(|depth| middle + inward * depth);
        thickness_mm.is_finite().then_some(Probe { points_mm, thickness_mm })
    };
    let chosen = mesh.corners_mm().zip(0u32..).step_by(step);
    chosen.flat_map(|(corners, own)| (0..each).filter_map(move |sample| below(corners, own, sample))).collect()
}

/// Largest number of samples below one triangle.
const POINTS_MAX_A_TRIANGLE: usize = 64;

/// Barycentric coordinates of the sample of index `sample`. Sample 0 is the centroid; the others are spread evenly over
/// the triangle by the additive recurrence of the plastic number.
fn barycentric(sample: usize) -> [f64; 2] {
    if sample == 0 {
        return [1.0 / 3.0; 2];
    }
    let [u, v] = [0.754_877_666_246_693, 0.569_840_290_998_053].map(|step| (0.5 + sample as f64 * step).fract());
    if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] }
}
