//! Solids that are given by a depth field, and their surfaces.

use glam::DVec3;
use insonify_core::anatomy::{Bounds, Mesh};

use crate::segmentation::meshing::contour::{Contour, Crossing, Origin, Solid};
use crate::segmentation::meshing::winding::Winding;

/// Distances beyond this one aren't told apart, mm.
pub(super) const FAR_MM: f64 = 12.0;
/// Largest change of a field along a line, relative to the line's length.
const SLOPE: f64 = 1.5;
/// Length over which a gradient is measured, mm.
const GRADIENT_MM: f64 = 0.02;
/// Most steps to a crossing, and depth that counts as 0, mm.
const STEPS: usize = 6;
const TOLERANCE_MM: f64 = 0.02;
/// Number of triangles to which a part is simplified, as far as its error allows.
const TRIANGLES: usize = 30_000;

/// Depth below the surface of a solid at a point, mm; negative outside of it.
pub(super) trait Field: Sync {
    /// The depth, or a smaller value of the same sign. Along any line it changes by at most [`SLOPE`] times the line's
    /// length.
    fn depth_mm(&self, at_mm: DVec3) -> f64;
}

impl<F: Fn(DVec3) -> f64 + Sync> Field for F {
    fn depth_mm(&self, at_mm: DVec3) -> f64 {
        self(at_mm)
    }
}

struct FieldSolid<'a, F>(&'a F);

impl<F: Field> FieldSolid<'_, F> {
    /// Point between two points, one within and one without, at which the depth is nearly 0 (Illinois method: Dowell and
    /// Jarratt 1971).
    fn zero(&self, from_mm: DVec3, to_mm: DVec3) -> DVec3 {
        let depth_mm = |share: f64| self.0.depth_mm(from_mm.lerp(to_mm, share));
        let (mut low, mut high) = ((0.0, depth_mm(0.0)), (1.0, depth_mm(1.0)));
        let mut middle = 0.5;
        for _ in 0..STEPS {
            middle = low.0 + (high.0 - low.0) * low.1 / (low.1 - high.1);
            let depth_mm = depth_mm(middle);
            if depth_mm.abs() < TOLERANCE_MM {
                break;
            }
            // The end that stays counts less, so that both ends approach.
            if (depth_mm > 0.0) == (low.1 > 0.0) {
                (low, high.1) = ((middle, depth_mm), 0.5 * high.1);
            } else {
                (high, low.1) = ((middle, depth_mm), 0.5 * low.1);
            }
        }
        from_mm.lerp(to_mm, middle)
    }
}

impl<F: Field> Solid for FieldSolid<'_, F> {
    fn holds(&self, at_mm: DVec3) -> bool {
        self.0.depth_mm(at_mm) > 0.0
    }

    fn whole(&self, low_mm: DVec3, high_mm: DVec3) -> Option<bool> {
        let depth_mm = self.0.depth_mm(0.5 * (low_mm + high_mm));
        (depth_mm.abs() > 0.5 * SLOPE * low_mm.distance(high_mm)).then_some(depth_mm > 0.0)
    }

    fn crossing(&self, from_mm: DVec3, to_mm: DVec3) -> Crossing {
        let at_mm = self.zero(from_mm, to_mm);
        let here_mm = self.0.depth_mm(at_mm);
        let slope = |axis: DVec3| here_mm - self.0.depth_mm(at_mm + GRADIENT_MM * axis);
        let normal = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)).normalize_or_zero();
        Crossing { at_mm, normal, origin: Origin::Given }
    }
}

/// Closed surface of the solid within `bounds`, from voxels of `voxel_mm`; empty if the solid holds no voxel.
pub(super) fn surface(field: &impl Field, bounds: Bounds, voxel_mm: f64) -> Mesh {
    Contour::of(&FieldSolid(field), bounds, voxel_mm, TRIANGLES).mesh
}

/// The inside of a closed surface.
pub(super) struct Inside(Winding);

impl Inside {
    /// The inside of one or several closed surfaces.
    pub(super) fn of<'a>(meshes: impl IntoIterator<Item = &'a Mesh>) -> Self {
        Self(Winding::of(meshes.into_iter().flat_map(Mesh::corners_mm)))
    }

    /// Distance from the surface, mm, at most `most_mm`.
    pub(super) fn distance_mm(&self, at_mm: DVec3, most_mm: f64) -> f64 {
        distance_mm(&self.0, at_mm, most_mm)
    }
}

impl Field for Inside {
    fn depth_mm(&self, at_mm: DVec3) -> f64 {
        let away_mm = distance_mm(&self.0, at_mm, FAR_MM);
        if self.0.number(at_mm) > 0.5 { away_mm } else { -away_mm }
    }
}

/// Depth in the intersection of two solids, mm. The second is asked only within the first.
pub(super) fn intersection_mm(first_mm: f64, second_mm: impl FnOnce() -> f64) -> f64 {
    if first_mm < 0.0 { first_mm } else { first_mm.min(second_mm()) }
}

/// Distance from a point to the nearest of some triangles, mm, at most `most_mm`.
pub(super) fn distance_mm(triangles: &Winding, at_mm: DVec3, most_mm: f64) -> f64 {
    triangles.nearest(at_mm, most_mm).map_or(most_mm, |nearest| nearest.distance(at_mm))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::sphere;

    use super::*;

    #[test]
    fn a_ball_and_half_a_ball_have_their_volumes() {
        let ball = |at: DVec3| 20.0 - at.length();
        let bounds = Bounds { min: Vec3::splat(-20.0), max: Vec3::splat(20.0) };
        let whole = surface(&ball, bounds, 0.9);
        let want = 4.0 / 3.0 * std::f64::consts::PI * 8000.0;
        assert!((whole.signed_volume_mm3() / want - 1.0).abs() < 0.003, "{}", whole.signed_volume_mm3() / want);
        let half = surface(&|at: DVec3| intersection_mm(at.x, || ball(at)), bounds, 0.9);
        assert!((half.signed_volume_mm3() / want - 0.5).abs() < 0.003, "{}", half.signed_volume_mm3() / want);
        assert_eq!((whole.unpaired_edges(), half.unpaired_edges()), (0, 0));
    }

    #[test]
    fn depths_in_a_mesh_are_distances_from_it() {
        let inside = Inside::of([&sphere(Vec3::ZERO, 30.0, 6)]);
        for x in [0.0_f64, 20.0, 25.0, 29.0, 33.0, 40.0, 90.0] {
            let want = (30.0 - x).clamp(-FAR_MM, FAR_MM);
            let found = inside.depth_mm(DVec3::X * x);
            assert!((found - want).abs() < 0.02, "{x}: {found}");
        }
    }
}
