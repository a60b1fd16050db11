//! Compressed wide BVH (Ylitie et al., HPG 2017) over a scene's triangles, laid out for the GPU.
//!
//! The crate obvhs builds it. A node has 80 bytes, read as five `vec4<u32>`: `[p.x, p.y, p.z, e.x | e.y<<8 | e.z<<16 |
//! imask<<24]`, `[child base, triangle base, meta 0..3, meta 4..7]`, `[min_x 0..7, max_x 0..7]`, the same for y, the
//! same for z.

mod balanced;
mod motion_tables;
mod moving;
mod refit;
mod segment;

use std::ops::Range;
use std::time::Duration;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh_from_tris};
use obvhs::{BvhBuildParams, triangle::Triangle};
use rayon::prelude::*;
use thiserror::Error;

use super::motion::Drift;
use super::{Bounds, Scene};
pub use motion_tables::{MotionTables, Moved};
use moving::Moving;
pub use segment::{SegmentHit, SegmentSearch};

/// Size of the traversal stack in the shaders; a node pushes at most one entry.
pub const STACK_DEPTH_MAX: usize = 32;

/// Enlargement of a triangle in the ray test, as a fraction of its longest edge, per mm of the ray's length. Despite
/// rounding, a ray through the common edge of two triangles then hits at least one of them.
pub const EDGE_TOLERANCE_PER_MM: f32 = 2.0e-7;

/// A triangle as the GPU reads it, 48 bytes.
#[derive(Debug, Clone, Copy, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub struct PackedTriangle {
    /// First corner relative to the tree's centre, mm.
    pub corner: [f32; 3],
    /// Index of the triangle's surface in the scene.
    pub surface: u32,
    /// Second corner minus the first, mm.
    pub edge1: [f32; 3],
    /// Index of the triangle in the scene, counted through all surfaces.
    pub triangle: u32,
    /// Third corner minus the first, mm.
    pub edge2: [f32; 3],
    /// Enlargement of the triangle in the ray test per mm of the ray's length, mm: longest edge ×
    /// [`EDGE_TOLERANCE_PER_MM`].
    pub tolerance: f32,
}

/// Errors in building a BVH.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum BvhError {
    /// A scene without triangles.
    #[error("the scene has no triangles")]
    Empty,
    /// A tree too deep for the shaders' stack.
    #[error(
        "the scene's BVH is {depth} levels deep; the traversal stack holds {STACK_DEPTH_MAX}: the mesh has too many coincident triangles"
    )]
    TooDeep {
        /// Number of levels found.
        depth: usize,
    },
}

/// Tree and triangles of a scene.
///
/// Scenes with moving parts have several trees: a root joins the tree of static triangles and one tree per motion
/// field. [`Bvh::set_time_s`] moves the corners and refits the trees that changed.
#[derive(Debug, Clone)]
pub struct Bvh {
    /// Scene-frame origin of all coordinates, mm.
    pub centre_mm: DVec3,
    /// Nodes, 80 bytes each.
    pub nodes: Vec<[u32; 20]>,
    /// Triangles in leaf order: the triangles of a leaf are contiguous.
    pub triangles: Vec<PackedTriangle>,
    /// Half the diagonal of the scene's bounds, plus the largest displacement by motion, mm.
    pub radius_mm: f64,
    moving: Option<Moving>,
    drift: Option<Drift>,
    drift_mm: DVec3,
}

/// Ranges of [`Bvh::nodes`] and [`Bvh::triangles`] that a change of time modified.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Changed {
    /// Indices of the modified nodes.
    pub nodes: Range<usize>,
    /// Indices of the modified triangles.
    pub triangles: Range<usize>,
}

