//! Traversal of the tree by a packet of similar rays.

use std::ops::Range;

use glam::Vec3;
use insonify_core::anatomy::bvh::PackedTriangle;

use super::packet_bounds::PacketBounds;
use super::ray_triangle::intersection;
use super::traverse::{Ray, Stack, Tree, boxes, intersect, leaf, max, min, prefetch_child, slack};
use super::tree::{LEAF, WIDTH, WideNode};
use crate::host::lanes::{Lanes, RAYS, bits, fold};

/// Greatest number of rays that are tested one by one. At a node, each ray is tested against the node's eight boxes at
/// once; at a leaf, against every triangle.
const FEW_AT_A_NODE: u32 = 4;
const FEW_AT_A_LEAF: u32 = 2;

/// Lanes that are tested together, if any of them is needed.
const GROUP: usize = 8;

/// Whether none of `rays` is in a group of lanes.
#[inline(always)]
fn idle(rays: u32, group: usize) -> bool {
    rays >> (group * GROUP) & ((1 << GROUP) - 1) == 0
}

/// Rays as a structure of arrays. Lanes that are not `on` find nothing.
#[derive(Debug)]
pub(in crate::host) struct Packet {
    origin: [Lanes; 3],
    direction: [Lanes; 3],
    reciprocal: [Lanes; 3],
    t_min: Lanes,
    pub(super) t_max: Lanes,
    single: [Ray; RAYS],
    /// One bit per lane: whether it holds a ray.
    on: u32,
}

impl Packet {
    pub(in crate::host) fn new() -> Self {
        Self {
            origin: [[0.0; RAYS]; 3],
            direction: [[0.0; RAYS]; 3],
            reciprocal: [[0.0; RAYS]; 3],
            t_min: [0.0; RAYS],
            t_max: [0.0; RAYS],
            single: [Ray::new(Vec3::ZERO, Vec3::Z); RAYS],
            on: 0,
        }
    }

    /// Removes all rays.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.on = 0;
    }

    #[inline(always)]
    fn origin(&self, lane: usize) -> Vec3 {
        Vec3::new(self.origin[0][lane], self.origin[1][lane], self.origin[2][lane])
    }

    #[inline(always)]
    fn direction(&self, lane: usize) -> Vec3 {
        Vec3::new(self.direction[0][lane], self.direction[1][lane], self.direction[2][lane])
    }

    /// Adds a ray that searches for crossings in (t_min, t_max].
    #[inline(always)]
    pub(in crate::host) fn set(&mut self, lane: usize, ray: Ray, t_min: f32, t_max: f32) {
        for axis in 0..3 {
            self.origin[axis][lane] = ray.origin[axis];
            self.direction[axis][lane] = ray.direction[axis];
            self.reciprocal[axis][lane] = ray.reciprocal[axis];
        }
        (self.t_min[lane], self.t_max[lane]) = (t_min, t_max);
        self.single[lane] = ray;
        self.on |= 1 << lane;
    }
}

/// Pending visit of a packet: a lower bound of the entry distance, a child, and a mask of the rays that meet it.
#[derive(Debug, Clone, Copy)]
struct Visit {
    near: f32,
    child: u32,
    rays: u32,
}

/// Memory for the pending visits of a packet.
#[derive(Debug)]
pub(in crate::host) struct Visits([Visit; Stack::DEPTH]);

impl Visits {
    pub(in crate::host) fn new() -> Self {
        Self([Visit { near: 0.0, child: 0, rays: 0 }; Stack::DEPTH])
    }
}

/// Mask of the rays that meet each child of a node, and a lower bound of their entry distances.
struct Met {
    near: [f32; WIDTH],
    rays: [u32; WIDTH],
}

/// Tests a node's boxes against `rays`. If there are many, only boxes that the packet's bounds meet between the
/// distances `ends` are tested.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "several arrays go together")]
fn meet(
    node: &WideNode,
    (packet_bounds, ends): (&PacketBounds, [f32; 2]),
    packet: &Packet,
    rays: u32,
    first: &Lanes,
    last: &Lanes,
) -> Met {
    let mut met = Met { near: [f32::INFINITY; WIDTH], rays: [0; WIDTH] };
    if rays.count_ones() <= FEW_AT_A_NODE {
        for lane in bits(rays) {
            let mut near = [0.0; WIDTH];
            let hit = boxes(node, &packet.single[lane], first[lane], last[lane], &mut near);
            for slot in 0..WIDTH {
                let hits = hit >> slot & 1;
                met.rays[slot] |= hits << lane;
                met.near[slot] = if hits != 0 { min(met.near[slot], near[slot]) } else { met.near[slot] };
            }
        }
        return met;
    }
    let bounds = &node.bounds;
    let mut slots = packet_bounds.meets(node, ends, &mut met.near);
    while slots != 0 {
        let slot = (slots.trailing_zeros() & 7) as usize;
        slots &= slots - 1;
        let mut hits = 0;
        for group in 0..RAYS / GROUP {
            if idle(rays, group) {
                continue;
            }
            for i in 0..GROUP {
                let lane = group * GROUP + i;
                let plane = |side: usize, axis: usize| {
                    (bounds[3 * side + axis][slot] - packet.origin[axis][lane]) * packet.reciprocal[axis][lane]
                };
                let (x0, x1) = (plane(0, 0), plane(1, 0));
                let (y0, y1) = (plane(0, 1), plane(1, 1));
                let (z0, z1) = (plane(0, 2), plane(1, 2));
                let from = max(max(min(x0, x1), min(y0, y1)), max(min(z0, z1), first[lane]));
                let to = min(min(max(x0, x1), max(y0, y1)), min(max(z0, z1), last[lane]));
                let hit = from <= to + 1.0e-4;
                hits |= u32::from(hit) << lane;
            }
        }
        met.rays[slot] = hits & rays;
    }
    met
}

