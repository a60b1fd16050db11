//! Eight rays that go much the same way, through the tree at once: each finds what `traverse` finds for it alone.

use glam::Vec3;

use super::traverse::{Crossing, Nearest, Ray, Stack, TOUCH_MM, Tree, boxes, intersect, leaf, max, min, slack};
use super::tree::{LEAF, WIDTH};
use crate::anatomy::bvh::PackedTriangle;

/// Rays of a packet.
pub(super) const RAYS: usize = 8;
/// One number of each ray.
type Lanes = [f32; RAYS];

/// Up to so many rays are tested one by one: with eight boxes of a node at once, with one triangle at a time.
const FEW_AT_A_NODE: u32 = 4;
const FEW_AT_A_LEAF: u32 = 2;

/// Rays, a number of each side by side. Those that are not `on` find nothing.
#[derive(Debug)]
pub(super) struct Packet {
    origin: [Lanes; 3],
    direction: [Lanes; 3],
    reciprocal: [Lanes; 3],
    t_min: Lanes,
    t_max: Lanes,
    single: [Ray; RAYS],
    /// A bit each.
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

    /// Takes all rays out.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        self.on = 0;
    }

    /// Whether no ray is in it.
    #[inline(always)]
    pub(super) fn is_empty(&self) -> bool {
        self.on == 0
    }

    /// Puts a ray in, which looks for crossings in (t_min, t_max].
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

/// What a packet has still to visit: where its first ray enters, a child, and which rays meet it.
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

#[inline(always)]
fn least(of: &Lanes) -> f32 {
    let half = |i: usize| min(of[i], of[i + 4]);
    min(min(half(0), half(2)), min(half(1), half(3)))
}

#[inline(always)]
fn greatest(of: &Lanes) -> f32 {
    let half = |i: usize| max(of[i], of[i + 4]);
    max(max(half(0), half(2)), max(half(1), half(3)))
}

/// Which rays meet each child of a node, and where the first of them enters it.
struct Met {
    near: [f32; WIDTH],
    rays: [u32; WIDTH],
}

