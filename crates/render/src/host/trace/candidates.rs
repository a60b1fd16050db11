//! Candidates of a straight path: all triangles that it may cross between its interfaces, found by one traversal.
//!
//! A path goes straight on until it reflects, but at each interface its origin and its direction are rounded. So it
//! drifts from its first straight line, by less than [`DRIFT_MM`] over [`STEPS_MAX`] steps within [`WITHIN_MM`].
//! Candidates are the triangles within that drift of the line. Each is tested again from the path's own position, which
//! finds the same crossings as a new search of the tree. Within the tolerance of an edge, however, the tree's boxes
//! decide whether a search finds a triangle. There, the path searches anew.

use glam::Vec3;
use insonify_core::simd::prefetch;

use super::packet::{Packet, Visits, possible_crossings};
use super::ray_triangle::{DRIFT_MM, Hit, hit};
use super::search::{Covered, Search};
use super::traverse::{Crossing, Nearest, Tree};
use crate::constants::CROSSINGS_OF_A_PATH;
use crate::host::constants::TOUCH_MM;
use crate::host::lanes::RAYS;

/// Greatest number of steps from crossing to crossing for which candidates are valid. A step moves the origin by at
/// most 6·10⁻⁵ mm, and turns the direction by at most 10⁻⁷.
const STEPS_MAX: u32 = 64;
/// Greatest coordinate of a path for which candidates are valid, mm.
const WITHIN_MM: f32 = 512.0;

/// A triangle that a path may cross.
#[derive(Debug, Clone, Copy, Default)]
struct Candidate {
    /// Least and greatest distance from the path's start at which the path may cross the triangle, mm.
    least_mm: f32,
    most_mm: f32,
    triangle: u32,
}

/// Progress of a path along its candidates.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Along {
    /// Distance from the path's start, mm.
    pub(super) travelled_mm: f32,
    /// Steps so far.
    pub(super) steps: u32,
    /// Number of candidates at the head of the list that the path has left behind.
    passed: usize,
}

impl Along {
    /// Moves on by a step of `t` mm.
    #[inline(always)]
    pub(super) fn step(&mut self, t: f32) {
        self.travelled_mm += t;
        self.steps += 1;
    }
}

/// Candidates of a path, sorted by least distance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidates {
    list: [Candidate; Self::MOST],
    count: usize,
    /// Distance from the start up to which the list is complete, mm.
    complete_mm: f32,
}

impl Candidates {
    /// Capacity. A path at high quality has about fifty candidates.
    const MOST: usize = CROSSINGS_OF_A_PATH as usize;

    pub(super) fn new() -> Self {
        Self { list: [Candidate::default(); Self::MOST], count: 0, complete_mm: f32::NEG_INFINITY }
    }

    /// Distance up to which a path from `origin` has candidates, mm: `length_mm` if the path stays within
    /// [`WITHIN_MM`], else 0.
    pub(super) fn length_mm(origin: Vec3, length_mm: f32) -> f32 {
        if origin.abs().max_element() + length_mm <= WITHIN_MM { length_mm } else { 0.0 }
    }

    /// Removes all candidates. The caller then adds all candidates within `length_mm`.
    #[inline(always)]
    fn clear(&mut self, length_mm: f32) {
        self.count = 0;
        self.complete_mm = length_mm - 2.0 * DRIFT_MM;
    }

    /// Adds a candidate. If the list is full, the farthest candidate is dropped.
    #[inline(always)]
    fn push(&mut self, mut candidate: Candidate) {
        if let Some(slot) = self.list.get_mut(self.count) {
            *slot = candidate;
            self.count += 1;
            return;
        }
        let farthest = self.list.iter_mut().max_by(|a, b| a.least_mm.total_cmp(&b.least_mm));
        if let Some(farthest) = farthest.filter(|farthest| farthest.least_mm > candidate.least_mm) {
            std::mem::swap(farthest, &mut candidate);
        }
        self.complete_mm = self.complete_mm.min(candidate.least_mm - DRIFT_MM);
    }

    /// Sorts the candidates by least distance. They arrive almost in that order.
    #[inline(always)]
    fn sort(&mut self) {
        let list = &mut self.list[..self.count];
        for i in 1..list.len() {
            let candidate = list[i];
            let mut at = i;
            while at > 0 && list[at - 1].least_mm > candidate.least_mm {
                list[at] = list[at - 1];
                at -= 1;
            }
            list[at] = candidate;
        }
    }

