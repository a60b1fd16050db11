//! Follows a bundle of neighbouring paths: finds their crossings together, and computes their interfaces together.

use super::depart::depart;
use super::interface_batch::InterfaceBatch;
use super::lanes::RAYS;
use super::packet::{Packet, Visits};
use super::path::{Boundary, CROSSINGS_BEHIND, LastSegment, PathRecord, Place, Scene};
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
    /// Crossings behind the face, and just before it.
    near: [[Crossing; CROSSINGS_BEHIND]; RAYS],
    place: Place,
    batch: InterfaceBatch,
    /// Path and boundary of each arrival.
    boundaries: [(usize, Boundary); RAYS],
    /// First reflection of each path.
    forks: [Option<Fork>; RAYS],
}

/// First reflection of a path, which its guide passes.
#[derive(Debug, Clone, Copy)]
struct Fork {
    /// State on arrival.
    state: PathState,
    boundary: Boundary,
    last: LastSegment,
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
            near: [[Crossing::default(); CROSSINGS_BEHIND]; RAYS],
            place: Place::new(),
            batch: InterfaceBatch::new(),
            boundaries: [(0, Boundary::default()); RAYS],
            forks: [None; RAYS],
        }
    }

    /// Follows up to [`Bundle::PATHS`] paths into the first records. Returns the number of crossings lost.
    #[inline(always)]
    pub(super) fn follow(&mut self, scene: &Scene<'_>, paths: impl ExactSizeIterator<Item = usize>) -> u32 {
        let Self { records, states, packet, visits, near, forks, .. } = self;
        let count = paths.len().min(RAYS);
        packet.clear();
        for (lane, (state, path)) in states[..count].iter_mut().zip(paths).enumerate() {
            *state = scene.begin(path);
            packet.set(lane, Ray::new(state.origin, state.direction), -scene.back_mm(), scene.film_reach_mm(state));
        }
        let (found, lost) = collect(&scene.tree, packet, visits, near.each_mut().map(|lane| &mut lane[..]));
        for (lane, (state, record)) in states[..count].iter_mut().zip(records.iter_mut()).enumerate() {
            scene.locate(state, &mut near[lane][..found[lane]], record);
        }
        forks.fill(None);
        lost + self.go_on(scene, count)
    }

    /// Follows guides from where the paths of the last [`Bundle::follow`] reflected; their records replace those of the
    /// paths. Returns the number of crossings lost.
    #[inline(always)]
    pub(super) fn follow_guides(&mut self, scene: &Scene<'_>, count: usize) -> u32 {
        self.batch.clear();
        for (lane, fork) in self.forks.iter().enumerate() {
            let Some(fork) = fork else { continue };
            let (state, record) = (&mut self.states[lane], &mut self.records[lane]);
            *state = PathState { guide: true, lost: 0, ..fork.state };
            record.reopen(&fork.last);
            self.boundaries[self.batch.len()] = (lane, fork.boundary);
            self.batch.push(&scene.arrival(state, &fork.boundary));
        }
        self.depart(scene);
        self.go_on(scene, count)
    }

    /// Follows open paths to their ends.
    #[inline(always)]
    fn go_on(&mut self, scene: &Scene<'_>, count: usize) -> u32 {
        loop {
            let Self { states, packet, visits, covered, place, batch, boundaries, .. } = self;
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
            self.depart(scene);
        }
        let ended = self.states[..count].iter_mut().zip(self.records.iter_mut());
        ended
            .map(|(state, record)| {
                scene.end(record);
                std::mem::take(&mut state.lost)
            })
            .sum()
    }

    /// Continues the paths of the batch beyond their interfaces.
    #[inline(always)]
    fn depart(&mut self, scene: &Scene<'_>) {
        let Self { records, states, batch, boundaries, forks, .. } = self;
        if batch.len() == 0 {
            return;
        }
        depart(&batch.arrivals, &mut batch.departures, scene.rules());
        for (i, &(lane, boundary)) in boundaries[..batch.len()].iter().enumerate() {
            let (state, record, departure) = (&mut states[lane], &mut records[lane], batch.departure(i));
            if departure.reflected && !state.diverted && scene.params.single() {
                forks[lane] = Some(Fork { state: *state, boundary, last: record.last() });
            }
            scene.depart(state, &boundary, &departure, record);
        }
    }
}