/// Tests a node's boxes with the rays of `rays`.
#[inline(always)]
fn meet(tree: &Tree<'_>, node: u32, packet: &Packet, rays: u32, first: &Lanes, last: &Lanes) -> Met {
    let node = &tree.nodes[node as usize];
    let mut met = Met { near: [f32::INFINITY; WIDTH], rays: [0; WIDTH] };
    if rays.count_ones() <= FEW_AT_A_NODE {
        let mut left = rays;
        while left != 0 {
            let lane = (left.trailing_zeros() & 7) as usize;
            left &= left - 1;
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
    for slot in 0..WIDTH {
        // A missing child.
        if bounds[0][slot] > bounds[3][slot] {
            continue;
        }
        let mut enters = [0.0f32; RAYS];
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
            enters[lane] = if hit { from } else { f32::INFINITY };
            hits |= u32::from(hit) << lane;
        }
        met.rays[slot] = hits & rays;
        met.near[slot] = least(&enters);
    }
    met
}

/// `traverse::intersect` of eight rays: where each meets the triangle, whether it enters there, and which do, a bit each.
#[inline(always)]
fn intersections(triangle: &PackedTriangle, packet: &Packet, t: &mut Lanes) -> (u32, u32) {
    let (edge1, edge2) = (triangle.edge1, triangle.edge2);
    let (mut hits, mut entering) = (0, 0);
    for lane in 0..RAYS {
        let vector = |of: &[Lanes; 3]| Vec3::new(of[0][lane], of[1][lane], of[2][lane]);
        let (origin, direction) = (vector(&packet.origin), vector(&packet.direction));
        let (edge1, edge2) = (Vec3::from(edge1), Vec3::from(edge2));
        let to_corner = Vec3::from(triangle.corner) - origin;
        let t0 = to_corner.dot(direction);
        let s = direction * t0 - to_corner;
        let p = direction.cross(edge2);
        let determinant = edge1.dot(p);
        let magnitude = determinant.abs();
        let side = if determinant >= 0.0 { 1.0 } else { -1.0 };
        let q = s.cross(edge1);
        let u = s.dot(p) * side;
        let v = direction.dot(q) * side;
        let tolerance = triangle.tolerance * (t0.abs() + 100.0);
        let hit =
            (magnitude > 2.0 * tolerance) & (u >= -tolerance) & (v >= -tolerance) & (u + v <= magnitude + tolerance);
        t[lane] = t0 + edge2.dot(q) * side / max(magnitude, 1.0e-30);
        hits |= u32::from(hit) << lane;
        entering |= u32::from(determinant > 0.0) << lane;
    }
    (hits, entering)
}

/// Goes through the tree, and calls `found(lane, t, triangle, enters)` for every crossing in its leaves; it returns how far
/// that ray still looks.
#[inline(always)]
fn walk(tree: &Tree<'_>, packet: &Packet, visits: &mut Visits, mut found: impl FnMut(usize, f32, u32, bool) -> f32) {
    let visits = &mut visits.0;
    let (mut first, mut last, mut reach) = ([0.0; RAYS], [0.0; RAYS], [0.0; RAYS]);
    for lane in 0..RAYS {
        let on = packet.on >> lane & 1 != 0;
        reach[lane] = slack(packet.t_min[lane], packet.t_max[lane]);
        first[lane] = packet.t_min[lane] - reach[lane];
        last[lane] = if on { packet.t_max[lane] + reach[lane] } else { f32::NEG_INFINITY };
    }
    let mut farthest = greatest(&last);
    let mut depth = 0;
    let mut visit = Visit { near: 0.0, child: 0, rays: packet.on };
    loop {
        if visit.child & LEAF == 0 {
            let met = meet(tree, visit.child, packet, visit.rays, &first, &last);
            let bottom = depth;
            for slot in 0..WIDTH {
                if met.rays[slot] == 0 {
                    continue;
                }
                let child = tree.nodes[visit.child as usize].children[slot];
                let entry = Visit { near: met.near[slot], child, rays: met.rays[slot] };
                // Nearest on top.
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
                let mut note = |lane: usize, t: f32, enters: bool| {
                    if t > packet.t_min[lane] {
                        last[lane] = found(lane, t, index as u32, enters) + reach[lane];
                        shorter = true;
                    }
                };
                if visit.rays.count_ones() <= FEW_AT_A_LEAF {
                    let mut left = visit.rays;
                    while left != 0 {
                        let lane = (left.trailing_zeros() & 7) as usize;
                        left &= left - 1;
                        if let Some((t, enters)) = intersect(triangle, &packet.single[lane]) {
                            note(lane, t, enters);
                        }
                    }
                    continue;
                }
                let mut t = [0.0; RAYS];
                let (hits, entering) = intersections(triangle, packet, &mut t);
                let mut left = hits & visit.rays;
                while left != 0 {
                    let lane = (left.trailing_zeros() & 7) as usize;
                    left &= left - 1;
                    note(lane, t[lane], entering >> lane & 1 != 0);
                }
            }
            if shorter {
                farthest = greatest(&last);
            }
        }
        // What lies beyond what every ray has found is passed over.
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

/// The nearest crossing of each ray in (t_min, t_max].
#[inline(always)]
pub(super) fn nearest(tree: &Tree<'_>, packet: &Packet, visits: &mut Visits) -> [Option<Nearest>; RAYS] {
    let mut nearest: [Option<Nearest>; RAYS] = [None; RAYS];
    walk(tree, packet, visits, |lane, t, triangle, enters| {
        let crossing = Crossing { t, triangle, enters };
        let so_far = &mut nearest[lane];
        match *so_far {
            None if t <= packet.t_max[lane] => *so_far = Some(Nearest { crossing, crowded: false }),
            Some(before) if t <= before.crossing.t + TOUCH_MM => {
                *so_far = Some(Nearest {
                    crossing: if t < before.crossing.t { crossing } else { before.crossing },
                    crowded: t >= before.crossing.t - TOUCH_MM,
                });
            }
            _ => {}
        }
        so_far.map_or(packet.t_max[lane], |n| n.crossing.t)
    });
    nearest
}

/// Every crossing of each ray in (t_min, t_max], in the order of the tree, those beyond `into` lost: how many each ray
/// has, and how many are lost.
#[inline(always)]
pub(super) fn collect(
    tree: &Tree<'_>,
    packet: &Packet,
    visits: &mut Visits,
    into: [&mut [Crossing]; RAYS],
) -> ([usize; RAYS], u32) {
    let (mut counts, mut lost) = ([0; RAYS], 0);
    walk(tree, packet, visits, |lane, t, triangle, enters| {
        if t <= packet.t_max[lane] {
            match into[lane].get_mut(counts[lane]) {
                Some(slot) => {
                    *slot = Crossing { t, triangle, enters };
                    counts[lane] += 1;
                }
                None => lost += 1,
            }
        }
        packet.t_max[lane]
    });
    (counts, lost)
}
