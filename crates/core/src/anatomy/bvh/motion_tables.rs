//! Tables with which a compute device moves the triangles of a scene and refits the nodes.

use std::ops::Range;

use glam::DVec3;

use super::moving::Moving;
use super::{PackedTriangle, refit};
use crate::anatomy::motion::Shape;

/// Moving vertices, their triangles and the nodes above them. Positions are relative to the tree's centre, mm. In a bit
/// set of fields, bit i stands for the scene's i-th motion field.
#[derive(Debug, Clone)]
pub struct MotionTables {
    /// Spatial form of each motion field of the scene.
    pub shapes: Vec<Shape>,
    /// Scene position of the tables' origin, mm.
    pub centre_mm: DVec3,
    /// Moving vertices: the bits of the three floats of the rest position, then the bit set of the vertex's fields.
    pub vertices: Vec<[u32; 4]>,
    /// Moving triangles in leaf order: three indices in `vertices`, then the bit set of the fields of the triangle's
    /// tree.
    pub corners: Vec<[u32; 4]>,
    /// Index of the first moving triangle in leaf order; all later triangles are moving, too.
    pub first_triangle: u32,
    /// Nodes to refit, the lowest level first: index in [`super::Bvh::nodes`], then the bit set of the fields of the
    /// node's tree. The last entry is the root that joins all trees.
    pub nodes: Vec<[u32; 2]>,
    /// Range of each level in `nodes`. Moving children of a node are in lower levels only.
    pub levels: Vec<Range<u32>>,
    /// Minimum and maximum corners `[x, y, z, 0]` of all nodes of the scene; zero except for the roots of trees.
    pub extents: Vec<[[f32; 4]; 2]>,
}

impl MotionTables {
    /// Builds the tables. The first of `nodes` is the root that joins all trees.
    pub(super) fn new(moving: &Moving, centre_mm: DVec3, nodes: &[[u32; 20]]) -> Self {
        let vertex = |v: &super::moving::Vertex| {
            let [x, y, z] = v.rest.to_array().map(f32::to_bits);
            [x, y, z, v.fields]
        };
        let fields_of = moving.trees.iter().flat_map(|tree| std::iter::repeat_n(tree.fields, tree.triangles.len()));
        let corners = moving.corners.iter().zip(fields_of).map(|(&[a, b, c], fields)| [a, b, c, fields]);
        let (mut order, mut levels) = (Vec::new(), Vec::new());
        let mut close = |order: &Vec<[u32; 2]>| {
            let start = levels.last().map_or(0, |level: &Range<u32>| level.end);
            levels.push(start..order.len() as u32);
        };
        for height in 0..moving.trees.iter().map(|tree| tree.levels.len()).max().unwrap_or(0) {
            for tree in &moving.trees {
                let level = tree.levels.get(height).into_iter().flatten();
                order.extend(level.map(|&node| [node, tree.fields]));
            }
            close(&order);
        }
        order.push([0, u32::MAX]);
        close(&order);
        let mut extents = vec![[[0.0; 4]; 2]; nodes.len()];
        let trees = (nodes[0][3] >> 24).count_ones() as usize;
        for root in 1..=trees {
            let held = refit::held(&nodes[root]);
            extents[root] = [held.min, held.max].map(|corner| corner.extend(0.0).to_array());
        }
        Self {
            shapes: moving.motion.fields.iter().map(|field| field.shape).collect(),
            centre_mm,
            vertices: moving.vertices.iter().map(vertex).collect(),
            corners: corners.collect(),
            first_triangle: moving.first_triangle as u32,
            nodes: order,
            levels,
            extents,
        }
    }
}

/// Moved state of a scene, in the layouts of [`super::Bvh`] and [`MotionTables`].
#[derive(Debug, Clone)]
pub struct Moved {
    /// Amounts of movement of each motion field.
    pub amounts: Vec<[f32; 2]>,
    /// Displacement of each moving vertex from its rest position `[x, y, z, 0]`, mm.
    pub vertices: Vec<[f32; 4]>,
    /// All triangles, moving and static.
    pub triangles: Vec<PackedTriangle>,
    /// Displacement of each triangle from its rest position `[x, y, z, 0]`, mm; all triangles.
    pub displacements: Vec<[f32; 4]>,
    /// All nodes, refitted.
    pub nodes: Vec<[u32; 20]>,
}
