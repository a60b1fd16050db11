//! Follows sixteen neighbouring paths at once: they look for their next crossings together, and go on each by itself.

use super::packet::{Packet, RAYS, Visits, collect, nearest};
use super::path::{CROSSINGS_BEHIND, PathRecord, Place, Scene};
use super::traverse::{Crossing, Ray};
use super::walk::Walk;

/// The records of a bundle's paths, and the memory that following them needs.
#[derive(Debug)]
pub(super) struct Bundle {
    pub(super) records: [PathRecord; RAYS],
    walks: [Walk; RAYS],
    packet: Packet,
    visits: Visits,
    behind: [[Crossing; CROSSINGS_BEHIND]; RAYS],
    place: Place,
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
            behind: [[Crossing::default(); CROSSINGS_BEHIND]; RAYS],
            place: Place::new(),
        }
    }

    /// Follows `count` paths from `first` on into the first records; how many crossings and segments found no room.
    #[inline(always)]
    pub(super) fn follow(&mut self, scene: &Scene<'_>, first: usize, count: usize) -> u32 {
        let Self { records, walks, packet, visits, behind, place } = self;
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
            for (lane, walk) in walks[..count].iter().enumerate() {
                let left_mm = scene.left_mm(walk);
                if left_mm > 0.0 {
                    packet.set(lane, Ray::new(walk.origin, walk.direction), walk.t_min, left_mm);
                }
            }
            if packet.is_empty() {
                break;
            }
            let found = nearest(&scene.tree, packet, visits);
            for (lane, (walk, record)) in walks[..count].iter_mut().zip(records.iter_mut()).enumerate() {
                match found[lane] {
                    Some(found) => scene.advance(walk, found, place, record),
                    None => walk.end(),
                }
            }
        }
        for (walk, record) in walks[..count].iter().zip(records.iter_mut()) {
            scene.end(record);
            lost += walk.lost;
        }
        lost
    }
}