impl Bvh {
    /// Builds the tree of all triangles of `scene`, at rest.
    ///
    /// # Errors
    /// A scene without triangles, or one whose tree is too deep for the traversal stack.
    pub fn build(scene: &Scene) -> Result<Self, BvhError> {
        let corners: Vec<([Vec3; 3], u32)> = scene
            .surfaces
            .iter()
            .zip(0u32..)
            .flat_map(|(surface, index)| surface.mesh.corners_mm().map(move |c| (c, index)))
            .collect();
        let bounds = Bounds::of(corners.iter().flat_map(|(c, _)| *c)).ok_or(BvhError::Empty)?;
        let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let centre_mm = 0.5 * (low + high);
        let triangles: Vec<Triangle> = corners
            .iter()
            .map(|(c, _)| {
                let [v0, v1, v2] = c.map(|corner| local(corner, centre_mm).into());
                Triangle { v0, v1, v2 }
            })
            .collect();

        let groups = moving::groups(scene);
        let trees: Vec<(CwBvh, &[u32])> = groups
            .par_iter()
            .map(|group| {
                let of_group: Vec<Triangle> = group.triangles.iter().map(|&i| triangles[i as usize]).collect();
                let build = BvhBuildParams::medium_build();
                let mut tree = build_cwbvh_from_tris(&of_group, build, &mut Duration::default());
                // One level is reserved for the root that joins several trees.
                if depth(bytemuck::cast_slice(&tree.nodes)) + 1 >= STACK_DEPTH_MAX {
                    tree = balanced::build(&of_group);
                }
                (tree, group.triangles.as_slice())
            })
            .collect();
        let order: Vec<u32> =
            trees.iter().flat_map(|(tree, of)| tree.primitive_indices.iter().map(|&i| of[i as usize])).collect();
        let packed =
            order.iter().map(|&index| PackedTriangle::of(&triangles[index as usize], corners[index as usize].1, index));
        let mut bvh = Self {
            centre_mm,
            nodes: Vec::new(),
            triangles: packed.collect(),
            radius_mm: 0.5 * (high - low).length() + scene.motion.reach_mm(u32::MAX),
            moving: None,
            drift: scene.motion.drift,
            drift_mm: DVec3::ZERO,
        };
        match trees.as_slice() {
            [(tree, _)] if groups.iter().all(|group| group.fields == 0) => {
                bvh.nodes = bytemuck::cast_slice(&tree.nodes).to_vec()
            }
            _ => {
                let (nodes, moving) = moving::join(scene, &groups, &trees, &order, centre_mm);
                bvh.nodes = nodes;
                bvh.moving = Some(moving);
                refit::fit_root(&mut bvh.nodes, trees.len());
            }
        }
        let depth = depth(&bvh.nodes);
        if depth >= STACK_DEPTH_MAX {
            return Err(BvhError::TooDeep { depth });
        }
        Ok(bvh)
    }

    /// Corners of a triangle in the scene, mm.
    pub fn corners_mm(&self, triangle: &PackedTriangle) -> [Vec3; 3] {
        let centre_mm = self.centre_mm.as_vec3();
        let corner = Vec3::from(triangle.corner) + centre_mm;
        [corner, corner + Vec3::from(triangle.edge1), corner + Vec3::from(triangle.edge2)]
    }

    /// Displacement of each triangle from its rest position `[x, y, z, 0]`, mm, in leaf order; empty for static scenes.
    pub fn displacements(&self) -> &[[f32; 4]] {
        self.moving.as_ref().map_or(&[], |moving| moving.displacements.as_slice())
    }

    /// Whether the scene has any motion.
    pub fn moves(&self) -> bool {
        self.moving.is_some() || self.drift.is_some()
    }

    /// Moves all triangles to their positions at `time_s`; [`Bvh::changed`] then lists the modified ranges.
    pub fn set_time_s(&mut self, time_s: f64) {
        self.move_trees(time_s, u32::MAX);
    }

    /// Moves the surfaces that can move into a box to their positions at `time_s`. The box is in the scene without drift, mm.
    /// Other surfaces may keep older positions. If they are closed, [windings](SegmentSearch::windings) about points in the
    /// box and hits in the box are exact. [`Bvh::moved`], [`Bvh::displacements`] and searches elsewhere then mix several
    /// times.
    pub fn set_time_near(&mut self, time_s: f64, near_mm: Bounds) {
        self.move_trees(time_s, self.moving.as_ref().map_or(0, |moving| moving.trees_near(near_mm)));
    }

    /// Moves the triangles of the chosen trees, a bit set, to their positions at `time_s`.
    fn move_trees(&mut self, time_s: f64, trees: u32) {
        if let Some(moving) = &mut self.moving {
            // Entering the thread pool once here spares each parallel loop below from entering it.
            let (nodes, triangles) = (&mut self.nodes, &mut self.triangles);
            rayon::scope(|_| moving.set_time_s(time_s, trees, self.centre_mm, nodes, triangles));
        }
        self.set_drift(time_s);
    }

    /// Sets the drift of the whole scene to its value at `time_s`; triangles and trees stay as they are.
    pub fn set_drift(&mut self, time_s: f64) {
        self.drift_mm = self.drift.map_or(DVec3::ZERO, |drift| drift.at(time_s));
    }

    /// Amounts of movement of each motion field at `time_s` ([`Rhythm::at`](super::motion::Rhythm::at)); empty for
    /// scenes without moving parts.
    pub fn amounts_at(&self, time_s: f64) -> Vec<[f32; 2]> {
        let fields = self.moving.iter().flat_map(|moving| &moving.motion.fields);
        fields.map(|field| field.amounts(time_s)).collect()
    }

