//! Traversal of the tree by rays of different directions, one node of each ray at a time. While one ray waits for
//! memory, the others go on.

use glam::Vec3;

use super::ray_triangle::intersection;
use super::search::{Covered, Search};
use super::traverse::{Crossing, Nearest, Ray, Stack, Tree, boxes, leaf, prefetch_child, slack};
use super::tree::{LEAF, WIDTH};
use crate::host::lanes::{RAYS, bits};

/// Search of one ray.
#[derive(Debug)]
struct RaySearch {
    ray: Ray,
    t_min: f32,
    /// Slack of the ray's box tests, mm.
    slack_mm: f32,
    highest: u32,
    found: Search,
    /// Node or leaf to visit next.
    child: u32,
    stack: Stack,
    depth: usize,
}

/// Searches of up to [`RAYS`] rays for their nearest crossings.
#[derive(Debug)]
pub(super) struct Stream {
    rays: [RaySearch; RAYS],
    /// One bit for each ray that still searches.
    open: u32,
}

impl Stream {
    pub(super) fn new() -> Self {
        let ray_search = || RaySearch {
            ray: Ray::new(Vec3::ZERO, Vec3::Z),
            t_min: 0.0,
            slack_mm: 0.0,
            highest: 0,
            found: Search::new(0.0),
            child: 0,
            stack: Stack::new(),
            depth: 0,
        };
        Self { rays: std::array::from_fn(|_| ray_search()), open: 0 }
    }

    /// Adds a ray that searches for its nearest crossing in (t_min, t_max]. Crossings of surfaces below surface
    /// `highest` go to its lane of `covered`.
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, ray: Ray, [t_min, t_max]: [f32; 2], highest: u32) {
        let ray_search = &mut self.rays[lane];
        (ray_search.ray, ray_search.t_min, ray_search.slack_mm, ray_search.highest) =
            (ray, t_min, slack(t_min, t_max), highest);
        (ray_search.found, ray_search.child, ray_search.depth) = (Search::new(t_max), 0, 0);
        self.open |= 1 << lane;
    }

    /// Runs all searches to their ends. Crossings of surfaces below the medium's are in `covered`, unsorted: all up to
    /// [`TOUCH_MM`](crate::host::constants::TOUCH_MM) beyond the nearest crossing, and maybe farther crossings.
    #[inline(always)]
    pub(super) fn search(&mut self, tree: &Tree<'_>, covered: &mut [Covered; RAYS]) {
        for lane in bits(self.open) {
            covered[lane].clear();
        }
        while self.open != 0 {
            for lane in bits(self.open) {
                if !self.rays[lane].go_on(tree, &mut covered[lane]) {
                    self.open &= !(1 << lane);
                }
            }
        }
    }

    /// The nearest crossing found by the last search of a lane; `None` without one.
    #[inline(always)]
    pub(super) fn nearest(&self, lane: usize) -> Option<Nearest> {
        self.rays[lane].found.nearest
    }
}

