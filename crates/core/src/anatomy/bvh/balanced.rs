//! Shallow BVH for triangles that the usual builder arranges in one deep chain of nodes: fans of slivers with nested
//! boxes, and coincident triangles.

use std::time::Duration;

use obvhs::aabb::Aabb;
use obvhs::cwbvh::{CwBvh, builder::build_cwbvh};
use obvhs::{BvhBuildParams, triangle::Triangle};

use super::refit::fit;
use super::{PackedTriangle, parents_first};
use crate::anatomy::Bounds;

/// Random displacement of the triangles' centroids, as a fraction of the diagonal of their bounds: 200 steps of the
/// builder's Morton codes (21 bits per axis). It separates coincident triangles, yet is far below the spacing of an
/// ordinary mesh.
const JITTER: f32 = 1e-4;

/// Builds a tree over the triangles' centroids, displaced at random to separate coincident centroids. Then fits the
/// nodes' boxes to the triangles themselves. The tree is slower to trace than the usual one. Its depth is at most about
/// log₂ of the number of triangles.
pub(super) fn build(triangles: &[Triangle]) -> CwBvh {
    let middle = |t: &Triangle| (t.v0 + t.v1 + t.v2) / 3.0;
    let bounds = triangles.iter().map(middle).fold(Aabb::empty(), |mut all, point| *all.extend(point));
    let reach_mm = JITTER * (bounds.max - bounds.min).length() + 1e-3;
    let points: Vec<Aabb> = triangles
        .iter()
        .zip(0u32..)
        .map(|(t, index)| {
            let chance = |salt: u32| {
                let bits = (index ^ salt.wrapping_mul(0x9e37_79b9)).wrapping_mul(0x85eb_ca6b);
                (bits ^ (bits >> 13)).wrapping_mul(0xc2b2_ae35) as f32 / u32::MAX as f32 - 0.5
            };
            let moved = glam::Vec3::new(chance(1), chance(2), chance(3)) * reach_mm;
            let [x, y, z] = middle(t).to_array();
            Aabb::from_point((glam::Vec3::new(x, y, z) + moved).into())
        })
        .collect();
    let params = BvhBuildParams { reinsertion_batch_ratio: 0.0, ..BvhBuildParams::medium_build() };
    let mut tree = build_cwbvh(&points, params, &mut Duration::default());
    let leaves: Vec<PackedTriangle> =
        tree.primitive_indices.iter().map(|&i| PackedTriangle::of(&triangles[i as usize], 0, i)).collect();
    let nodes: &mut [[u32; 20]] = bytemuck::cast_slice_mut(&mut tree.nodes);
    let mut extents = vec![Bounds::EMPTY; nodes.len()];
    for node in parents_first(nodes, 0).into_iter().rev() {
        let node = node as usize;
        (nodes[node], extents[node]) = fit(nodes[node], &leaves, &extents);
    }
    tree
}
