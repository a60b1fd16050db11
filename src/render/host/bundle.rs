//! Follows neighbouring paths at once: they look for their next crossings together, and meet their interfaces together.

use super::arrivals::Arrivals;
use super::packet::{Packet, RAYS, Visits};
use super::path::{Boundary, CROSSINGS_BEHIND, PathRecord, Place, Scene};
use super::search::{Covered, collect, nearest};
use super::traverse::{Crossing, Ray};
use super::walk::Walk;

/// The records of a bundle's paths, and the memory that following them needs.
#[derive(Debug)]
pub(super) struct Bundle {
    pub(super) records: [PathRecord; RAYS],
    walks: [Walk; RAYS],
    packet: Packet,
    visits: Visits,
    covered: [Covered; RAYS],
    behind: [[Crossing; CROSSINGS_BEHIND]; RAYS],
    place: Place,
    arrivals: Arrivals,
    /// Path and boundary of each arrival.
    boundaries: [(usize, Boundary); RAYS],
}

impl Bundle {
    /// Paths of a bundle.
    pub(super) const PATHS: usize = RAYS;

    pub(super) fn new() -> Self {
        Self {
            records: std::array::from_fn(|_| PathRecord::new()),
            walks: [Walk::default(); RAYS],
            packet: Packet::new(),
            visits: Visits::new(),
            covered: [Covered::new(); RAYS],
            behind: [[Crossing::default(); CROSSINGS_BEHIND]; RAYS],
            place: Place::new(),
            arrivals: Arrivals::new(),
            boundaries: [(0, Boundary::default()); RAYS],
        }
    }

    /// Follows `count` paths from `first` on into the first records; how many crossings and segments found no room.
    #[inline(always)]
    pub(super) fn follow(&mut self, scene: &Scene<'_>, first: usize, count: usize) -> u32 {
        let Self { records, walks, packet, visits, covered, behind, place, arrivals, boundaries } = self;
        let count = count.min(RAYS);
        packet.clear();
        for (lane, walk) in walks[..count].iter_mut().enumerate() {
            *walk = scene.begin(first + lane);
            packet.set(lane, Ray::new(walk.origin, walk.direction), -scene.back_mm(), 0.0);
        }
        let (found, mut lost) = collect(&scene.tree, packet, visits, behind.each_mut().map(|lane| &mut lane[..]));
        for (lane, (walk, record)) in walks[..count].iter_mut().zip(records.iter_mut()).enumerate() {
            scene.locate(walk, &mut behind[lane][..found[lane]], record);
        }
        loop {
            packet.clear();
            let mut highest = [0; RAYS];
            for (lane, walk) in walks[..count].iter().enumerate() {
                highest[lane] = Scene::highest(walk);
                let left_mm = scene.left_mm(walk);
                if left_mm > 0.0 {
                    packet.set(lane, Ray::new(walk.origin, walk.direction), walk.t_min, left_mm);
                }
            }
            if packet.is_empty() {
                break;
            }
            let ahead = nearest(&scene.tree, packet, visits, &highest, covered);
            arrivals.clear();
            for (lane, walk) in walks[..count].iter_mut().enumerate() {
                let Some(found) = ahead[lane] else {
                    walk.end();
                    continue;
                };
                if let Some(boundary) = scene.advance(walk, found, &mut covered[lane], place) {
                    boundaries[arrivals.len()] = (lane, boundary);
                    arrivals.push(&scene.arrival(walk, &boundary));
                }
            }
            if arrivals.len() > 0 {
                arrivals.depart(scene);
            }
            for (i, (lane, boundary)) in boundaries[..arrivals.len()].iter().enumerate() {
                scene.depart(&mut walks[*lane], boundary, &arrivals.departure(i), &mut records[*lane]);
            }
        }
        for (walk, record) in walks[..count].iter().zip(records.iter_mut()) {
            scene.end(record);
            lost += walk.lost;
        }
        lost
    }
}