    /// Tables with which a compute device moves the triangles; `None` for scenes without moving parts.
    pub fn motion_tables(&self) -> Option<MotionTables> {
        self.moving.as_ref().map(|moving| MotionTables::new(moving, self.centre_mm, &self.nodes))
    }

    /// Copy of the moved scene at the time last set; `None` for scenes without moving parts.
    pub fn moved(&self) -> Option<Moved> {
        self.moving.as_ref().map(|moving| Moved {
            amounts: moving.amounts.clone(),
            vertices: moving.vertices.iter().map(|v| (v.now - v.rest).extend(0.0).to_array()).collect(),
            triangles: self.triangles.clone(),
            displacements: moving.displacements.clone(),
            nodes: self.nodes.clone(),
        })
    }

    /// Drift of the whole scene under the probe, mm. It is equivalent to moving the probe by minus the drift in a scene
    /// without drift.
    pub fn drift_mm(&self) -> DVec3 {
        self.drift_mm
    }

    /// Ranges modified by the last change of time.
    pub fn changed(&self) -> &[Changed] {
        self.moving.as_ref().map_or(&[], |moving| moving.changed.as_slice())
    }
}

impl PackedTriangle {
    /// Packs `t`, whose corners are relative to the tree's centre, mm.
    fn of(t: &Triangle, surface: u32, triangle: u32) -> Self {
        Self::new([t.v0, t.v1, t.v2].map(Vec3::from), surface, triangle)
    }

    /// Packs a triangle from its corners relative to the tree's centre, mm.
    fn new(corners: [Vec3; 3], surface: u32, triangle: u32) -> Self {
        let (edge1, edge2) = (corners[1] - corners[0], corners[2] - corners[0]);
        let longest = edge1.length().max(edge2.length()).max((edge2 - edge1).length());
        Self {
            corner: corners[0].to_array(),
            surface,
            edge1: edge1.to_array(),
            triangle,
            edge2: edge2.to_array(),
            tolerance: longest * EDGE_TOLERANCE_PER_MM,
        }
    }
}

/// Converts a point of the scene to coordinates relative to the tree's centre, mm.
fn local(corner: Vec3, centre_mm: DVec3) -> Vec3 {
    (corner.as_dvec3() - centre_mm).as_vec3()
}

/// Number of levels of the tree.
fn depth(nodes: &[[u32; 20]]) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0u32, 1usize)];
    while let Some((node, level)) = open.pop() {
        deepest = deepest.max(level);
        open.extend(children(&nodes[node as usize]).map(|child| (child, level + 1)));
    }
    deepest
}

/// Indices of the nodes of the tree with the root `root`, each after its parent.
fn parents_first(nodes: &[[u32; 20]], root: u32) -> Vec<u32> {
    let (mut order, mut next) = (vec![root], 0);
    while let Some(&node) = order.get(next) {
        order.extend(children(&nodes[node as usize]));
        next += 1;
    }
    order
}

/// Indices of a node's inner children.
fn children(node: &[u32; 20]) -> Range<u32> {
    node[4]..node[4] + (node[3] >> 24).count_ones()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::{Mesh, TissueTable, analytic};

    fn scene(mesh: Mesh) -> Scene {
        let part = analytic::Part { name: "", tissue: "water", priority: 0, mesh };
        analytic::scene(vec![part], &TissueTable::builtin().unwrap(), "gel").unwrap()
    }

    #[test]
    fn fans_of_slivers_and_coincident_triangles_have_shallow_trees() {
        // Every sliver reaches from one corner to the far side, so each box contains the previous one.
        let side = |i: u32| Vec3::new(50.0, i as f32 * 0.01, 0.0);
        let fan = Mesh {
            vertices_mm: std::iter::once(Vec3::ZERO).chain((0..=4000).map(side)).collect(),
            triangles: (1..=4000).map(|i| [0, i, i + 1]).collect(),
        };
        let mut heap = analytic::cuboid(Vec3::ZERO, Vec3::ONE);
        heap.triangles = vec![heap.triangles[0]; 5000];
        // The coincident triangles of `heap` in a corner of half a metre of ordinary triangles.
        let wide = analytic::joined([heap.clone(), analytic::sphere(Vec3::splat(250.0), 250.0, 3)]);
        for mesh in [fan, heap, wide] {
            let count = mesh.triangles.len();
            let bvh = Bvh::build(&scene(mesh)).unwrap();
            let mut found: Vec<u32> = bvh.triangles.iter().map(|t| t.triangle).collect();
            found.sort_unstable();
            assert!(found.into_iter().eq(0..count as u32));
        }
    }
}
