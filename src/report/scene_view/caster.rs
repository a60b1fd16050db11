//! Ray casting through the triangles of the visible surfaces.

use std::time::Duration;

use glam::{DVec3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;

use crate::anatomy::Mesh;

/// Smallest component of a ray's direction: 1 µm per metre.
const LEAST: f64 = 1e-6;

/// Intersection of a ray and a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit {
    /// Distance along the ray, mm. It may be negative.
    pub(super) t_mm: f32,
    /// Index of the surface, as given to [`Caster::new`].
    pub(super) surface: u32,
    /// Cosine between the ray and the surface's outward normal; above 0 where the ray leaves the surface.
    pub(super) cosine: f32,
    /// Outward unit normal.
    pub(super) normal: Vec3,
}

/// A BVH over the triangles of the given surfaces.
pub(super) struct Caster {
    bvh: Option<CwBvh>,
    triangles: Vec<Triangle>,
    surfaces: Vec<u32>,
    /// Origin of the triangles' coordinates, mm.
    centre_mm: DVec3,
    /// Radius about the centre that contains all triangles, mm.
    radius_mm: f64,
}

impl Caster {
    /// Builds the BVH of surfaces, given by index and mesh.
    pub(super) fn new<'a>(meshes: impl Iterator<Item = (u32, &'a Mesh)> + Clone) -> Self {
        let corners = meshes.clone().flat_map(|(_, mesh)| mesh.vertices_mm.iter()).map(|v| v.as_dvec3());
        let least = DVec3::splat(f64::INFINITY);
        let (low, high) = corners.fold((least, -least), |(low, high), v| (low.min(v), high.max(v)));
        let bounded = low.is_finite() && high.is_finite();
        let centre_mm = if bounded { 0.5 * (low + high) } else { DVec3::ZERO };
        let radius_mm = if bounded { 0.5 * (high - low).length() } else { 0.0 };
        let local = |v: Vec3| Vec3A::from((v.as_dvec3() - centre_mm).as_vec3());
        let mut unsorted = Vec::new();
        let mut owners = Vec::new();
        for (index, mesh) in meshes {
            for [a, b, c] in mesh.corners_mm() {
                unsorted.push(Triangle { v0: local(a), v1: local(b), v2: local(c) });
                owners.push(index);
            }
        }
        if unsorted.is_empty() {
            return Self { bvh: None, triangles: unsorted, surfaces: owners, centre_mm, radius_mm };
        }
        let bvh = build_cwbvh_from_tris(&unsorted, BvhBuildParams::fast_build(), &mut Duration::default());
        // Sorted in the order of the leaves, so that a leaf's triangles are adjacent in memory.
        let triangles = bvh.primitive_indices.iter().map(|&i| unsorted[i as usize]).collect();
        let surfaces = bvh.primitive_indices.iter().map(|&i| owners[i as usize]).collect();
        Self { bvh: Some(bvh), triangles, surfaces, centre_mm, radius_mm }
    }

    /// Collects every hit of the line through `point_mm` along the unit vector `direction`, nearest first. Distances
    /// count from `point_mm` and may be negative.
    pub(super) fn crossings(&self, point_mm: DVec3, direction: DVec3, hits: &mut Vec<Hit>) {
        hits.clear();
        let Some(bvh) = &self.bvh else { return };
        let from_centre = point_mm - self.centre_mm;
        // The ray starts just outside the bounding sphere.
        let start = -from_centre.dot(direction) - 1.01 * self.radius_mm - 1.0;
        let origin = (from_centre + direction * start).as_vec3();
        // A component of 0 would give NaN in the slab test of boxes.
        let slanted = |v: f64| if v.abs() < LEAST { LEAST.copysign(v) } else { v } as f32;
        let [x, y, z] = direction.to_array().map(slanted);
        let ray = Ray::new_inf(origin.into(), Vec3A::new(x, y, z));
        bvh.ray_traverse_anyhit(ray, |ray, id| {
            let triangle = &self.triangles[id];
            let t = triangle.intersect(ray);
            if t.is_finite() {
                let normal =
                    Vec3::from((triangle.v1 - triangle.v0).cross(triangle.v2 - triangle.v0)).normalize_or_zero();
                let cosine = normal.dot(Vec3::from(ray.direction));
                hits.push(Hit { t_mm: t + start as f32, surface: self.surfaces[id], cosine, normal });
            }
        });
        hits.sort_unstable_by(|a, b| a.t_mm.total_cmp(&b.t_mm).then(a.surface.cmp(&b.surface)));
    }
}
