//! Crossings of a packet's rays, as in `shaders/shared/collect.wgsl`. The nearest one is chosen as in `nearest.wgsl`,
//! except that crossings of surfaces below the medium's (of lower index) are listed separately. Each ray finds the same
//! crossings as if traced alone.

use super::packet::{Packet, Visits, crossings};
use super::traverse::{Crossing, Nearest, Tree, by_distance};
use crate::host::constants::TOUCH_MM;
use crate::host::lanes::RAYS;

/// Search of a ray for its nearest crossing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Search {
    t_max: f32,
    /// The nearest crossing so far.
    pub(super) nearest: Option<Nearest>,
}

impl Search {
    #[inline(always)]
    pub(super) fn new(t_max: f32) -> Self {
        Self { t_max, nearest: None }
    }

    /// Remaining search distance, mm.
    #[inline(always)]
    pub(super) fn reach_mm(&self) -> f32 {
        self.nearest.map_or(self.t_max, |nearest| nearest.crossing.t)
    }

    /// Adds a crossing, in any order. If its surface is `below` the medium's, it goes to `covered`.
    #[inline(always)]
    pub(super) fn add(&mut self, mut crossing: Crossing, below: bool, covered: &mut Covered) {
        if below {
            if crossing.t > self.reach_mm() + TOUCH_MM {
                return;
            }
            // A crossing without room in `covered` counts as if it changed the medium.
            match covered.push(crossing) {
                None => return,
                Some(other) => crossing = other,
            }
        }
        let t = crossing.t;
        match self.nearest {
            None if t <= self.t_max => self.nearest = Some(Nearest { crossing, crowded: false }),
            Some(before) if t <= before.crossing.t + TOUCH_MM => {
                self.nearest = Some(Nearest {
                    crossing: if t < before.crossing.t { crossing } else { before.crossing },
                    crowded: t >= before.crossing.t - TOUCH_MM,
                });
            }
            _ => {}
        }
    }
}

/// Crossings of a ray with surfaces below the medium's: they don't change the medium.
#[derive(Debug, Clone, Copy)]
pub(super) struct Covered {
    crossings: [Crossing; Self::MOST],
    count: usize,
}

impl Covered {
    /// Capacity. A path in fat has about ten.
    pub(super) const MOST: usize = 16;

    pub(super) fn new() -> Self {
        Self { crossings: [Crossing::default(); Self::MOST], count: 0 }
    }

