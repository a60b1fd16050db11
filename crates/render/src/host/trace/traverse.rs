//! Intersection of a straight ray with triangles: `shaders/shared/{bvh,collect}.wgsl`, eight boxes at once.

use glam::Vec3;
use insonify_core::anatomy::bvh::{PackedTriangle, STACK_DEPTH_MAX};
use insonify_core::simd::prefetch;

use super::ray_triangle::intersection;
use super::tree::{LEAF, WIDTH, WideNode};

/// Stack capacity: each level leaves at most seven of a node's children pending.
const STACK: usize = (WIDTH - 1) * STACK_DEPTH_MAX + WIDTH;

/// A tree of boxes and its triangles, in the order of `anatomy::Bvh`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tree<'a> {
    pub(crate) nodes: &'a [WideNode],
    pub(crate) triangles: &'a [PackedTriangle],
}

/// Pending visits of a traversal: entry distance and child.
#[derive(Debug)]
pub(crate) struct Stack([(f32, u32); STACK]);

impl Stack {
    /// Most pending visits of a traversal.
    pub(super) const DEPTH: usize = STACK;

    pub(crate) fn new() -> Self {
        Self([(0.0, 0); STACK])
    }

    /// Memory of the pending visits.
    #[inline(always)]
    pub(super) fn entries(&mut self) -> &mut [(f32, u32); STACK] {
        &mut self.0
    }
}

/// A ray, prepared for box tests.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    pub(super) origin: Vec3,
    pub(super) direction: Vec3,
    pub(super) reciprocal: Vec3,
    /// Index in [`WideNode::bounds`] of the near side of each axis, `i` or `i + 3`; the other is the far side.
    near: [usize; 3],
}

impl Ray {
    #[inline(always)]
    pub(crate) fn new(origin: Vec3, direction: Vec3) -> Self {
        // Components too small to divide by are replaced by ±TINY.
        const TINY: f32 = 1.0e-12;
        let safe = |x: f32| if x.abs() < TINY { if x >= 0.0 { TINY } else { -TINY } } else { x };
        let reciprocal = 1.0 / Vec3::new(safe(direction.x), safe(direction.y), safe(direction.z));
        let near = |axis: usize| if reciprocal[axis] < 0.0 { axis + 3 } else { axis };
        Self { origin, direction, reciprocal, near: [near(0), near(1), near(2)] }
    }
}

/// A crossing of a ray.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Crossing {
    /// Distance, mm.
    pub(crate) t: f32,
    /// Triangle in leaf order.
    pub(crate) triangle: u32,
    /// Whether the ray enters the surface there.
    pub(crate) enters: bool,
}

/// Orders crossings by distance, then by triangle.
pub(in crate::host) fn by_distance(a: &Crossing, b: &Crossing) -> std::cmp::Ordering {
    a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle))
}

/// The nearest crossing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Nearest {
    pub(crate) crossing: Crossing,
    /// Whether other crossings may lie within [`TOUCH_MM`] of it.
    pub(crate) crowded: bool,
}

/// The greater of two numbers, in one instruction; NaN is not handled.
#[inline(always)]
pub(super) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The smaller of two numbers, in one instruction; NaN is not handled.
#[inline(always)]
pub(super) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Distance to a triangle, mm, and whether the ray enters its surface; `None` if the ray misses.
#[inline(always)]
pub(super) fn intersect(triangle: &PackedTriangle, ray: &Ray) -> Option<(f32, bool)> {
    let (t, hit, enters) = intersection(triangle, ray.origin, ray.direction);
    hit.then_some((t, enters))
}

/// Bit mask of the children that the ray meets from `first` to `last`. `near` receives the entry distances, mm.
#[inline(always)]
pub(super) fn boxes(node: &WideNode, ray: &Ray, first: f32, last: f32, near: &mut [f32; WIDTH]) -> u32 {
    let bounds = &node.bounds;
    let [x, y, z] = ray.near;
    let side = |i: usize| &bounds[i];
    let (near_x, near_y, near_z) = (side(x), side(y), side(z));
    let (far_x, far_y, far_z) = (side(3 - x), side(5 - y), side(7 - z));
    let mut mask = 0;
    for i in 0..WIDTH {
        let from = max(
            max((near_x[i] - ray.origin.x) * ray.reciprocal.x, (near_y[i] - ray.origin.y) * ray.reciprocal.y),
            max((near_z[i] - ray.origin.z) * ray.reciprocal.z, first),
        );
        let to = min(
            min((far_x[i] - ray.origin.x) * ray.reciprocal.x, (far_y[i] - ray.origin.y) * ray.reciprocal.y),
            min((far_z[i] - ray.origin.z) * ray.reciprocal.z, last),
        );
        near[i] = from;
        mask |= u32::from(from <= to + 1.0e-4) << i;
    }
    mask
}

/// Slack of box tests for rounded products, mm: 10⁻⁶ of the distance plus 1 µm.
#[inline(always)]
pub(super) fn slack(t_min: f32, t_max: f32) -> f32 {
    1.0e-3 + 1.0e-6 * max(t_min.abs(), t_max.abs())
}

/// Range of a leaf's triangles.
#[inline(always)]
pub(super) fn leaf(child: u32) -> std::ops::Range<usize> {
    let first = ((child & !LEAF) >> 2) as usize;
    first..first + (child & 3) as usize
}

/// Prefetches the memory of a child that will be visited.
#[inline(always)]
pub(super) fn prefetch_child(tree: &Tree<'_>, child: u32) {
    if child & LEAF == 0 {
        prefetch(&tree.nodes[child as usize]);
    } else {
        prefetch(&tree.triangles[leaf(child)]);
    }
}

/// Collects every crossing in (t_min, t_max], in tree order. Returns the number stored in `into` and the number lost.
#[inline(always)]
pub(crate) fn collect(
    tree: &Tree<'_>,
    ray: &Ray,
    t_min: f32,
    t_max: f32,
    stack: &mut Stack,
    into: &mut [Crossing],
) -> (usize, u32) {
    let stack = &mut stack.0;
    stack[0].1 = 0;
    let mut depth = 1;
    let mut near = [0.0; WIDTH];
    let reach = slack(t_min, t_max);
    let (mut count, mut lost) = (0, 0);
    while depth > 0 {
        depth -= 1;
        let child = stack[depth].1;
        if child & LEAF == 0 {
            let node = &tree.nodes[child as usize];
            let mut mask = boxes(node, ray, t_min - reach, t_max + reach, &mut near);
            while mask != 0 {
                let slot = (mask.trailing_zeros() & 7) as usize;
                mask &= mask - 1;
                // Child 0 marks an empty slot, since the root is no child. NaN rays meet empty slots, too.
                if node.children[slot] != 0 {
                    stack[depth].1 = node.children[slot];
                    depth += 1;
                }
            }
            continue;
        }
        for index in leaf(child) {
            let Some((t, enters)) = intersect(&tree.triangles[index], ray) else { continue };
            if t > t_min && t <= t_max {
                match into.get_mut(count) {
                    Some(slot) => {
                        *slot = Crossing { t, triangle: index as u32, enters };
                        count += 1;
                    }
                    None => lost += 1,
                }
            }
        }
    }
    (count, lost)
}
