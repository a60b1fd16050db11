//! Sixteen rays that go much the same way, through the tree at once: `shaders/shared/{nearest,collect}.wgsl`. Each finds what it
//! finds alone.

use glam::Vec3;

use super::traverse::{
    Crossing, Nearest, Ray, Stack, TOUCH_MM, Tree, boxes, intersect, intersection, leaf, max, min, slack,
};
use super::tree::{LEAF, WIDTH};
use crate::anatomy::bvh::PackedTriangle;

/// Rays of a packet.
pub(super) const RAYS: usize = 16;
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

/// The lanes whose bits are set.
#[inline(always)]
fn lanes(mut of: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = (of != 0).then(|| (of.trailing_zeros() % RAYS as u32) as usize)?;
        of &= of - 1;
        Some(lane)
    })
}

/// One number of all lanes: by halves, as registers do it.
#[inline(always)]
fn fold(mut of: Lanes, pick: fn(f32, f32) -> f32) -> f32 {
    let mut half = RAYS / 2;
    while half > 0 {
        for i in 0..half {
            of[i] = pick(of[i], of[i + half]);
        }
        half /= 2;
    }
    of[0]
}

/// Which rays meet each child of a node, and where the first of them enters it.
struct Met {
    near: [f32; WIDTH],
    rays: [u32; WIDTH],
}

/// Tests a node's boxes with the rays of `rays`.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "several arrays go together")]
fn meet(tree: &Tree<'_>, node: u32, packet: &Packet, rays: u32, first: &Lanes, last: &Lanes) -> Met {
    let node = &tree.nodes[node as usize];
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
        met.near[slot] = fold(enters, min);
    }
    met
}

