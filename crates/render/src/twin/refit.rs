//! Boxes of a tree, fitted to moved triangles.

use glam::DVec3;

use super::inputs::Triangle;
use super::motion::{Below, Node};

/// Smallest boxes of each node's children, for node 0 and all nodes below it: minimum and maximum corners, mm.
pub fn refit(nodes: &[Node], triangles: &[Triangle]) -> Vec<Vec<[DVec3; 2]>> {
    let mut boxes = vec![Vec::new(); nodes.len()];
    fit(nodes, triangles, 0, &mut boxes);
    boxes
}

/// Fits the boxes of a node's children and of all nodes below. Returns the node's own box.
fn fit(nodes: &[Node], triangles: &[Triangle], node: usize, boxes: &mut [Vec<[DVec3; 2]>]) -> [DVec3; 2] {
    let of_children: Vec<[DVec3; 2]> = nodes[node]
        .children
        .iter()
        .map(|child| match &child.below {
            Below::Node(below) => fit(nodes, triangles, *below, boxes),
            Below::Leaf(held) => bounds(triangles[held.clone()].iter().flat_map(|t| {
                let a = t.corner_mm;
                [a, a + t.edge1_mm, a + t.edge2_mm].map(|corner| [corner, corner])
            })),
        })
        .collect();
    let whole = bounds(of_children.iter().copied());
    boxes[node] = of_children;
    whole
}

fn bounds(boxes: impl Iterator<Item = [DVec3; 2]>) -> [DVec3; 2] {
    boxes.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], [l, h]| [low.min(l), high.max(h)])
}
