//! Complex: the surfaces of all labels as triangles between two labels, over shared vertices.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;

use super::nets::Net;
use super::part::Part;
use super::smooth::Kind;
use super::{BORDER, NONE};

/// Triangle between two labels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    /// Indices of the vertices, counter-clockwise seen from the second side.
    pub corners: [u32; 3],
    /// Label behind the face, and label in front of it, where its normal points.
    pub sides: [u16; 2],
}

/// Surfaces of all labels, with shared vertices.
#[derive(Debug, Clone, Default)]
pub struct Complex {
    /// Vertices, mm along the grid's axes: voxel index times voxel spacing.
    pub vertices_mm: Vec<DVec3>,
    /// Freedom of movement of each vertex.
    pub(super) kinds: Vec<Kind>,
    /// Faces of the grid that each vertex lies on, as bits: see [`Net::border`].
    pub(super) borders: Vec<u8>,
    /// Faces of all surfaces.
    pub triangles: Vec<Triangle>,
}

impl Complex {
    /// Triangles of a net with voxel spacing `voxel_mm`. Each quad is divided along the diagonal that
    /// gives its smaller triangle more area.
    pub fn of(net: &Net, voxel_mm: DVec3) -> Self {
        let count = net.cells.len();
        let vertices_mm: Vec<DVec3> = (0..count).map(|v| net.position(v).as_dvec3() * voxel_mm).collect();
        let mut triangles = Vec::with_capacity(2 * net.quads.len());
        for quad in &net.quads {
            let [a, b, c, d] = quad.corners;
            let at = |v: u32| vertices_mm[v as usize];
            let ways = [[[a, b, c], [a, c, d]], [[a, b, d], [b, c, d]]];
            // If three corners of a quad lie on a line, one diagonal makes a triangle without area.
            let thinnest = |halves: [[u32; 3]; 2]| {
                let cross = halves.map(|[a, b, c]| (at(b) - at(a)).cross(at(c) - at(a)).length_squared());
                cross[0].min(cross[1])
            };
            let halves = if thinnest(ways[0]) >= thinnest(ways[1]) { ways[0] } else { ways[1] };
            triangles.extend(halves.map(|corners| Triangle { corners, sides: quad.sides }));
        }
        let kinds = (0..count).map(|v| net.kind(v)).collect();
        let borders = (0..count).map(|v| net.border(v)).collect();
        Self { vertices_mm, kinds, borders, triangles }
    }

    /// Closed surface of each label, outward, ascending by label.
    pub fn parts(&self) -> BTreeMap<u16, Part> {
        let mut parts: BTreeMap<u16, (Part, HashMap<u32, u32>)> = BTreeMap::new();
        for triangle in &self.triangles {
            for (side, &label) in triangle.sides.iter().enumerate() {
                if label == NONE || label == BORDER {
                    continue;
                }
                let (part, known) = parts.entry(label).or_default();
                let mut corners = triangle.corners.map(|v| {
                    *known.entry(v).or_insert_with(|| {
                        part.vertices_mm.push(self.vertices_mm[v as usize]);
                        part.borders.push(self.borders[v as usize]);
                        (part.vertices_mm.len() - 1) as u32
                    })
                });
                if side == 1 {
                    corners.swap(1, 2);
                }
                part.triangles.push(corners);
            }
        }
        parts.into_iter().map(|(label, (part, _))| (label, part)).collect()
    }
}