/// Where each ray of a packet meets the triangle, which do, and which enter there, a bit each.
#[inline(always)]
fn intersections(triangle: &PackedTriangle, packet: &Packet, t: &mut Lanes) -> (u32, u32) {
    let (mut hits, mut entering) = (0, 0);
    for lane in 0..RAYS {
        let vector = |of: &[Lanes; 3]| Vec3::new(of[0][lane], of[1][lane], of[2][lane]);
        let (at, hit, enters) = intersection(triangle, vector(&packet.origin), vector(&packet.direction));
        t[lane] = at;
        hits |= u32::from(hit) << lane;
        entering |= u32::from(enters) << lane;
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
    let mut farthest = fold(last, max);
    let mut depth = 0;
    let mut visit = Visit { near: 0.0, child: 0, rays: packet.on };
    loop {
        if visit.child & LEAF == 0 {
            let met = meet(tree, visit.child, packet, visit.rays, &first, &last);
            let bottom = depth;
            for slot in 0..WIDTH {
                let child = tree.nodes[visit.child as usize].children[slot];
                // The root is nobody's child: a ray that is not a number meets what is missing, too.
                if met.rays[slot] == 0 || child == 0 {
                    continue;
                }
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
                    for lane in lanes(visit.rays) {
                        if let Some((t, enters)) = intersect(triangle, &packet.single[lane]) {
                            note(lane, t, enters);
                        }
                    }
                    continue;
                }
                let mut t = [0.0; RAYS];
                let (hits, entering) = intersections(triangle, packet, &mut t);
                for lane in lanes(hits & visit.rays) {
                    note(lane, t[lane], entering >> lane & 1 != 0);
                }
            }
            if shorter {
                farthest = fold(last, max);
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

/// Every crossing of each ray in (t_min, t_max], in no order, those that `into` has no room for lost: how many each ray has, and
/// how many are lost. Where some are lost, which ones depends on the other rays.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::analytic::{self, Part};
    use crate::anatomy::{Bvh, TissueTable};
    use crate::render::native::{traverse, tree::WideNode};
    use crate::render::twin::hash::sample_unit;

    /// Spheres that overlap, one inside another, and cuboids that share a face.
    fn bvh() -> Bvh {
        let sphere = |x: f32, z: f32, radius| analytic::sphere(Vec3::new(x, 0.0, z), radius, 3);
        let cuboid = |x: f32| analytic::cuboid(Vec3::new(x, -4.0, 30.0), Vec3::new(x + 8.0, 4.0, 50.0));
        let meshes =
            [sphere(0.0, 20.0, 12.0), sphere(0.0, 20.0, 5.0), sphere(9.0, 26.0, 9.0), cuboid(-8.0), cuboid(0.0)];
        let part = |(i, mesh)| Part { name: "part", tissue: "muscle", priority: i as i32, mesh };
        let parts = meshes.into_iter().enumerate().map(part).collect();
        Bvh::build(&analytic::scene(parts, &TissueTable::builtin().unwrap(), "liver").unwrap()).unwrap()
    }

    /// A ray of packet `trial`: neighbours by a spread of mm and of slope; now and then along an axis.
    fn ray(trial: u32, lane: u32, spread: f32) -> Ray {
        let number = |dim| sample_unit(11, trial, 0, 0, dim) as f32 - 0.5;
        let own = |dim| spread * (sample_unit(12, trial, lane, 0, dim) as f32 - 0.5);
        let origin = Vec3::new(20.0 * number(0) + 10.0 * own(0), 6.0 * number(1) + 3.0 * own(1), 10.0 * number(2));
        let slopes = Vec3::new(number(3) + own(3), number(4) + own(4), 1.0);
        let direction = if trial.is_multiple_of(5) { Vec3::Z } else { slopes.normalize() };
        Ray::new(origin, if trial.is_multiple_of(7) { -direction } else { direction })
    }

    #[test]
    fn each_ray_of_a_packet_finds_what_it_finds_alone() {
        let bvh = bvh();
        let nodes: Vec<_> = bvh.nodes.iter().map(WideNode::decode).collect();
        let tree = Tree { nodes: &nodes, triangles: &bvh.triangles };
        let mut packet = Packet::new();
        let (mut crossings, mut crowds, mut nothing) = (0, 0, 0);
        for trial in 0..2000u32 {
            // From rays that are one to rays that go anywhere.
            let spread = [0.0, 0.01, 0.2, 2.0][trial as usize % 4];
            let (t_min, t_max) = if trial.is_multiple_of(3) { (-40.0, 0.0) } else { (1.0e-3, 70.0) };
            packet.clear();
            let on = |lane: usize| sample_unit(13, trial, lane as u32, 0, 0) < [0.2, 0.6, 1.0][trial as usize % 3];
            for lane in (0..RAYS).filter(|&lane| on(lane)) {
                packet.set(lane, ray(trial, lane as u32, spread), t_min, t_max);
            }
            let mut together = [[Crossing::default(); 64]; RAYS];
            let into = together.each_mut().map(|lane| &mut lane[..]);
            let (counts, lost) = collect(&tree, &packet, &mut Visits::new(), into);
            let first = nearest(&tree, &packet, &mut Visits::new());
            assert_eq!(lost, 0);
            for lane in 0..RAYS {
                let mut alone = [Crossing::default(); 64];
                let single = ray(trial, lane as u32, spread);
                let count = match on(lane) {
                    true => traverse::collect(&tree, &single, t_min, t_max, &mut Stack::new(), &mut alone).0,
                    false => 0,
                };
                let by_place = |a: &Crossing, b: &Crossing| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle));
                alone[..count].sort_by(by_place);
                together[lane][..counts[lane]].sort_by(by_place);
                assert_eq!(together[lane][..counts[lane]], alone[..count], "ray {lane} of packet {trial}");
                assert_eq!(first[lane].map(|n| n.crossing.t), alone[..count].first().map(|c| c.t));
                crossings += count;
                match first[lane] {
                    None => nothing += 1,
                    Some(first) => {
                        let near = alone[..count].iter().filter(|c| c.t <= alone[0].t + TOUCH_MM).count();
                        assert!(first.crowded || near == 1, "ray {lane} of packet {trial}");
                        crowds += u32::from(near > 1);
                    }
                }
            }
        }
        // There was something to find, and something to get wrong.
        assert!(crossings > 10_000 && crowds > 100 && nothing > 100, "{crossings}, {crowds}, {nothing}");
    }

    #[test]
    fn a_ray_that_is_not_a_number_ends() {
        let bvh = bvh();
        let nodes: Vec<_> = bvh.nodes.iter().map(WideNode::decode).collect();
        let tree = Tree { nodes: &nodes, triangles: &bvh.triangles };
        let mut packet = Packet::new();
        packet.set(3, Ray::new(Vec3::NAN, Vec3::NAN), 0.0, 70.0);
        assert_eq!(nearest(&tree, &packet, &mut Visits::new()), [None; RAYS]);
        let mut found = [Crossing::default(); 8];
        let single = Ray::new(Vec3::NAN, Vec3::NAN);
        assert_eq!(traverse::collect(&tree, &single, 0.0, 70.0, &mut Stack::new(), &mut found), (0, 0));
    }
}
