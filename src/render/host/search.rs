//! Crossings of a packet's rays: `shaders/shared/collect.wgsl`, and `nearest.wgsl` except for surfaces below the
//! medium. Each ray finds the same crossings as if traced alone.

use super::constants::TOUCH_MM;
use super::lanes::RAYS;
use super::packet::{Packet, Visits, traverse};
use super::traverse::{Crossing, Nearest, Tree, by_distance};

/// Nearest crossing of each ray in (t_min, t_max]. Crossings of surfaces below the ray's entry in `highest` go to
/// `covered`, unsorted. It holds all of those up to [`TOUCH_MM`] beyond the nearest crossing, and maybe farther ones.
#[inline(always)]
pub(super) fn nearest(
    tree: &Tree<'_>,
    packet: &Packet,
    visits: &mut Visits,
    highest: &[u32; RAYS],
    covered: &mut [Covered; RAYS],
) -> [Option<Nearest>; RAYS] {
    let mut nearest: [Option<Nearest>; RAYS] = [None; RAYS];
    covered.iter_mut().for_each(Covered::clear);
    traverse(tree, packet, visits, |lane, t, triangle, enters| {
        let mut crossing = Crossing { t, triangle, enters };
        let so_far = &mut nearest[lane];
        let beyond = so_far.map_or(packet.t_max[lane], |n| n.crossing.t);
        if tree.triangles[triangle as usize].surface < highest[lane] {
            if t > beyond + TOUCH_MM {
                return beyond;
            }
            // A crossing without room counts as any other.
            match covered[lane].push(crossing) {
                None => return beyond,
                Some(other) => crossing = other,
            }
        }
        let t = crossing.t;
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

/// Crossings of a ray that do not change the medium: those of surfaces below the medium's.
#[derive(Debug, Clone, Copy)]
pub(super) struct Covered {
    crossings: [Crossing; Self::MOST],
    count: usize,
}

impl Covered {
    /// Capacity. A path in fat has about ten.
    const MOST: usize = 16;

    pub(super) fn new() -> Self {
        Self { crossings: [Crossing::default(); Self::MOST], count: 0 }
    }

    fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds a crossing. If there is no room, returns the farthest, so the result doesn't depend on the order of calls.
    #[inline(always)]
    fn push(&mut self, crossing: Crossing) -> Option<Crossing> {
        if let Some(slot) = self.crossings.get_mut(self.count) {
            *slot = crossing;
            self.count += 1;
            return None;
        }
        let farthest = self.crossings.iter_mut().max_by(|a, b| by_distance(a, b))?;
        let nearer = by_distance(&crossing, farthest).is_lt();
        Some(if nearer { std::mem::replace(farthest, crossing) } else { crossing })
    }

    /// Crossings up to `t`, sorted by distance.
    #[inline(always)]
    pub(super) fn up_to(&mut self, t: f32) -> &[Crossing] {
        let all = &mut self.crossings[..self.count];
        all.sort_unstable_by(by_distance);
        &all[..all.partition_point(|c| c.t <= t)]
    }
}

/// Collects every crossing of each ray in (t_min, t_max], unsorted. Returns the number stored per ray, and the number
/// lost for lack of room in `into`. Which ones are lost depends on the other rays.
#[inline(always)]
pub(super) fn collect(
    tree: &Tree<'_>,
    packet: &Packet,
    visits: &mut Visits,
    into: [&mut [Crossing]; RAYS],
) -> ([usize; RAYS], u32) {
    let (mut counts, mut lost) = ([0; RAYS], 0);
    traverse(tree, packet, visits, |lane, t, triangle, enters| {
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
    use glam::Vec3;

    use super::*;
    use crate::anatomy::analytic::{self, Part};
    use crate::anatomy::{Bvh, TissueTable};
    use crate::render::host::traverse::{self, Ray, Stack};
    use crate::render::host::tree::WideNode;
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

    /// A ray of packet `trial`: neighbours differ by `spread` in mm and slope. Every fifth packet follows an axis.
    fn ray(trial: u32, lane: u32, spread: f32) -> Ray {
        let number = |dim| sample_unit(11, trial, 0, 0, dim) as f32 - 0.5;
        let own = |dim| spread * (sample_unit(12, trial, lane, 0, dim) as f32 - 0.5);
        let origin = Vec3::new(20.0 * number(0) + 10.0 * own(0), 6.0 * number(1) + 3.0 * own(1), 10.0 * number(2));
        let slopes = Vec3::new(number(3) + own(3), number(4) + own(4), 1.0);
        let direction = if trial.is_multiple_of(5) { Vec3::Z } else { slopes.normalize() };
        // In some packets, rays go both ways, or the axes are permuted.
        let back = if trial.is_multiple_of(11) { lane % 2 == 1 } else { trial.is_multiple_of(7) };
        let direction = if back { -direction } else { direction };
        Ray::new(
            origin,
            if trial.is_multiple_of(13) { Vec3::new(direction.z, direction.x, direction.y) } else { direction },
        )
    }

    #[test]
    fn each_ray_of_a_packet_finds_what_it_finds_alone() {
        let bvh = bvh();
        let nodes: Vec<_> = bvh.nodes.iter().map(WideNode::decode).collect();
        let tree = Tree { nodes: &nodes, triangles: &bvh.triangles };
        let mut packet = Packet::new();
        let mut covered = [Covered::new(); RAYS];
        let (mut crossings, mut crowds, mut nothing, mut below) = (0, 0, 0, 0);
        for trial in 0..2000u32 {
            // From identical rays to unrelated ones.
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
            // Some rays are inside none, some inside one of the five.
            let highest = std::array::from_fn(|lane| (trial + lane as u32) % 5);
            let first = nearest(&tree, &packet, &mut Visits::new(), &highest, &mut covered);
            assert_eq!(lost, 0);
            for lane in 0..RAYS {
                let mut alone = [Crossing::default(); 64];
                let single = ray(trial, lane as u32, spread);
                let count = match on(lane) {
                    true => traverse::collect(&tree, &single, t_min, t_max, &mut Stack::new(), &mut alone).0,
                    false => 0,
                };
                alone[..count].sort_by(by_distance);
                together[lane][..counts[lane]].sort_by(by_distance);
                assert_eq!(together[lane][..counts[lane]], alone[..count], "ray {lane} of packet {trial}");
                crossings += count;
                let surface = |c: &Crossing| tree.triangles[c.triangle as usize].surface;
                let (under, over): (Vec<_>, Vec<_>) =
                    alone[..count].iter().copied().partition(|c| surface(c) < highest[lane]);
                assert_eq!(first[lane].map(|n| n.crossing.t), over.first().map(|c| c.t));
                let Some(first) = first[lane] else {
                    nothing += 1;
                    continue;
                };
                let to = first.crossing.t + TOUCH_MM;
                let near = over.iter().filter(|c| c.t <= to).count();
                assert!(first.crowded || near == 1, "ray {lane} of packet {trial}");
                crowds += u32::from(near > 1);
                let under = &under[..under.partition_point(|c| c.t <= to)];
                assert_eq!(covered[lane].up_to(to), under, "ray {lane} of packet {trial}");
                below += under.len();
            }
        }
        // The packets cover enough of every case.
        let enough = crossings > 10_000 && crowds > 100 && nothing > 100 && below > 1000;
        assert!(enough, "{crossings}, {crowds}, {nothing}, {below}");
    }

    #[test]
    fn covered_crossings_without_room_count_as_any_other() {
        // Twelve spheres one inside another: 24 crossings.
        let part = |i: i32| {
            let mesh = analytic::sphere(Vec3::new(0.0, 0.0, 30.0), 25.0 - 2.0 * i as f32, 3);
            Part { name: "part", tissue: "muscle", priority: i, mesh }
        };
        let scene = analytic::scene((0..12).map(part).collect(), &TissueTable::builtin().unwrap(), "liver").unwrap();
        let bvh = Bvh::build(&scene).unwrap();
        let nodes: Vec<_> = bvh.nodes.iter().map(WideNode::decode).collect();
        let tree = Tree { nodes: &nodes, triangles: &bvh.triangles };
        let (mut packet, mut covered) = (Packet::new(), [Covered::new(); RAYS]);
        // The scene's middle is the origin.
        let single = Ray::new(Vec3::new(0.4, 0.3, -35.0), Vec3::Z);
        packet.set(0, single, 0.0, 70.0);
        let mut all = [Crossing::default(); 24];
        assert_eq!(traverse::collect(&tree, &single, 0.0, 70.0, &mut Stack::new(), &mut all), (24, 0));
        all.sort_by(by_distance);
        let found = nearest(&tree, &packet, &mut Visits::new(), &[12; RAYS], &mut covered)[0].unwrap();
        assert_eq!((found.crossing, covered[0].up_to(found.crossing.t)), (all[Covered::MOST], &all[..Covered::MOST]));
        // Within the eighth sphere, crossings of the outer seven are covered and have room.
        let found = nearest(&tree, &packet, &mut Visits::new(), &[7; RAYS], &mut covered)[0].unwrap();
        assert_eq!((found.crossing, covered[0].up_to(found.crossing.t)), (all[7], &all[..7]));
    }

    #[test]
    fn a_ray_that_is_not_a_number_ends() {
        let bvh = bvh();
        let nodes: Vec<_> = bvh.nodes.iter().map(WideNode::decode).collect();
        let tree = Tree { nodes: &nodes, triangles: &bvh.triangles };
        let mut covered = [Covered::new(); RAYS];
        // One ray is apart from the others, so bounds without it would miss its crossings.
        let x_mm = |lane: usize| if lane == 0 { -9.0 } else { 2.0 + 0.1 * lane as f32 };
        let other = |lane: usize| Ray::new(Vec3::new(x_mm(lane), 1.0, -40.0), Vec3::Z);
        // Whichever lane is NaN, the others find the same as alone.
        for stray in 0..RAYS {
            let mut packet = Packet::new();
            packet.set(stray, Ray::new(Vec3::NAN, Vec3::NAN), 0.0, 70.0);
            assert_eq!(nearest(&tree, &packet, &mut Visits::new(), &[0; RAYS], &mut covered), [None; RAYS]);
            let others = || (0..RAYS).filter(|&lane| lane != stray);
            others().for_each(|lane| packet.set(lane, other(lane), 0.0, 70.0));
            let found = nearest(&tree, &packet, &mut Visits::new(), &[0; RAYS], &mut covered);
            assert_eq!(found[stray], None);
            for lane in others() {
                let mut alone = [Crossing::default(); 16];
                let count = traverse::collect(&tree, &other(lane), 0.0, 70.0, &mut Stack::new(), &mut alone).0;
                let first = alone[..count].iter().map(|c| c.t).reduce(f32::min);
                assert!(first.is_some() && found[lane].map(|n| n.crossing.t) == first, "{lane} beside {stray}");
            }
        }
        let mut found = [Crossing::default(); 8];
        let single = Ray::new(Vec3::NAN, Vec3::NAN);
        assert_eq!(traverse::collect(&tree, &single, 0.0, 70.0, &mut Stack::new(), &mut found), (0, 0));
    }
}
