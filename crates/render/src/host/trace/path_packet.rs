//! Follows a packet of neighbouring paths: finds their crossings together, and computes their interfaces together.

use std::ops::Range;

use super::interface_batch::InterfaceBatch;
use super::interface_response::depart;
use super::line_crossings::{self, LineCrossings};
use super::packet::{Packet, Visits};
use super::path::{CROSSINGS_BEHIND, Coincident, MediumChange, NextInterface, Scene};
use super::path_record::{LastSegment, PathRecord};
use super::path_state::PathState;
use super::search::Covered;
use super::stream::Stream;
use super::traverse::{Crossing, Ray};
use crate::host::lanes::{RAYS, bits};

/// Records of a packet's paths, and working memory.
#[derive(Debug)]
pub(super) struct PathPacket {
    records: [PathRecord; RAYS],
    /// Lane that holds each path.
    lanes: [usize; RAYS],
    states: [PathState; RAYS],
    packet: Packet,
    visits: Visits,
    stream: Stream,
    lines: [LineCrossings; RAYS],
    covered: [Covered; RAYS],
    /// Per ray: surface crossings from behind the face to the reach of the gel film in front.
    near: [[Crossing; CROSSINGS_BEHIND]; RAYS],
    coincident: Coincident,
    batch: InterfaceBatch,
    /// Lane and change of medium of each path in `batch`.
    changes: [(usize, MediumChange); RAYS],
    /// First reflection of each path, from which its axial path goes on; `None` without one.
    forks: [Option<Fork>; RAYS],
}

/// First reflection of a path. The axial path passes that interface.
#[derive(Debug, Clone, Copy)]
struct Fork {
    /// State on arrival.
    state: PathState,
    change: MediumChange,
    last: LastSegment,
}

impl PathPacket {
    /// Paths per packet.
    pub(super) const PATHS: usize = RAYS;

    pub(super) fn new() -> Self {
        Self {
            records: std::array::from_fn(|_| PathRecord::new()),
            lanes: [0; RAYS],
            states: [PathState::default(); RAYS],
            packet: Packet::new(),
            visits: Visits::new(),
            stream: Stream::new(),
            lines: [LineCrossings::new(); RAYS],
            covered: [Covered::new(); RAYS],
            near: [[Crossing::default(); CROSSINGS_BEHIND]; RAYS],
            coincident: Coincident::new(),
            batch: InterfaceBatch::new(),
            changes: [(0, MediumChange::default()); RAYS],
            forks: [None; RAYS],
        }
    }

    /// Follows up to [`PathPacket::PATHS`] paths. Returns the number of crossings lost.
    #[inline(always)]
    pub(super) fn follow(&mut self, scene: &Scene<'_>, paths: Range<usize>) -> u32 {
        let count = paths.len().min(RAYS);
        // Lanes are in elevational order, so that neighbouring lanes meet the same boxes.
        let mut order: [(f32, usize); RAYS] = std::array::from_fn(|i| (0.0, i));
        for (across_mm, i) in &mut order[..count] {
            *across_mm = scene.across_mm(paths.start + *i);
        }
        order[..count].sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (lane, &(_, path)) in order.iter().enumerate() {
            self.lanes[path] = lane;
        }
        let Self { records, states, packet, visits, lines, near, forks, .. } = self;
        packet.clear();
        let (mut near_mm, mut length_mm) = ([0.0; RAYS], [0.0_f32; RAYS]);
        for (lane, (state, &(_, path))) in states[..count].iter_mut().zip(&order).enumerate() {
            *state = scene.begin(paths.start + path);
            (near_mm[lane], length_mm[lane]) = (scene.film_reach_mm(state), scene.line_mm(state));
            let farthest = length_mm[lane].max(near_mm[lane]);
            packet.set(lane, Ray::new(state.origin, state.direction), -scene.back_mm(), farthest);
        }
        let mut into = near.each_mut().map(|lane| &mut lane[..]);
        let (found, lost) =
            line_crossings::collect(&scene.tree, packet, visits, lines, &length_mm, &mut into, &near_mm);
        for (lane, (state, record)) in states[..count].iter_mut().zip(records.iter_mut()).enumerate() {
            scene.locate(state, &mut near[lane][..found[lane]], record);
        }
        forks.fill(None);
        lost + self.go_on(scene, count)
    }

