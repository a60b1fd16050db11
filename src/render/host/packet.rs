//! Traversal of the tree by a packet of similar rays.

use glam::Vec3;

use super::hull::Hull;
use super::lanes::{Lanes, RAYS, fold};
use super::traverse::{Ray, Stack, Tree, boxes, intersect, intersection, leaf, max, min, slack};
use super::tree::{LEAF, WIDTH, WideNode};
use crate::anatomy::bvh::PackedTriangle;

/// Most rays that are tested one by one: at a node against its eight boxes at once, at a leaf against each triangle.
const FEW_AT_A_NODE: u32 = 4;
const FEW_AT_A_LEAF: u32 = 2;

/// Rays as a structure of arrays. Lanes that are not `on` find nothing.
#[derive(Debug)]
pub(super) struct Packet {
    origin: [Lanes; 3],
    direction: [Lanes; 3],
    reciprocal: [Lanes; 3],
    t_min: Lanes,
    pub(super) t_max: Lanes,
    single: [Ray; RAYS],
    /// One bit per lane.
    on: u32,
}

impl Packet {
    pub(super) fn new() -> Self {
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

    /// Whether it has no ray.
    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.on == 0
    }

    /// Adds a ray that searches for crossings in (t_min, t_max].
    #[inline(always)]
    pub(super) fn set(&mut self, lane: usize, ray: Ray, t_min: f32, t_max: f32) {
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

/// The visits of a packet.
#[derive(Debug)]
pub(super) struct Visits([Visit; Stack::DEPTH]);

impl Visits {
    pub(super) fn new() -> Self {
        Self([Visit { near: 0.0, child: 0, rays: 0 }; Stack::DEPTH])
    }
}

/// Lanes whose bits are set.
#[inline(always)]
fn lanes(mut of: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (of != 0).then(|| (of.trailing_zeros() % RAYS as u32) as usize)?;
        of &= of - 1;
        Some(lane)
    })
}

/// Mask of the rays that meet each child of a node, and a lower bound of their entry distances.
struct Met {
    near: [f32; WIDTH],
    rays: [u32; WIDTH],
}

