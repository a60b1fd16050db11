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

/// The inside of closed surfaces.
pub(super) struct Inside {
    surface: Winding,
    /// Whether there is one surface, so that none lies within another.
    is_one: bool,
}

impl Inside {
    /// The inside of one or several closed surfaces.
    pub(super) fn of<'a>(meshes: impl IntoIterator<Item = &'a Mesh>) -> Self {
        let meshes: Vec<&Mesh> = meshes.into_iter().collect();
        let is_one = meshes.len() == 1;
        Self { surface: Winding::of(meshes.into_iter().flat_map(Mesh::corners_mm)), is_one }
    }

    /// Distance from the surface, mm, at most `most_mm`.
    pub(super) fn distance_mm(&self, at_mm: DVec3, most_mm: f64) -> f64 {
        distance_mm(&self.surface, at_mm, most_mm)
    }
}

impl Field for Inside {
    fn depth_mm(&self, at_mm: DVec3) -> f64 {
        let nearest = self.surface.nearest_on(at_mm, FAR_MM);
        let away_mm = nearest.map_or(FAR_MM, |(point, _)| point.distance(at_mm));
        let side = nearest.filter(|_| self.is_one).and_then(|(point, corners)| is_behind(at_mm - point, corners));
        if side.unwrap_or_else(|| self.surface.number(at_mm) > 0.5) { away_mm } else { -away_mm }
    }
}

/// Whether a point lies behind the triangle that is nearest to it, by the way from its nearest point. `None` unless that
/// point lies within the triangle: edges and corners don't tell the side.
fn is_behind(way: DVec3, [a, b, c]: [DVec3; 3]) -> Option<bool> {
    let normal = (b - a).cross(c - a);
    let along = normal.dot(way);
    let whole = normal.length() * way.length();
    (whole > 1e-9 && along.abs() > (1.0 - 1e-9) * whole).then_some(along < 0.0)
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
    fn the_side_of_the_nearest_triangle_is_that_of_the_winding_number() {
        // A coarse ball with a dent, so that edges are sharp.
        let mut mesh = sphere(Vec3::ZERO, 20.0, 2);
        mesh.vertices_mm.iter_mut().filter(|v| v.z > 15.0).for_each(|v| v.z -= 18.0);
        let inside = Inside::of([&mesh]);
        let (mut by_triangle, mut within) = (0, 0);
        for n in 0..9261 {
            let at =
                DVec3::new(f64::from(n % 21), f64::from(n / 21 % 21), f64::from(n / 441)) * 2.3 - DVec3::splat(23.1);
            let is_in = inside.surface.number(at) > 0.5;
            assert_eq!(inside.depth_mm(at) > 0.0, is_in, "{at}");
            let nearest = inside.surface.nearest_on(at, FAR_MM);
            by_triangle += u32::from(nearest.is_some_and(|(point, corners)| is_behind(at - point, corners).is_some()));
            within += u32::from(is_in);
        }
        assert!(by_triangle > 1500 && within > 1000, "{by_triangle} {within}");
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
