//! A compressed wide BVH (Ylitie et al., HPG 2017) over a scene's triangles, laid out for the GPU.
//!
//! Built by obvhs. A node is 80 bytes, read as five `vec4<u32>`:
//! `[p.x, p.y, p.z, e.x | e.y<<8 | e.z<<16 | imask<<24]`, `[child base, triangle base, meta 0..3, meta 4..7]`,
//! `[min_x 0..7, max_x 0..7]`, the same for y, the same for z.

use std::time::Duration;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use obvhs::{BvhBuildParams, cwbvh::builder::build_cwbvh_from_tris, triangle::Triangle};
use thiserror::Error;

use super::Scene;

/// Entries of the traversal stack in the shaders; a node pushes at most one.
pub const STACK_DEPTH_MAX: usize = 32;

/// How far a triangle reaches beyond its edges, relative to the longest edge and each mm of distance: rays
/// through a shared edge hit at least one of its triangles in spite of rounding.
pub const EDGE_TOLERANCE_PER_MM: f32 = 2.0e-7;

/// A triangle in leaf order, 48 bytes.
#[derive(Debug, Clone, Copy, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub struct PackedTriangle {
    /// First corner relative to the tree's centre, mm.
    pub corner: [f32; 3],
    /// Index of the surface.
    pub surface: u32,
    /// Second corner minus the first, mm.
    pub edge1: [f32; 3],
    /// Index of the triangle in the scene, counted through all surfaces.
    pub triangle: u32,
    /// Third corner minus the first, mm.
    pub edge2: [f32; 3],
    /// Tolerance of the edge functions a mm of distance, mm: longest edge × [`EDGE_TOLERANCE_PER_MM`].
    pub tolerance: f32,
}

/// Why no BVH could be built.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum BvhError {
    /// Nothing to build from.
    #[error("the scene has no triangles")]
    Empty,
    /// Too deep for the shaders' stack.
    #[error(
        "the scene's BVH is {depth} levels deep; the traversal stack holds {STACK_DEPTH_MAX}: the mesh has too many coincident triangles"
    )]
    TooDeep {
        /// Levels found.
        depth: usize,
    },
}

/// The tree and its triangles.
#[derive(Debug, Clone)]
pub struct Bvh {
    /// Scene-frame point that all coordinates are relative to, mm.
    pub centre_mm: DVec3,
    /// Nodes, 80 bytes each.
    pub nodes: Vec<[u32; 20]>,
    /// Triangles in leaf order.
    pub triangles: Vec<PackedTriangle>,
    /// Half the diagonal of the scene's bounds about the centre, mm.
    pub radius_mm: f64,
}

impl Bvh {
    /// Builds the tree of all of `scene`'s triangles.
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
        let first = corners.first().ok_or(BvhError::Empty)?.0[0].as_dvec3();
        let (low, high) = corners.iter().flat_map(|(c, _)| c).fold((first, first), |(low, high), corner| {
            let corner = corner.as_dvec3();
            (low.min(corner), high.max(corner))
        });
        let centre_mm = 0.5 * (low + high);
        let local = |corner: Vec3| (corner.as_dvec3() - centre_mm).as_vec3();

        let triangles: Vec<Triangle> = corners
            .iter()
            .map(|(c, _)| Triangle { v0: local(c[0]).into(), v1: local(c[1]).into(), v2: local(c[2]).into() })
            .collect();
        let tree = build_cwbvh_from_tris(&triangles, BvhBuildParams::medium_build(), &mut Duration::default());
        let nodes: Vec<[u32; 20]> = bytemuck::cast_slice(&tree.nodes).to_vec();
        let depth = depth(&nodes);
        if depth >= STACK_DEPTH_MAX {
            return Err(BvhError::TooDeep { depth });
        }
        let packed = tree.primitive_indices.iter().map(|&index| {
            let (_, surface) = corners[index as usize];
            let t = &triangles[index as usize];
            let (edge1, edge2) = (Vec3::from(t.v1 - t.v0), Vec3::from(t.v2 - t.v0));
            let longest = edge1.length().max(edge2.length()).max((edge2 - edge1).length());
            PackedTriangle {
                corner: Vec3::from(t.v0).to_array(),
                surface,
                edge1: edge1.to_array(),
                triangle: index,
                edge2: edge2.to_array(),
                tolerance: longest * EDGE_TOLERANCE_PER_MM,
            }
        });
        let triangles = packed.collect();
        Ok(Self { centre_mm, nodes, triangles, radius_mm: 0.5 * (high - low).length() })
    }
}

/// Levels of the tree.
fn depth(nodes: &[[u32; 20]]) -> usize {
    let mut deepest = 0;
    let mut open = vec![(0u32, 1usize)];
    while let Some((node, level)) = open.pop() {
        deepest = deepest.max(level);
        let words = &nodes[node as usize];
        let children = (words[3] >> 24).count_ones();
        open.extend((0..children).map(|child| (words[4] + child, level + 1)));
    }
    deepest
}
