//! Inward offset of a closed surface by the distance from it.

use glam::{DAffine3, DVec3};

use super::contour::{Contour, Crossing, Origin, Solid, bisected};
use super::part::Part;
use super::winding::Winding;

/// Fewest and most voxels along the longest side.
const VOXELS: [f64; 2] = [100.0, 250.0];

/// What lies deeper than `depth_mm` within a closed surface.
struct Shrunk {
    surface: Winding,
    /// The surface without the faces that lie on the grid's border.
    skin: Winding,
    depth_mm: f64,
}

impl Solid for Shrunk {
    fn holds(&self, at_mm: DVec3) -> bool {
        self.skin.nearest(at_mm, self.depth_mm).is_none() && self.surface.number(at_mm) > 0.5
    }

    fn whole(&self, low_mm: DVec3, high_mm: DVec3) -> Option<bool> {
        let (centre, radius) = (0.5 * (low_mm + high_mm), 0.5 * low_mm.distance(high_mm));
        match self.skin.nearest(centre, self.depth_mm + radius) {
            Some(point) if point.distance(centre) + radius < self.depth_mm => Some(false),
            None if self.surface.nearest(centre, radius).is_none() => Some(self.surface.number(centre) > 0.5),
            _ => None,
        }
    }

    fn crossing(&self, from_mm: DVec3, to_mm: DVec3) -> Crossing {
        let at_mm = bisected(from_mm, to_mm, |at| self.holds(at));
        let nearest = self.skin.nearest(at_mm, 1.1 * self.depth_mm);
        let of_skin = || nearest.map_or(DVec3::ZERO, |point| (point - at_mm).normalize_or_zero());
        // Within the grid's border the surface itself ends the solid.
        let of_border =
            self.surface.hits(from_mm, to_mm).first().map(|hit| (from_mm.lerp(to_mm, hit.share), hit.normal));
        let near = of_border.filter(|(hit, _)| hit.distance(at_mm) < 0.01 * from_mm.distance(to_mm));
        let (at_mm, normal) = near.unwrap_or_else(|| (at_mm, of_skin()));
        Crossing { at_mm, normal, origin: Origin::Given }
    }
}

/// The surface of what lies deeper than `depth_mm` within a closed surface. Faces on the grid's border don't count as
/// its surface: there, the scan has cut it. The result is empty where nothing is that deep.
pub fn shrunk(part: &Part, depth_mm: f64) -> Part {
    let mesh = part.mesh(&DAffine3::IDENTITY);
    let Some(bounds) = mesh.bounds_mm() else { return Part::default() };
    let is_border = |t: &[u32; 3]| t.iter().map(|&v| part.borders[v as usize]).fold(u8::MAX, |a, b| a & b) != 0;
    let corners = || mesh.corners_mm().zip(&mesh.triangles);
    let skin = Winding::of(corners().filter(|(_, t)| !is_border(t)).map(|(corners, _)| corners));
    let solid = Shrunk { surface: Winding::of(mesh.corners_mm()), skin, depth_mm };
    let [coarse_mm, fine_mm] = VOXELS.map(|voxels| f64::from(bounds.size().max_element()) / voxels);
    let voxel_mm = depth_mm.clamp(fine_mm, coarse_mm);
    let inner = Contour::of(&solid, bounds, voxel_mm, mesh.triangles.len()).mesh;
    let vertices_mm: Vec<DVec3> = inner.vertices_mm.iter().map(|v| v.as_dvec3()).collect();
    Part { borders: vec![0; vertices_mm.len()], vertices_mm, triangles: inner.triangles }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::Mesh;
    use insonify_core::anatomy::analytic::{cuboid, sphere};
    use insonify_core::anatomy::doctor::crossing;
    use insonify_core::anatomy::doctor::tree::Tree;

    use super::*;

    fn part(mesh: &Mesh) -> Part {
        let vertices_mm: Vec<DVec3> = mesh.vertices_mm.iter().map(|v| v.as_dvec3()).collect();
        Part { borders: vec![0; vertices_mm.len()], vertices_mm, triangles: mesh.triangles.clone() }
    }

    #[test]
    fn a_ball_and_a_box_lose_the_depth_on_all_sides() {
        let ball = shrunk(&part(&sphere(Vec3::new(30.0, -20.0, 400.0), 50.0, 6)), 2.0);
        let radius_mm = (ball.volume_mm3() * 0.75 / std::f64::consts::PI).cbrt();
        assert!((radius_mm - 48.0).abs() < 0.05, "{radius_mm}");
        let block = shrunk(&part(&cuboid(Vec3::ZERO, Vec3::new(30.0, 20.0, 10.0))), 2.0);
        assert!((block.volume_mm3() / (26.0 * 16.0 * 6.0) - 1.0).abs() < 0.02, "{}", block.volume_mm3());
    }

    #[test]
    fn the_side_where_the_scan_cuts_is_not_moved() {
        let mut block = part(&cuboid(Vec3::ZERO, Vec3::new(30.0, 20.0, 10.0)));
        let low = block.vertices_mm.iter().map(|v| v.x).fold(f64::INFINITY, f64::min);
        block.borders = block.vertices_mm.iter().map(|v| u8::from(v.x == low)).collect();
        let inner = shrunk(&block, 2.0);
        assert!((inner.volume_mm3() / (28.0 * 16.0 * 6.0) - 1.0).abs() < 0.02, "{}", inner.volume_mm3());
        let lowest = inner.vertices_mm.iter().map(|v| v.x).fold(f64::INFINITY, f64::min);
        assert!((lowest - low).abs() < 0.1, "{lowest} {low}");
    }

    #[test]
    fn an_offset_of_a_thin_fold_does_not_cross_itself() {
        // A ball with an ear of 3 mm: nothing of the ear is 2 mm deep.
        let mut mesh = sphere(Vec3::ZERO, 30.0, 5);
        for v in mesh.vertices_mm.iter_mut().filter(|v| v.x > 0.0 && v.y.abs() < 1.5) {
            v.x *= 1.5;
        }
        let inner = part(&mesh).inward(2.0).mesh(&DAffine3::IDENTITY);
        assert_eq!(inner.unpaired_edges(), 0);
        assert!(crossing::pairs(&Tree::new(&inner).unwrap()).is_empty());
        let inner = shrunk(&part(&mesh), 2.0).mesh(&DAffine3::IDENTITY);
        let outer = Winding::of(mesh.corners_mm());
        let nearest = |v: &Vec3| outer.nearest(v.as_dvec3(), 100.0).unwrap().distance(v.as_dvec3());
        let least = inner.vertices_mm.iter().map(nearest).fold(f64::INFINITY, f64::min);
        assert!(least > 1.6, "{least}");
        let farthest = inner.vertices_mm.iter().map(|v| v.x).fold(0.0, f32::max);
        assert!(farthest < 40.0, "{farthest}");
    }
}