    pub(super) fn clear(&mut self) {
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
/// lost for lack of room in `into`. The other rays affect which crossings are lost.
#[inline(always)]
pub(in crate::host) fn collect(
    tree: &Tree<'_>,
    packet: &Packet,
    visits: &mut Visits,
    into: [&mut [Crossing]; RAYS],
) -> ([usize; RAYS], u32) {
    let (mut counts, mut lost) = ([0; RAYS], 0);
    crossings(tree, packet, visits, |lane, t, triangle, enters| match into[lane].get_mut(counts[lane]) {
        Some(slot) => {
            *slot = Crossing { t, triangle, enters };
            counts[lane] += 1;
        }
        None => lost += 1,
    });
    (counts, lost)
}

#[cfg(test)]
pub(super) mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::{self, Part};
    use insonify_core::anatomy::{Bvh, TissueTable};

    use super::*;
    use crate::host::trace::traverse::{self, Ray, Stack};
    use crate::host::trace::tree::WideNode;
    use crate::twin::hash::sample_unit;

    /// Spheres that overlap, one inside another and one twice, and cuboids that share a face.
    pub(in crate::host::trace) fn bvh() -> Bvh {
        let sphere = |x: f32, z: f32, radius| analytic::sphere(Vec3::new(x, 0.0, z), radius, 3);
        let cuboid = |x: f32| analytic::cuboid(Vec3::new(x, -4.0, 30.0), Vec3::new(x + 8.0, 4.0, 50.0));
        built(vec![
            sphere(0.0, 20.0, 12.0),
            sphere(0.0, 20.0, 5.0),
            sphere(0.0, 20.0, 5.0),
            sphere(9.0, 26.0, 9.0),
            cuboid(-8.0),
            cuboid(0.0),
        ])
    }

    /// Tree of meshes, each with a higher priority than the previous one.
    pub(in crate::host::trace) fn built(meshes: Vec<insonify_core::anatomy::Mesh>) -> Bvh {
        let part = |(i, mesh)| Part { name: "part", tissue: "muscle", priority: i as i32, mesh };
        let parts = meshes.into_iter().enumerate().map(part).collect();
        Bvh::build(&analytic::scene(parts, &TissueTable::builtin().unwrap(), "liver").unwrap()).unwrap()
    }

    /// A ray of packet `trial`: neighbours differ by `spread` in mm and slope. Every fifth packet follows an axis.
    pub(in crate::host::trace) fn ray(trial: u32, lane: u32, spread: f32) -> Ray {
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

    /// Crossings of a ray, by a search of its own, sorted.
    pub(in crate::host::trace) fn alone(tree: &Tree<'_>, ray: &Ray, [t_min, t_max]: [f32; 2]) -> Vec<Crossing> {
        let mut found = [Crossing::default(); 64];
        let (count, lost) = traverse::collect(tree, ray, t_min, t_max, &mut Stack::new(), &mut found);
        assert_eq!(lost, 0);
        found[..count].sort_by(by_distance);
        found[..count].to_vec()
    }

    #[test]
    fn each_ray_of_a_packet_finds_what_it_finds_alone() {
        let bvh = bvh();
        let nodes: Vec<_> = bvh.nodes.iter().map(WideNode::decode).collect();
        let tree = Tree { nodes: &nodes, triangles: &bvh.triangles };
        let mut packet = Packet::new();
        let mut crossings = 0;
        for trial in 0..2000u32 {
            // Spreads from identical rays to unrelated rays.
            let spread = [0.0, 0.01, 0.2, 2.0][trial as usize % 4];
            let range = if trial.is_multiple_of(3) { [-40.0, 0.0] } else { [1.0e-3, 70.0] };
            packet.clear();
            let on = |lane: usize| sample_unit(13, trial, lane as u32, 0, 0) < [0.2, 0.6, 1.0][trial as usize % 3];
            for lane in (0..RAYS).filter(|&lane| on(lane)) {
                packet.set(lane, ray(trial, lane as u32, spread), range[0], range[1]);
            }
            let mut together = [[Crossing::default(); 64]; RAYS];
            let into = together.each_mut().map(|lane| &mut lane[..]);
            let (counts, lost) = collect(&tree, &packet, &mut Visits::new(), into);
            assert_eq!(lost, 0);
            for lane in 0..RAYS {
                let expected =
                    if on(lane) { alone(&tree, &ray(trial, lane as u32, spread), range) } else { Vec::new() };
                together[lane][..counts[lane]].sort_by(by_distance);
                assert_eq!(together[lane][..counts[lane]], expected, "ray {lane} of packet {trial}");
                crossings += expected.len();
            }
        }
        assert!(crossings > 10_000, "{crossings}");
    }

    #[test]
    fn a_ray_that_is_not_a_number_finds_nothing_and_hides_nothing() {
        let bvh = bvh();
        let nodes: Vec<_> = bvh.nodes.iter().map(WideNode::decode).collect();
        let tree = Tree { nodes: &nodes, triangles: &bvh.triangles };
        // One ray is apart from the others, so bounds without it would miss its crossings.
        let x_mm = |lane: usize| if lane == 0 { -9.0 } else { 2.0 + 0.1 * lane as f32 };
        let other = |lane: usize| Ray::new(Vec3::new(x_mm(lane), 1.0, -40.0), Vec3::Z);
        // Whichever lane is NaN, the other lanes find the same crossings as alone.
        for stray in 0..RAYS {
            let mut packet = Packet::new();
            packet.set(stray, Ray::new(Vec3::NAN, Vec3::NAN), 0.0, 70.0);
            let others = || (0..RAYS).filter(|&lane| lane != stray);
            others().for_each(|lane| packet.set(lane, other(lane), 0.0, 70.0));
            let mut found = [[Crossing::default(); 16]; RAYS];
            let into = found.each_mut().map(|lane| &mut lane[..]);
            let (counts, _) = collect(&tree, &packet, &mut Visits::new(), into);
            assert_eq!(counts[stray], 0);
            for lane in others() {
                found[lane][..counts[lane]].sort_by(by_distance);
                let expected = alone(&tree, &other(lane), [0.0, 70.0]);
                assert!(!expected.is_empty());
                assert_eq!(found[lane][..counts[lane]], expected, "{lane} with {stray}");
            }
        }
        let mut found = [Crossing::default(); 8];
        let single = Ray::new(Vec3::NAN, Vec3::NAN);
        assert_eq!(traverse::collect(&tree, &single, 0.0, 70.0, &mut Stack::new(), &mut found), (0, 0));
    }
}