    /// Records of the first `count` paths, in their order.
    pub(super) fn records(&self, count: usize) -> impl Iterator<Item = &PathRecord> {
        self.lanes[..count].iter().map(|&lane| &self.records[lane])
    }

    /// Follows axial paths from the first reflections of the last [`PathPacket::follow`]. Their records replace the
    /// paths' records. Returns the number of crossings lost.
    #[inline(always)]
    pub(super) fn follow_axial_paths(&mut self, scene: &Scene<'_>, count: usize) -> u32 {
        self.batch.clear();
        for (lane, fork) in self.forks.iter().enumerate() {
            let Some(fork) = fork else { continue };
            let (state, record) = (&mut self.states[lane], &mut self.records[lane]);
            *state = PathState { is_axial: true, lost: 0, ..fork.state };
            record.reopen(&fork.last);
            self.changes[self.batch.len()] = (lane, fork.change);
            self.batch.push(&scene.arrival(state, &fork.change));
        }
        self.depart(scene);
        self.go_on(scene, count)
    }

    /// Follows open paths to their ends.
    #[inline(always)]
    fn go_on(&mut self, scene: &Scene<'_>, count: usize) -> u32 {
        // One bit for each path that waits for a search. Waiting paths search together: the more there are, the less
        // each waits for memory.
        let mut waiting = 0_u32;
        loop {
            let Self { states, stream, lines, covered, coincident, batch, changes, .. } = self;
            batch.clear();
            for (lane, state) in states[..count].iter_mut().enumerate() {
                if waiting >> lane & 1 != 0 {
                    continue;
                }
                match scene.go_straight(state, &lines[lane]) {
                    NextInterface::At(change) => {
                        changes[batch.len()] = (lane, change);
                        batch.push(&scene.arrival(state, &change));
                    }
                    NextInterface::Unknown => waiting |= 1 << lane,
                    NextInterface::None => {}
                }
            }
            if batch.len() == 0 {
                if waiting == 0 {
                    break;
                }
                for lane in bits(waiting) {
                    let state = &states[lane];
                    let range = [state.t_min, scene.left_mm(state)];
                    stream.set(lane, Ray::new(state.origin, state.direction), range, Scene::highest(state));
                }
                stream.search(&scene.tree, covered);
                for lane in bits(std::mem::take(&mut waiting)) {
                    let state = &mut states[lane];
                    let Some(found) = stream.nearest(lane) else {
                        // No crossing ahead.
                        state.open = false;
                        continue;
                    };
                    if let Some(change) = scene.advance(state, found, &mut covered[lane], coincident) {
                        changes[batch.len()] = (lane, change);
                        batch.push(&scene.arrival(state, &change));
                    }
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

    /// Continues the paths of the batch from their interfaces.
    #[inline(always)]
    fn depart(&mut self, scene: &Scene<'_>) {
        let Self { records, states, batch, changes, forks, .. } = self;
        if batch.len() == 0 {
            return;
        }
        depart(&batch.arrivals, &mut batch.departures, scene.rules());
        for (i, &(lane, change)) in changes[..batch.len()].iter().enumerate() {
            let (state, record, departure) = (&mut states[lane], &mut records[lane], batch.departure(i));
            if departure.reflected && !state.has_reflected && scene.params.single() {
                forks[lane] = Some(Fork { state: *state, change, last: record.last() });
            }
            scene.depart(state, &change, &departure, record);
        }
    }
}
