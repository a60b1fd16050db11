//! Intersection of a straight segment with the triangles of the tree, and surfaces around a point.

use glam::{DVec3, Vec3};
use obvhs::cwbvh::node::CwBvhNode;

use super::{Bvh, PackedTriangle};
use crate::anatomy::Bounds;
use crate::anatomy::ray::intersect;

/// Width by which triangles reach beyond their edges, mm. It exceeds the rounding of their corners, so a segment
/// through the common edge of two triangles hits at least one of them.
const EDGE_MM: f64 = 2e-5;

/// Largest enlargement of a triangle, as a fraction of its size.
const ENLARGED_MAX: f64 = 0.05;

/// Largest distance of two hits on the common edge of two triangles, mm.
const COINCIDENT_MM: f64 = 1e-3;

/// Width by which boxes of the tree are enlarged, mm.
const BOX_MM: f64 = 1e-4;

/// Directions in which a point's surroundings are searched. They are parallel to no axis and no common diagonal. The
/// third decides where the first two disagree.
const DIRECTIONS: [DVec3; 3] =
    [DVec3::new(0.361, 0.829, 0.427), DVec3::new(-0.743, 0.217, 0.633), DVec3::new(0.512, -0.477, -0.714)];

/// Intersection of a segment with a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentHit {
    /// Distance from the segment's start, mm.
    pub distance_mm: f64,
    /// Index of the triangle's surface in the scene.
    pub surface: u32,
    /// Whether the segment leaves through the outer side of the surface.
    pub leaves: bool,
}

/// Search along segments, with buffers that are used again.
#[derive(Debug, Clone, Default)]
pub struct SegmentSearch {
    /// Nodes to visit.
    open: Vec<u32>,
    hits: Vec<SegmentHit>,
    /// Winding numbers along each direction.
    windings: [Vec<i32>; 3],
    /// For each surface, the distances of its last hit from inside and from outside.
    last_mm: Vec<[f64; 2]>,
}

impl SegmentSearch {
    /// All hits of the segment from `start_mm` along the unit `direction`, at distances from `near_mm` to `far_mm`, in
    /// order of distance. Triangles are where [`Bvh::set_time_s`] or [`Bvh::set_time_near`] put them last, without the
    /// drift. A hit on the common edge of two triangles may be listed twice.
    pub fn hits(&mut self, bvh: &Bvh, start_mm: DVec3, direction: DVec3, near_mm: f64, far_mm: f64) -> &[SegmentHit] {
        let Self { open, hits, .. } = self;
        let start_mm = start_mm - bvh.centre_mm;
        hits.clear();
        open.clear();
        open.push(0);
        while let Some(index) = open.pop() {
            let Some(words) = bvh.nodes.get(index as usize) else { continue };
            let node: &CwBvhNode = bytemuck::cast_ref(words);
            for slot in (0..8).filter(|&slot| !node.is_child_empty(slot)) {
                let child = node.child_aabb(slot);
                let bounds = Bounds { min: child.min.into(), max: child.max.into() };
                if !meets(bounds, start_mm, direction, near_mm, far_mm) {
                    continue;
                }
                if !node.is_leaf(slot) {
                    open.push(node.child_node_index(slot));
                    continue;
                }
                let (first, count) = node.child_primitives(slot);
                let leaf = bvh.triangles.iter().skip(first as usize).take(count as usize);
                hits.extend(leaf.filter_map(|t| hit(t, start_mm, direction)));
            }
        }
        hits.retain(|hit| (near_mm..=far_mm).contains(&hit.distance_mm));
        let order = |a: &SegmentHit, b: &SegmentHit| {
            a.distance_mm.total_cmp(&b.distance_mm).then((a.surface, a.leaves).cmp(&(b.surface, b.leaves)))
        };
        hits.sort_unstable_by(order);
        hits
    }

    /// Winding numbers about a point of the first `surfaces` surfaces: 0 outside of a closed surface. Triangles are as
    /// in [`Self::hits`].
    pub fn windings(&mut self, bvh: &Bvh, point_mm: DVec3, surfaces: usize) -> &[i32] {
        for which in [0, 1] {
            self.along(bvh, which, point_mm, surfaces);
        }
        if self.windings[0] != self.windings[1] {
            self.along(bvh, 2, point_mm, surfaces);
            let [first, second, third] = &mut self.windings;
            for ((vote, other), last) in first.iter_mut().zip(second).zip(third) {
                *vote = if vote == other { *vote } else { *last };
            }
        }
        &self.windings[0]
    }