/// Tests a node's boxes against `rays`. With many rays, only boxes that the packet's `hull` meets are tested.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "several arrays go together")]
fn meet(
    node: &WideNode,
    hull: impl FnOnce(&mut [f32; WIDTH]) -> u32,
    packet: &Packet,
    rays: u32,
    first: &Lanes,
    last: &Lanes,
) -> Met {
    let mut met = Met { near: [f32::INFINITY; WIDTH], rays: [0; WIDTH] };
    if rays.count_ones() <= FEW_AT_A_NODE {
        for lane in lanes(rays) {
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
    let mut slots = hull(&mut met.near);
    while slots != 0 {
        let slot = (slots.trailing_zeros() & 7) as usize;
        slots &= slots - 1;
        let mut hits = 0;
        for lane in 0..RAYS {
            let plane = |side: usize, axis: usize| {
                (bounds[side + axis][slot] - packet.origin[axis][lane]) * packet.reciprocal[axis][lane]
            };
            let (x0, x1) = (plane(0, 0), plane(3, 0));
            let (y0, y1) = (plane(0, 1), plane(3, 1));
            let (z0, z1) = (plane(0, 2), plane(3, 2));
            let from = max(max(min(x0, x1), min(y0, y1)), max(min(z0, z1), first[lane]));
            let to = min(min(max(x0, x1), max(y0, y1)), min(max(z0, z1), last[lane]));
            let hit = from <= to + 1.0e-4;
            hits |= u32::from(hit) << lane;
        }
        met.rays[slot] = hits & rays;
    }
    met
}

/// Intersects a packet with a triangle: distances go to `t`. Returns bit masks of the rays that hit in
/// (t_min, `last`], and of those that enter the surface.
#[inline(always)]
fn intersections(triangle: &PackedTriangle, packet: &Packet, last: &Lanes, t: &mut Lanes) -> (u32, u32) {
    let (mut hits, mut entering) = (0, 0);
    for lane in 0..RAYS {
        let vector = |of: &[Lanes; 3]| Vec3::new(of[0][lane], of[1][lane], of[2][lane]);
        let (at, hit, enters) = intersection(triangle, vector(&packet.origin), vector(&packet.direction));
        t[lane] = at;
        hits |= u32::from(hit & (at > packet.t_min[lane]) & (at <= last[lane])) << lane;
        entering |= u32::from(enters) << lane;
    }
    (hits, entering)
}

/// Traverses the tree, and calls `found(lane, t, triangle, enters)` for every crossing in its leaves. `found` returns
/// the remaining search distance of that ray.
#[inline(always)]
pub(super) fn traverse(
    tree: &Tree<'_>,
    packet: &Packet,
    visits: &mut Visits,
    mut found: impl FnMut(usize, f32, u32, bool) -> f32,
) {
    let visits = &mut visits.0;
    let (mut first, mut last, mut reach) = ([0.0; RAYS], [0.0; RAYS], [0.0; RAYS]);
    for lane in 0..RAYS {
        let on = packet.on >> lane & 1 != 0;
        reach[lane] = slack(packet.t_min[lane], packet.t_max[lane]);
        first[lane] = if on { packet.t_min[lane] - reach[lane] } else { f32::INFINITY };
        last[lane] = if on { packet.t_max[lane] + reach[lane] } else { f32::NEG_INFINITY };
    }
    let mut farthest = fold(last, max);
    let soonest = fold(first, min);
    let hull = Hull::new([&packet.origin, &packet.direction, &packet.reciprocal], packet.on, [soonest, farthest]);
    let mut depth = 0;
    let mut visit = Visit { near: 0.0, child: 0, rays: packet.on };
    loop {
        if visit.child & LEAF == 0 {
            let node = &tree.nodes[visit.child as usize];
            let met = meet(node, |near| hull.meets(node, [soonest, farthest], near), packet, visit.rays, &first, &last);
            let bottom = depth;
            for slot in 0..WIDTH {
                let child = node.children[slot];
                // Child 0 is missing, since the root is no child; a NaN ray meets missing ones, too.
                if met.rays[slot] == 0 || child == 0 {
                    continue;
                }
                let entry = Visit { near: met.near[slot], child, rays: met.rays[slot] };
                // Sorted with the nearest on top.
                let mut at = depth;
                while at > bottom && visits[at - 1].near < entry.near {
                    visits[at] = visits[at - 1];
                    at -= 1;
                }
                visits[at] = entry;
                depth += 1;
            }
        } else {
            let mut shorter = false;
            for index in leaf(visit.child) {
                let triangle = &tree.triangles[index];
                if visit.rays.count_ones() <= FEW_AT_A_LEAF {
                    for lane in lanes(visit.rays) {
                        if let Some((t, enters)) = intersect(triangle, &packet.single[lane])
                            && t > packet.t_min[lane]
                        {
                            last[lane] = found(lane, t, index as u32, enters) + reach[lane];
                            shorter = true;
                        }
                    }
                    continue;
                }
                let mut t = [0.0; RAYS];
                let (hits, entering) = intersections(triangle, packet, &last, &mut t);
                for lane in lanes(hits & visit.rays) {
                    last[lane] = found(lane, t[lane], index as u32, entering >> lane & 1 != 0) + reach[lane];
                    shorter = true;
                }
            }
            if shorter {
                farthest = fold(last, max);
            }
        }
        // Children beyond the crossings that all rays have found are skipped.
        loop {
            if depth == 0 {
                return;
            }
            depth -= 1;
            if visits[depth].near <= farthest + 1.0e-4 {
                visit = visits[depth];
                break;
            }
        }
    }
}
