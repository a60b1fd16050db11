//! Follows a bundle of neighbouring paths: finds their crossings together, and computes their interfaces together.

use super::depart::depart;
use super::interface_batch::InterfaceBatch;
use super::lanes::RAYS;
use super::packet::{Packet, Visits};
use super::path::{Boundary, CROSSINGS_BEHIND, PathRecord, Place, Scene};
use super::path_state::PathState;
use super::search::{Covered, collect, nearest};
use super::traverse::{Crossing, Ray};

/// Records of a bundle's paths, and working memory.
#[derive(Debug)]
pub(super) struct Bundle {
    pub(super) records: [PathRecord; RAYS],
    states: [PathState; RAYS],
    packet: Packet,
    visits: Visits,
    covered: [Covered; RAYS],
    behind: [[Crossing; CROSSINGS_BEHIND]; RAYS],
    place: Place,
    batch: InterfaceBatch,
    /// Path and boundary of each arrival.
    boundaries: [(usize, Boundary); RAYS],
}

impl Bundle {
    /// Paths per bundle.
    pub(super) const PATHS: usize = RAYS;

    pub(super) fn new() -> Self {
        Self {
            records: std::array::from_fn(|_| PathRecord::new()),
            states: [PathState::default(); RAYS],
            packet: Packet::new(),
            visits: Visits::new(),
            covered: [Covered::new(); RAYS],
            behind: [[Crossing::default(); CROSSINGS_BEHIND]; RAYS],
            place: Place::new(),
            batch: InterfaceBatch::new(),
            boundaries: [(0, Boundary::default()); RAYS],
        }
    }

    /// Follows `count` paths from `first` on into the first records. Returns the number of crossings lost.
    #[inline(always)]
    pub(super) fn follow(&mut self, scene: &Scene<'_>, first: usize, count: usize) -> u32 {
        let Self { records, states, packet, visits, covered, behind, place, batch, boundaries } = self;
        let count = count.min(RAYS);
        packet.clear();
        for (lane, state) in states[..count].iter_mut().enumerate() {
            *state = scene.begin(first + lane);
            packet.set(lane, Ray::new(state.origin, state.direction), -scene.back_mm(), 0.0);
        }
        let (found, mut lost) = collect(&scene.tree, packet, visits, behind.each_mut().map(|lane| &mut lane[..]));
        for (lane, (state, record)) in states[..count].iter_mut().zip(records.iter_mut()).enumerate() {
            scene.locate(state, &mut behind[lane][..found[lane]], record);
        }
        loop {
            packet.clear();
            let mut highest = [0; RAYS];
            for (lane, state) in states[..count].iter().enumerate() {
                highest[lane] = Scene::highest(state);
                let left_mm = scene.left_mm(state);
                if left_mm > 0.0 {
                    packet.set(lane, Ray::new(state.origin, state.direction), state.t_min, left_mm);
                }
            }
            if packet.is_empty() {
                break;
            }
            let ahead = nearest(&scene.tree, packet, visits, &highest, covered);
            batch.clear();
            for (lane, state) in states[..count].iter_mut().enumerate() {
                let Some(found) = ahead[lane] else {
                    // No crossing ahead.
                    state.open = false;
                    continue;
                };
                if let Some(boundary) = scene.advance(state, found, &mut covered[lane], place) {
                    boundaries[batch.len()] = (lane, boundary);
                    batch.push(&scene.arrival(state, &boundary));
                }
            }
            if batch.len() > 0 {
                depart(&batch.arrivals, &mut batch.departures, scene.rules());
            }
            for (i, (lane, boundary)) in boundaries[..batch.len()].iter().enumerate() {
                scene.depart(&mut states[*lane], boundary, &batch.departure(i), &mut records[*lane]);
            }
        }
        for (state, record) in states[..count].iter().zip(records.iter_mut()) {
            scene.end(record);
            lost += state.lost;
        }
        lost
    }
}
