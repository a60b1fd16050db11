//! Inputs of the passes that move the scene.

use std::ops::Range;

use glam::DVec3;
use obvhs::cwbvh::node::CwBvhNode;

use insonify_core::anatomy::bvh::{MotionTables, Moved};
use insonify_core::anatomy::motion::Shape;

/// A vertex of moving surfaces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vertex {
    /// Rest position relative to the tree's centre, mm.
    pub rest_mm: DVec3,
    /// Bit set of the displacement fields that move it.
    pub fields: u32,
}

/// Moving vertices and triangles, and the fields that displace them.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Displacement fields, in scene coordinates.
    pub shapes: Vec<Shape>,
    /// Amounts of each displacement field at the frame's time, 0..=1.
    pub amounts: Vec<[f64; 2]>,
    /// Centre of the tree of bounding boxes in the scene, mm.
    pub centre_mm: DVec3,
    /// Moving vertices.
    pub vertices: Vec<Vertex>,
    /// Vertex indices of each triangle from `first_triangle` on.
    pub corners: Vec<[usize; 3]>,
    /// Index of the first moving triangle.
    pub first_triangle: usize,
    /// Indices of the tree's nodes that are refitted, except the root.
    pub refitted: Vec<usize>,
}

/// A node of the tree.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// Quantisation step of the children's boxes, mm.
    pub step_mm: DVec3,
    /// Children of the node; empty slots are left out.
    pub children: Vec<Child>,
}

/// A child of a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Child {
    /// Minimum corner of the child's box, mm.
    pub low_mm: DVec3,
    /// Maximum corner of the child's box, mm.
    pub high_mm: DVec3,
    /// Node or triangles inside the box.
    pub below: Below,
}

/// Content of a child's box.
#[derive(Debug, Clone, PartialEq)]
pub enum Below {
    /// Index of a node.
    Node(usize),
    /// Indices of triangles.
    Leaf(Range<usize>),
}

impl Motion {
    /// Inputs from the scene's tables and a frame's amounts.
    pub(crate) fn new(tables: &MotionTables, moved: &Moved) -> Self {
        let vertex = |&[x, y, z, fields]: &[u32; 4]| Vertex {
            rest_mm: DVec3::from_array([x, y, z].map(|bits| f32::from_bits(bits).into())),
            fields,
        };
        Self {
            shapes: tables.shapes.clone(),
            amounts: moved.amounts.iter().map(|amounts| amounts.map(f64::from)).collect(),
            centre_mm: tables.centre_mm,
            vertices: tables.vertices.iter().map(vertex).collect(),
            corners: tables.corners.iter().map(|&[a, b, c, _]| [a, b, c].map(|v| v as usize)).collect(),
            first_triangle: tables.first_triangle as usize,
            refitted: tables.nodes.iter().map(|&[node, _]| node as usize).filter(|&node| node != 0).collect(),
        }
    }
}

impl Node {
    /// Decodes a node of the packed tree.
    pub(crate) fn decode(words: &[u32; 20]) -> Self {
        let node: &CwBvhNode = bytemuck::cast_ref(words);
        let child = |slot: usize| {
            let held = node.child_aabb(slot);
            let below = if node.is_leaf(slot) {
                let (first, count) = node.child_primitives(slot);
                Below::Leaf(first as usize..(first + count) as usize)
            } else {
                Below::Node(node.child_node_index(slot) as usize)
            };
            let [low_mm, high_mm] =
                [held.min, held.max].map(|corner| DVec3::new(corner.x.into(), corner.y.into(), corner.z.into()));
            Child { low_mm, high_mm, below }
        };
        Self {
            step_mm: DVec3::from_array(node.e.map(|e| f64::from(e) - 127.0).map(f64::exp2)),
            children: (0..8).filter(|&slot| !node.is_child_empty(slot)).map(child).collect(),
        }
    }
}