    /// Whether no candidate is missing up to `t` mm ahead of a position.
    #[inline(always)]
    fn complete(&self, along: &Along, t: f32) -> bool {
        along.steps < STEPS_MAX && along.travelled_mm + t <= self.complete_mm
    }

    /// The nearest crossing in (t_min, t_max] of a ray at a position of the path, as by a search of all triangles;
    /// `Some(None)` if there is none. `None` if candidates may be missing, or if a hit lies within an edge's tolerance.
    #[inline(always)]
    pub(super) fn nearest(
        &self,
        tree: &Tree<'_>,
        [origin, direction]: [Vec3; 2],
        along: &mut Along,
        [t_min, t_max]: [f32; 2],
        highest: u32,
        covered: &mut Covered,
    ) -> Option<Option<Nearest>> {
        let list = &self.list[..self.count];
        while list.get(along.passed).is_some_and(|candidate| candidate.most_mm < along.travelled_mm) {
            along.passed += 1;
        }
        covered.clear();
        let mut search = Search::new(t_max);
        let mut ahead = list[along.passed..].iter();
        for candidate in &mut ahead {
            if candidate.least_mm - along.travelled_mm > search.reach_mm() + TOUCH_MM {
                // The path's next search begins here, after searches of other paths.
                prefetch(&tree.triangles[candidate.triangle as usize]);
                break;
            }
            let triangle = &tree.triangles[candidate.triangle as usize];
            match hit(triangle, origin, direction) {
                Hit::Inside(t, enters) if t > t_min => {
                    let crossing = Crossing { t, triangle: candidate.triangle, enters };
                    search.add(crossing, triangle.surface < highest, covered);
                }
                Hit::AtEdge(t) if t > t_min && t <= search.reach_mm() + TOUCH_MM => return None,
                _ => {}
            }
        }
        if let Some(next) = ahead.next() {
            prefetch(&tree.triangles[next.triangle as usize]);
        }
        self.complete(along, search.reach_mm() + TOUCH_MM).then_some(search.nearest)
    }

    /// Collects every crossing in (t_min, t_max] of a ray at a position of the path, unsorted. Returns their number.
    /// `None` if candidates may be missing, if a hit lies within an edge's tolerance, or if there are more than `into`
    /// holds.
    pub(super) fn collect(
        &self,
        tree: &Tree<'_>,
        [origin, direction]: [Vec3; 2],
        along: &Along,
        [t_min, t_max]: [f32; 2],
        into: &mut [Crossing],
    ) -> Option<usize> {
        if !self.complete(along, t_max) {
            return None;
        }
        let mut count = 0;
        for candidate in &self.list[..self.count] {
            if candidate.least_mm - along.travelled_mm > t_max {
                break;
            }
            if candidate.most_mm - along.travelled_mm < t_min {
                continue;
            }
            match hit(&tree.triangles[candidate.triangle as usize], origin, direction) {
                Hit::Inside(t, enters) if t > t_min && t <= t_max => {
                    *into.get_mut(count)? = Crossing { t, triangle: candidate.triangle, enters };
                    count += 1;
                }
                Hit::AtEdge(t) if t > t_min && t <= t_max => return None,
                _ => {}
            }
        }
        Some(count)
    }
}