    /// Winding numbers by the hits along one of the directions.
    fn along(&mut self, bvh: &Bvh, which: usize, point_mm: DVec3, surfaces: usize) {
        let far_mm = point_mm.distance(bvh.centre_mm) + 2.0 * bvh.radius_mm;
        self.hits(bvh, point_mm, DIRECTIONS[which].normalize(), 0.0, far_mm);
        let Self { hits, windings, last_mm, .. } = self;
        let windings = &mut windings[which];
        windings.clear();
        windings.resize(surfaces, 0);
        last_mm.clear();
        last_mm.resize(surfaces, [f64::NEG_INFINITY; 2]);
        for hit in hits.iter() {
            let surface = hit.surface as usize;
            let (Some(winding), Some(last_mm)) = (windings.get_mut(surface), last_mm.get_mut(surface)) else {
                continue;
            };
            let last_mm = &mut last_mm[usize::from(hit.leaves)];
            if hit.distance_mm - *last_mm > COINCIDENT_MM {
                *winding += if hit.leaves { 1 } else { -1 };
            }
            *last_mm = hit.distance_mm;
        }
    }
}

impl Bvh {
    /// [`SegmentSearch::windings`] of a single search.
    pub fn windings(&self, point_mm: DVec3, surfaces: usize) -> Vec<i32> {
        SegmentSearch::default().windings(self, point_mm, surfaces).to_vec()
    }
}

/// Whether a segment meets a box, by the slab test.
fn meets(bounds: Bounds, start_mm: DVec3, direction: DVec3, near_mm: f64, far_mm: f64) -> bool {
    let (low, high) = (bounds.min.as_dvec3() - BOX_MM, bounds.max.as_dvec3() + BOX_MM);
    let (mut near, mut far) = (near_mm, far_mm);
    for axis in 0..3 {
        let (from, along) = (start_mm[axis], direction[axis]);
        if along == 0.0 {
            if from < low[axis] || from > high[axis] {
                return false;
            }
            continue;
        }
        let (a, b) = ((low[axis] - from) / along, (high[axis] - from) / along);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    near <= far
}

fn hit(triangle: &PackedTriangle, start_mm: DVec3, direction: DVec3) -> Option<SegmentHit> {
    let corner = Vec3::from(triangle.corner);
    let (edge1, edge2) = (Vec3::from(triangle.edge1), Vec3::from(triangle.edge2));
    let corners = [corner, corner + edge1, corner + edge2];
    let longest_mm = f64::from(edge1.length().max(edge2.length()).max((edge2 - edge1).length()));
    let lowest_mm = edge1.as_dvec3().cross(edge2.as_dvec3()).length() / longest_mm;
    let margin = (EDGE_MM / lowest_mm).min(ENLARGED_MAX);
    // A triangle without an area has no height, and no margin.
    let (distance_mm, leaves) = intersect(corners, margin, start_mm, direction).filter(|_| lowest_mm > 0.0)?;
    Some(SegmentHit { distance_mm, surface: triangle.surface, leaves })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::{Scene, TissueTable, analytic};
    use crate::random::SplitMix64;

    fn scene() -> Scene {
        let ball = |name, centre: f32, radius| analytic::Part {
            name,
            tissue: "soft_tissue",
            priority: 0,
            mesh: analytic::sphere(Vec3::splat(centre), radius, 3),
        };
        analytic::scene(vec![ball("a", 40.0, 30.0), ball("b", 60.0, 20.0)], &TissueTable::builtin().unwrap(), "gel")
            .unwrap()
    }

    #[test]
    fn the_tree_finds_the_same_hits_as_a_test_of_all_triangles() {
        let (bvh, mut search) = (Bvh::build(&scene()).unwrap(), SegmentSearch::default());
        let mut random = SplitMix64::new(5);
        let mut count = 0;
        for _ in 0..500 {
            let mut point = || DVec3::from_array([0; 3].map(|_| random.between(0.0, 90.0)));
            let (start, end) = (point(), point());
            let (direction, far) = ((end - start).normalize(), start.distance(end));
            let found = search.hits(&bvh, start, direction, 0.0, far);
            let local = start - bvh.centre_mm;
            let mut all: Vec<_> = bvh.triangles.iter().filter_map(|t| hit(t, local, direction)).collect();
            all.retain(|hit| (0.0..=far).contains(&hit.distance_mm));
            assert_eq!(found.len(), all.len());
            assert!(found.is_sorted_by_key(|hit| hit.distance_mm));
            count += found.len();
        }
        assert!(count > 400, "{count}");
    }

    #[test]
    fn edges_and_corners_are_hit() {
        let (bvh, mut search) = (Bvh::build(&scene()).unwrap(), SegmentSearch::default());
        for triangle in bvh.triangles.iter().filter(|t| t.surface == 0) {
            let [a, b, c] = bvh.corners_mm(triangle).map(|v| v.as_dvec3());
            for target in [a, 0.5 * (a + b), 0.5 * (b + c), 0.3 * a + 0.7 * c] {
                let start = DVec3::new(40.1, 40.2, 39.9);
                let hits = search.hits(&bvh, start, (target - start).normalize(), 0.0, 35.0);
                let near = start.distance(target);
                assert!(hits.iter().any(|hit| hit.leaves && (hit.distance_mm - near).abs() < 1e-3), "{target}");
            }
        }
    }
}