/// Intersects a packet with a triangle: distances go to `t`. Returns two bit masks: rays that hit in (t_min, t_max],
/// and rays that enter the surface. The masks may include rays that are not in `rays`.
#[inline(always)]
fn intersections(triangle: &PackedTriangle, packet: &Packet, rays: u32, t: &mut Lanes) -> (u32, u32) {
    let (mut hits, mut entering) = (0, 0);
    for group in 0..RAYS / GROUP {
        if idle(rays, group) {
            continue;
        }
        for i in 0..GROUP {
            let lane = group * GROUP + i;
            let (at, hit, enters) = intersection(triangle, packet.origin(lane), packet.direction(lane));
            t[lane] = at;
            hits |= u32::from(hit & (at > packet.t_min[lane]) & (at <= packet.t_max[lane])) << lane;
            entering |= u32::from(enters) << lane;
        }
    }
    (hits, entering)
}

/// Calls `found(lane, t, triangle, enters)` for every crossing of `rays` with the triangles of a leaf.
#[inline(always)]
fn meet_leaf(
    tree: &Tree<'_>,
    packet: &Packet,
    triangles: Range<usize>,
    rays: u32,
    found: &mut impl FnMut(usize, f32, u32, bool),
) {
    for index in triangles {
        let triangle = &tree.triangles[index];
        if rays.count_ones() <= FEW_AT_A_LEAF {
            for lane in bits(rays) {
                if let Some((t, enters)) = intersect(triangle, &packet.single[lane])
                    && t > packet.t_min[lane]
                    && t <= packet.t_max[lane]
                {
                    found(lane, t, index as u32, enters);
                }
            }
            continue;
        }
        let mut t = [0.0; RAYS];
        let (hits, entering) = intersections(triangle, packet, rays, &mut t);
        for lane in bits(hits & rays) {
            found(lane, t[lane], index as u32, entering >> lane & 1 != 0);
        }
    }
}

/// Traverses the tree, and calls `found(lane, t, triangle, enters)` for every crossing of the packet's rays.
#[inline(always)]
pub(super) fn crossings(
    tree: &Tree<'_>,
    packet: &Packet,
    visits: &mut Visits,
    mut found: impl FnMut(usize, f32, u32, bool),
) {
    let visits = &mut visits.0;
    let (mut first, mut last) = ([0.0; RAYS], [0.0; RAYS]);
    for lane in 0..RAYS {
        let on = packet.on >> lane & 1 != 0;
        let reach = slack(packet.t_min[lane], packet.t_max[lane]);
        first[lane] = if on { packet.t_min[lane] - reach } else { f32::INFINITY };
        last[lane] = if on { packet.t_max[lane] + reach } else { f32::NEG_INFINITY };
    }
    let ends = [fold(first, min), fold(last, max)];
    let rays = [&packet.origin, &packet.direction, &packet.reciprocal];
    let packet_bounds = PacketBounds::new(rays, packet.on, ends);
    let mut depth = 0;
    let mut visit = Visit { near: 0.0, child: 0, rays: packet.on };
    loop {
        if visit.child & LEAF == 0 {
            let node = &tree.nodes[visit.child as usize];
            let met = meet(node, (&packet_bounds, ends), packet, visit.rays, &first, &last);
            let bottom = depth;
            for slot in 0..WIDTH {
                let child = node.children[slot];
                // Child 0 marks an empty slot, since the root is no child. NaN rays meet empty slots, too.
                if met.rays[slot] == 0 || child == 0 {
                    continue;
                }
                prefetch_child(tree, child);
                let entry = Visit { near: met.near[slot], child, rays: met.rays[slot] };
                // Sorted with the nearest on top, so that crossings are found in about their order.
                let mut at = depth;
                while at > bottom && visits[at - 1].near < entry.near {
                    visits[at] = visits[at - 1];
                    at -= 1;
                }
                visits[at] = entry;
                depth += 1;
            }
        } else {
            meet_leaf(tree, packet, leaf(visit.child), visit.rays, &mut found);
        }
        if depth == 0 {
            return;
        }
        depth -= 1;
        visit = visits[depth];
    }
}
