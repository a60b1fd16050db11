//! Refitting of a tree's boxes to moved triangles; the tree's topology stays the same.

use glam::Vec3;
use obvhs::cwbvh::node::CwBvhNode;

use super::PackedTriangle;
use crate::anatomy::Bounds;

/// Box of a triangle.
pub(super) fn bounds_of(t: &PackedTriangle) -> Bounds {
    let a = Vec3::from(t.corner);
    let (b, c) = (a + Vec3::from(t.edge1), a + Vec3::from(t.edge2));
    Bounds { min: a.min(b).min(c), max: a.max(b).max(c) }
}

/// The node `words` with updated boxes of its children, and its own exact box. `extents` holds the exact box of each
/// node; the boxes of the node's inner children are already up to date.
pub(super) fn fit(mut words: [u32; 20], triangles: &[PackedTriangle], extents: &[Bounds]) -> ([u32; 20], Bounds) {
    let node: &mut CwBvhNode = bytemuck::cast_mut(&mut words);
    let mut children = [Bounds::EMPTY; 8];
    for (slot, extent) in children.iter_mut().enumerate() {
        if node.is_child_empty(slot) {
            continue;
        }
        *extent = if node.is_leaf(slot) {
            let (first, count) = node.child_primitives(slot);
            let leaf = &triangles[first as usize..(first + count) as usize];
            leaf.iter().fold(Bounds::EMPTY, |extent, t| extent.hull(bounds_of(t)))
        } else {
            extents[node.child_node_index(slot) as usize]
        };
    }
    let extent = quantise(node, &children);
    (words, extent)
}

/// Box that contains the boxes of a node's children.
pub(super) fn held(words: &[u32; 20]) -> Bounds {
    let node: &CwBvhNode = bytemuck::cast_ref(words);
    (0..8).filter(|&slot| !node.is_child_empty(slot)).fold(Bounds::EMPTY, |extent, slot| {
        let child = node.child_aabb(slot);
        extent.hull(Bounds { min: child.min.into(), max: child.max.into() })
    })
}

/// Updates the joint root (node 0) of `trees` trees, whose own roots are the nodes after it.
pub(super) fn fit_root(nodes: &mut [[u32; 20]], trees: usize) {
    let roots: Vec<Bounds> = nodes[1..=trees].iter().map(held).collect();
    let mut children = [Bounds::EMPTY; 8];
    children[..trees].copy_from_slice(&roots);
    quantise(bytemuck::cast_mut(&mut nodes[0]), &children);
}

/// Joint root (node 0) of `trees` trees, whose own roots are the nodes after it. Its boxes are still empty.
pub(super) fn joint(trees: usize) -> [u32; 20] {
    let mut node = CwBvhNode { child_base_idx: 1, imask: (0xff_u32 >> (8 - trees)) as u8, ..CwBvhNode::default() };
    for slot in 0..trees {
        node.child_meta[slot] = 1 << 5 | (24 + slot as u8);
    }
    bytemuck::cast(node)
}

/// Writes the boxes of a node's children in steps of a power of two from the node's lowest corner, rounding outward
/// (Ylitie et al. 2017). Returns the exact box of the node.
fn quantise(node: &mut CwBvhNode, children: &[Bounds; 8]) -> Bounds {
    let whole = children.iter().fold(Bounds::EMPTY, |all, child| all.hull(*child));
    node.p = whole.min;
    let steps = ((whole.max - whole.min).max(Vec3::splat(1e-20)) / 255.0).to_array().map(|x| {
        // Smallest power of two not below x.
        let bits = x.to_bits();
        f32::from_bits((bits + 0x007f_ffff) & 0x7f80_0000)
    });
    node.e = steps.map(|step| (step.to_bits() >> 23) as u8);
    for (slot, child) in children.iter().enumerate() {
        if node.is_child_empty(slot) {
            continue;
        }
        let low = ((child.min - whole.min) / Vec3::from(steps)).floor().clamp(Vec3::ZERO, Vec3::splat(255.0));
        let high = ((child.max - whole.min) / Vec3::from(steps)).ceil().clamp(Vec3::ZERO, Vec3::splat(255.0));
        [node.child_min_x[slot], node.child_min_y[slot], node.child_min_z[slot]] = low.to_array().map(|x| x as u8);
        [node.child_max_x[slot], node.child_max_y[slot], node.child_max_z[slot]] = high.to_array().map(|x| x as u8);
    }
    whole
}
