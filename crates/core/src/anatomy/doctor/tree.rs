//! Spatial queries of one surface: nearby triangles and line crossings.

use std::time::Duration;

use glam::{DVec3, Vec3};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2_from_tris;
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;

use crate::anatomy::Mesh;
use crate::anatomy::ray::intersect;

/// Ray directions that are parallel to no axis and no common diagonal. The third decides where the first two disagree.
const DIRECTIONS: [DVec3; 3] =
    [DVec3::new(0.361, 0.829, 0.427), DVec3::new(-0.743, 0.217, 0.633), DVec3::new(0.512, -0.477, -0.714)];

/// Crossing of a line and a triangle.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Crossing {
    /// Distance along the line, mm.
    pub(crate) t_mm: f64,
    /// Whether the line leaves through the triangle's outer side.
    pub(crate) leaves: bool,
    pub(crate) triangle: u32,
}

/// BVH over a mesh's triangles.
pub struct Tree<'m> {
    bvh: Bvh2,
    pub(crate) mesh: &'m Mesh,
}

impl<'m> Tree<'m> {
    /// Builds the tree; `None` for an empty mesh.
    pub fn new(mesh: &'m Mesh) -> Option<Self> {
        let triangles: Vec<Triangle> =
            mesh.corners_mm().map(|[a, b, c]| Triangle { v0: a.into(), v1: b.into(), v2: c.into() }).collect();
        let config = BvhBuildParams::fast_build();
        (!triangles.is_empty())
            .then(|| Self { bvh: build_bvh2_from_tris(&triangles, config, &mut Duration::default()), mesh })
    }

    /// Calls `each` with the index of every triangle whose box intersects the box of `corners`.
    pub fn near(&self, corners: [Vec3; 3], mut each: impl FnMut(u32)) {
        let points = corners.map(Into::into);
        self.bvh.aabb_traverse(Aabb::from_points(&points), |bvh, node| {
            let node = bvh.nodes[node as usize];
            let leaves = node.first_index..node.first_index + node.prim_count;
            leaves.for_each(|i| each(bvh.primitive_indices[i as usize]));
            true
        });
    }

    /// Calls `each` for every crossing ahead of `from_mm` along the unit `direction`, in any order.
    pub(crate) fn crossings(&self, from_mm: DVec3, direction: DVec3, mut each: impl FnMut(Crossing)) {
        // A zero component would give NaNs in the intersection of the ray with a box.
        let slanted = |v: f64| if v.abs() < 1e-6 { 1e-6 } else { v as f32 };
        let [x, y, z] = direction.to_array().map(slanted);
        let ray = Ray::new_inf(from_mm.as_vec3().into(), Vec3::new(x, y, z).into());
        self.bvh.ray_traverse_anyhit(ray, |_, index| {
            let triangle = self.bvh.primitive_indices[index];
            let hit = intersect(self.mesh.corners_of(triangle), 0.0, from_mm, direction);
            if let Some((t_mm, leaves)) = hit.filter(|(t_mm, _)| *t_mm > 0.0) {
                each(Crossing { t_mm, leaves, triangle });
            }
        });
    }

    /// Winding number of the surface about `point_mm`, counting only the triangles that `counts` accepts.
    pub fn winding(&self, point_mm: DVec3, counts: impl Fn(u32) -> bool) -> i32 {
        let along = |direction: DVec3| {
            let mut winding = 0;
            self.crossings(point_mm, direction.normalize(), |crossing| {
                if counts(crossing.triangle) {
                    winding += if crossing.leaves { 1 } else { -1 };
                }
            });
            winding
        };
        let [a, b] = [along(DIRECTIONS[0]), along(DIRECTIONS[1])];
        if a == b { a } else { along(DIRECTIONS[2]) }
    }

    /// Whether `point_mm` is inside the surface.
    pub fn holds(&self, point_mm: DVec3) -> bool {
        self.winding(point_mm, |_| true) != 0
    }
}