/// Collects the candidates of a packet's rays up to their `length_mm`. Also collects their crossings from t_min to
/// `near_mm` into `near`, unsorted, and returns the number of crossings per ray. `None` if a crossing lies within an
/// edge's tolerance, or if the crossings exceed the capacity of `near`.
#[inline(always)]
pub(super) fn collect(
    tree: &Tree<'_>,
    packet: &Packet,
    visits: &mut Visits,
    candidates: &mut [Candidates; RAYS],
    length_mm: &[f32; RAYS],
    near: &mut [&mut [Crossing]; RAYS],
    near_mm: &[f32; RAYS],
) -> Option<[usize; RAYS]> {
    let (mut counts, mut known) = ([0; RAYS], true);
    for (candidates, &length_mm) in candidates.iter_mut().zip(length_mm) {
        candidates.clear(length_mm);
    }
    possible_crossings(tree, packet, visits, |lane, [least_mm, most_mm], triangle| {
        if least_mm <= near_mm[lane] {
            let ray = packet.ray(lane);
            let is_near = |t: f32| t > packet.t_min(lane) && t <= near_mm[lane];
            match hit(&tree.triangles[triangle as usize], ray.origin, ray.direction) {
                Hit::Inside(t, enters) if is_near(t) => match near[lane].get_mut(counts[lane]) {
                    Some(slot) => {
                        *slot = Crossing { t, triangle, enters };
                        counts[lane] += 1;
                    }
                    None => known = false,
                },
                Hit::AtEdge(t) if is_near(t) => known = false,
                _ => {}
            }
        }
        if most_mm >= 0.0 && least_mm <= length_mm[lane] {
            candidates[lane].push(Candidate { least_mm, most_mm, triangle });
        }
    });
    candidates.iter_mut().for_each(Candidates::sort);
    known.then_some(counts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::trace::ray_triangle::intersection;
    use crate::host::trace::search::tests::{alone, bvh};
    use crate::host::trace::traverse::{Ray, by_distance};
    use crate::host::trace::tree::WideNode;
    use crate::twin::hash::sample_unit;

    /// Origin and direction of a ray. Some go along an axis, through corners and edges.
    fn ray(trial: u32, lane: u32) -> [Vec3; 2] {
        let number = |dim| sample_unit(21, trial, 0, 0, dim) as f32 - 0.5;
        let own = |dim| 0.2 * (sample_unit(22, trial, lane, 0, dim) as f32 - 0.5);
        let mut origin = Vec3::new(20.0 * number(0) + 10.0 * own(0), 6.0 * number(1) + 3.0 * own(1), -30.0);
        let slopes = Vec3::new(0.5 * number(3) + own(3), 0.5 * number(4) + own(4), 1.0);
        if trial.is_multiple_of(4) {
            origin = origin.round();
        }
        [origin, if trial.is_multiple_of(3) { Vec3::Z } else { slopes.normalize() }]
    }

    const LENGTH_MM: f32 = 80.0;

    fn collected(tree: &Tree<'_>, trial: u32) -> Box<[Candidates; RAYS]> {
        let mut packet = Packet::new();
        for lane in 0..RAYS {
            let [origin, direction] = ray(trial, lane as u32);
            packet.set(lane, Ray::new(origin, direction), -20.0, LENGTH_MM);
        }
        let mut candidates = Box::new([Candidates::new(); RAYS]);
        let (mut near, near_mm) = ([[Crossing::default(); 16]; RAYS], [3.0; RAYS]);
        let mut into = near.each_mut().map(|lane| &mut lane[..]);
        let lengths_mm = [LENGTH_MM; RAYS];
        let found = collect(tree, &packet, &mut Visits::new(), &mut candidates, &lengths_mm, &mut into, &near_mm);
        for (lane, count) in found.into_iter().flatten().enumerate() {
            near[lane][..count].sort_by(by_distance);
            assert_eq!(near[lane][..count], alone(tree, packet.ray(lane), [-20.0, 3.0]));
        }
        candidates
    }

    #[test]
    fn a_path_finds_from_crossing_to_crossing_what_a_search_of_all_triangles_finds() {
        let bvh = bvh();
        let nodes: Vec<_> = bvh.nodes.iter().map(WideNode::decode).collect();
        let tree = Tree { nodes: &nodes, triangles: &bvh.triangles };
        let (mut covered, mut steps, mut crowds, mut below, mut edges) = (Covered::new(), 0, 0, 0, 0);
        for trial in 0..600 {
            let candidates = collected(&tree, trial);
            for (lane, candidates) in candidates.iter().enumerate() {
                let [mut origin, mut direction] = ray(trial, lane as u32);
                let (mut along, mut t_min) = (Along::default(), 0.0);
                let highest = (trial + lane as u32) % 6;
                loop {
                    let name = format!("ray {lane} of packet {trial} at {along:?}");
                    let range @ [_, t_max] = [t_min, LENGTH_MM - 1.0 - along.travelled_mm];
                    let all = bvh.triangles.iter().zip(0..).filter_map(|(triangle, index)| {
                        let (t, hit, enters) = intersection(triangle, origin, direction);
                        (hit && t > t_min && t <= t_max).then_some(Crossing { t, triangle: index, enters })
                    });
                    let mut all: Vec<_> = all.collect();
                    all.sort_by(by_distance);
                    let ray = [origin, direction];
                    let mut collected = [Crossing::default(); 64];
                    if let Some(count) = candidates.collect(&tree, ray, &along, range, &mut collected) {
                        collected[..count].sort_by(by_distance);
                        assert_eq!(collected[..count], all, "{name}");
                    }
                    let is_below = |c: &&Crossing| tree.triangles[c.triangle as usize].surface < highest;
                    let over: Vec<_> = all.iter().filter(|c| !is_below(c)).collect();
                    let to = over.first().map_or(f32::MAX, |first| first.t + TOUCH_MM);
                    match candidates.nearest(&tree, ray, &mut along, range, highest, &mut covered) {
                        Some(found) => {
                            assert_eq!(found.map(|n| n.crossing.t), over.first().map(|c| c.t), "{name}");
                            let near = over.iter().filter(|c| c.t <= to).count();
                            assert_eq!(found.is_some_and(|n| n.crowded), near > 1, "{name}");
                            let under: Vec<_> = all.iter().filter(is_below).filter(|c| c.t <= to).copied().collect();
                            assert_eq!(covered.up_to(to), under, "{name}");
                            (crowds, below) = (crowds + usize::from(near > 1), below + under.len());
                        }
                        // Candidates are undecided only if a hit is at an edge.
                        None => {
                            let at_edge = |c: &Crossing| {
                                matches!(hit(&tree.triangles[c.triangle as usize], origin, direction), Hit::AtEdge(_))
                            };
                            assert!(all.iter().any(at_edge), "{name}");
                            edges += 1;
                        }
                    }
                    let Some(first) = over.first() else { break };
                    // Rounds the ray as a path does at each interface.
                    origin += direction * first.t;
                    direction = direction.normalize();
                    along.step(first.t);
                    (t_min, steps) = (TOUCH_MM, steps + 1);
                }
            }
        }
        // The packets cover enough of every case, and hits at edges are rare off the axes.
        let enough = steps > 10_000 && crowds > 1000 && below > 1000 && edges > 100 && edges < steps / 4;
        assert!(enough, "{steps}, {crowds}, {below}, {edges}");
    }

    #[test]
    fn beyond_its_candidates_a_path_searches_anew() {
        let mut candidates = Candidates::new();
        let mut covered = Covered::new();
        let tree = Tree { nodes: &[], triangles: &[] };
        let mut along = Along::default();
        let mut nearest = |candidates: &Candidates, along: &mut Along, t_max: f32| {
            candidates.nearest(&tree, [Vec3::ZERO, Vec3::Z], along, [0.0, t_max], 0, &mut covered)
        };
        assert_eq!(nearest(&candidates, &mut along, 10.0), None);
        candidates.clear(20.0);
        assert_eq!(nearest(&candidates, &mut along, 10.0), Some(None));
        assert_eq!(nearest(&candidates, &mut along, 20.0), None);
        along.step(10.0);
        assert_eq!(nearest(&candidates, &mut along, 10.0), None);
        assert_eq!(nearest(&candidates, &mut along, 9.0), Some(None));
        (1..STEPS_MAX).for_each(|_| along.step(0.0));
        assert_eq!(nearest(&candidates, &mut along, 9.0), None);
        // Far from the middle of the scene, rounding is coarser.
        assert_eq!(Candidates::length_mm(Vec3::new(0.0, -300.0, 100.0), 200.0), 200.0);
        assert_eq!(Candidates::length_mm(Vec3::new(0.0, -300.0, 100.0), 220.0), 0.0);
    }

    #[test]
    fn without_room_the_nearest_candidates_stay_and_the_others_are_missing() {
        let mut candidates = Candidates::new();
        candidates.clear(500.0);
        // Distances in a scattered order.
        let count = Candidates::MOST as u32 + 10;
        for i in 0..count {
            let least_mm = (i * 37 % count) as f32;
            candidates.push(Candidate { least_mm, most_mm: least_mm, triangle: i });
        }
        candidates.sort();
        assert_eq!(candidates.count, Candidates::MOST);
        assert!(candidates.list.iter().zip(0u32..).all(|(candidate, i)| candidate.least_mm == i as f32));
        let end = Candidates::MOST as f32;
        let along = Along::default();
        assert!(candidates.complete(&along, end - 2.0 * DRIFT_MM) && !candidates.complete(&along, end));
    }
}