impl RaySearch {
    /// Visits the next node or leaf. Returns whether others are left to visit.
    #[inline(always)]
    fn go_on(&mut self, tree: &Tree<'_>, covered: &mut Covered) -> bool {
        let stack = self.stack.entries();
        if self.child & LEAF == 0 {
            let node = &tree.nodes[self.child as usize];
            let mut near = [0.0; WIDTH];
            let last = self.found.reach_mm() + self.slack_mm;
            let mut mask = boxes(node, &self.ray, self.t_min - self.slack_mm, last, &mut near);
            let bottom = self.depth;
            while mask != 0 {
                let slot = (mask.trailing_zeros() & 7) as usize;
                mask &= mask - 1;
                // Child 0 marks an empty slot, since the root is no child. NaN rays meet empty slots, too.
                if node.children[slot] == 0 {
                    continue;
                }
                // Sorted with the nearest on top.
                let mut at = self.depth;
                while at > bottom && stack[at - 1].0 < near[slot] {
                    stack[at] = stack[at - 1];
                    at -= 1;
                }
                stack[at] = (near[slot], node.children[slot]);
                self.depth += 1;
            }
        } else {
            for index in leaf(self.child) {
                let triangle = &tree.triangles[index];
                let (t, hit, enters) = intersection(triangle, self.ray.origin, self.ray.direction);
                if hit && t > self.t_min {
                    let crossing = Crossing { t, triangle: index as u32, enters };
                    self.found.add(crossing, triangle.surface < self.highest, covered);
                }
            }
        }
        let last = self.found.reach_mm() + self.slack_mm;
        while self.depth > 0 {
            self.depth -= 1;
            let (near, child) = stack[self.depth];
            // Children beyond the nearest crossing so far are skipped.
            if near <= last + 1.0e-4 {
                self.child = child;
                prefetch_child(tree, child);
                return true;
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use insonify_core::anatomy::analytic;

    use super::*;
    use crate::host::constants::TOUCH_MM;
    use crate::host::trace::search::tests::{alone, built, bvh, ray};
    use crate::host::trace::tree::WideNode;
    use crate::twin::hash::sample_unit;

    #[test]
    fn each_ray_finds_the_nearest_of_its_crossings_and_those_below_the_medium_before_it() {
        let bvh = bvh();
        let nodes: Vec<_> = bvh.nodes.iter().map(WideNode::decode).collect();
        let tree = Tree { nodes: &nodes, triangles: &bvh.triangles };
        let (mut stream, mut covered) = (Stream::new(), [Covered::new(); RAYS]);
        let (mut crowds, mut nothing, mut below) = (0, 0, 0);
        for trial in 0..2000u32 {
            let range = if trial.is_multiple_of(3) { [-40.0, 0.0] } else { [1.0e-3, 70.0] };
            let on = |lane: usize| sample_unit(13, trial, lane as u32, 0, 0) < [0.2, 0.6, 1.0][trial as usize % 3];
            // Some rays start outside all surfaces, some inside one of the six.
            let highest = |lane: usize| (trial + lane as u32) % 6;
            for lane in (0..RAYS).filter(|&lane| on(lane)) {
                stream.set(lane, ray(trial, lane as u32, 2.0), range, highest(lane));
            }
            stream.search(&tree, &mut covered);
            for lane in (0..RAYS).filter(|&lane| on(lane)) {
                let surface = |c: &Crossing| tree.triangles[c.triangle as usize].surface;
                let all = alone(&tree, &ray(trial, lane as u32, 2.0), range);
                let (under, over): (Vec<_>, Vec<_>) = all.into_iter().partition(|c| surface(c) < highest(lane));
                let first = stream.nearest(lane);
                assert_eq!(first.map(|n| n.crossing.t), over.first().map(|c| c.t), "ray {lane} of trial {trial}");
                let Some(first) = first else {
                    nothing += 1;
                    continue;
                };
                let to = first.crossing.t + TOUCH_MM;
                let near = over.iter().filter(|c| c.t <= to).count();
                assert!(first.crowded || near == 1, "ray {lane} of trial {trial}");
                crowds += u32::from(near > 1);
                let under = &under[..under.partition_point(|c| c.t <= to)];
                assert_eq!(covered[lane].up_to(to), under, "ray {lane} of trial {trial}");
                below += under.len();
            }
        }
        // The trials cover enough of every case.
        assert!(crowds > 100 && nothing > 100 && below > 1000, "{crowds}, {nothing}, {below}");
    }

    #[test]
    fn covered_crossings_without_room_count_as_any_other() {
        // Twelve spheres one inside another: 24 crossings.
        let sphere = |i: i32| analytic::sphere(Vec3::new(0.0, 0.0, 30.0), 25.0 - 2.0 * i as f32, 3);
        let bvh = built((0..12).map(sphere).collect());
        let nodes: Vec<_> = bvh.nodes.iter().map(WideNode::decode).collect();
        let tree = Tree { nodes: &nodes, triangles: &bvh.triangles };
        let (mut stream, mut covered) = (Stream::new(), [Covered::new(); RAYS]);
        // The scene's middle is the origin.
        let single = Ray::new(Vec3::new(0.4, 0.3, -35.0), Vec3::Z);
        let all = alone(&tree, &single, [0.0, 70.0]);
        assert_eq!(all.len(), 24);
        let mut nearest = |highest: u32| {
            stream.set(0, single, [0.0, 70.0], highest);
            stream.search(&tree, &mut covered);
            let found = stream.nearest(0).unwrap().crossing;
            (found, covered[0].up_to(found.t).to_vec())
        };
        assert_eq!(nearest(12), (all[Covered::MOST], all[..Covered::MOST].to_vec()));
        // Within the eighth sphere, crossings of the outer seven are covered and have room.
        assert_eq!(nearest(7), (all[7], all[..7].to_vec()));
    }

    #[test]
    fn a_ray_that_is_not_a_number_ends() {
        let bvh = bvh();
        let nodes: Vec<_> = bvh.nodes.iter().map(WideNode::decode).collect();
        let tree = Tree { nodes: &nodes, triangles: &bvh.triangles };
        let (mut stream, mut covered) = (Stream::new(), [Covered::new(); RAYS]);
        stream.set(3, Ray::new(Vec3::NAN, Vec3::NAN), [0.0, 70.0], 0);
        stream.search(&tree, &mut covered);
        assert_eq!(stream.nearest(3), None);
    }
}
