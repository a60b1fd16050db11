//! Crossings of a straight path, found by one traversal of the tree. A path is straight until it reflects.

use super::packet::{Packet, Visits, crossings};
use super::traverse::{Crossing, Tree, by_distance};
use crate::constants::CROSSINGS_OF_A_PATH;
use crate::host::constants::TOUCH_MM;
use crate::host::lanes::RAYS;

/// Progress of a path along its crossings.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Progress {
    /// Distance from the path's start, mm.
    pub(super) travelled_mm: f32,
    /// Number of crossings that the path has passed.
    passed: usize,
}

/// Crossings of a path ahead of its start, sorted by distance, then by triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct LineCrossings {
    list: [Crossing; Self::MOST],
    count: usize,
    /// Distance from the start up to which no crossing is missing, mm.
    complete_mm: f32,
}

impl LineCrossings {
    /// Capacity. A path at high quality has about fifty.
    const MOST: usize = CROSSINGS_OF_A_PATH as usize;

    pub(super) fn new() -> Self {
        Self { list: [Crossing::default(); Self::MOST], count: 0, complete_mm: f32::NEG_INFINITY }
    }

    /// Removes all crossings. The caller then adds all crossings up to `length_mm`.
    #[inline(always)]
    fn clear(&mut self, length_mm: f32) {
        (self.count, self.complete_mm) = (0, length_mm);
    }

    /// Adds a crossing. Without room, the farthest one is left out.
    #[inline(always)]
    fn push(&mut self, mut crossing: Crossing) {
        if let Some(slot) = self.list.get_mut(self.count) {
            *slot = crossing;
            self.count += 1;
            return;
        }
        let farthest = self.list.iter_mut().max_by(|a, b| by_distance(a, b));
        if let Some(farthest) = farthest.filter(|farthest| by_distance(&crossing, farthest).is_lt()) {
            std::mem::swap(farthest, &mut crossing);
        }
        self.complete_mm = self.complete_mm.min(crossing.t);
    }

    /// Sorts the crossings. They arrive almost in order.
    #[inline(always)]
    fn sort(&mut self) {
        let list = &mut self.list[..self.count];
        for i in 1..list.len() {
            let crossing = list[i];
            let mut at = i;
            while at > 0 && by_distance(&list[at - 1], &crossing).is_gt() {
                list[at] = list[at - 1];
                at -= 1;
            }
            list[at] = crossing;
        }
    }

    /// The next coincident crossings of a path within `left_mm`: the nearest one, and all others within [`TOUCH_MM`]
    /// beyond it. Empty if there is none. `None` if crossings may be missing.
    #[inline(always)]
    pub(super) fn next(&self, progress: &Progress, left_mm: f32) -> Option<&[Crossing]> {
        let ahead = &self.list[progress.passed..self.count];
        let end_mm = progress.travelled_mm + left_mm;
        let next_mm = ahead.first().map_or(f32::INFINITY, |first| first.t);
        if end_mm.min(next_mm) > self.complete_mm - TOUCH_MM {
            return None;
        }
        if next_mm - progress.travelled_mm > left_mm {
            return Some(&[]);
        }
        let coincident = ahead.iter().take_while(|crossing| crossing.t <= next_mm + TOUCH_MM).count();
        Some(&ahead[..coincident])
    }

    /// Moves a path on to coincident crossings of [`LineCrossings::next`].
    #[inline(always)]
    pub(super) fn pass(progress: &mut Progress, coincident: &[Crossing]) {
        progress.travelled_mm = coincident.first().map_or(progress.travelled_mm, |first| first.t);
        progress.passed += coincident.len();
    }
}

/// Finds the crossings of a packet's rays. `lines` receives the crossings ahead of each ray's start up to `length_mm`,
/// sorted. `near` receives all crossings up to `near_mm`, also behind the start, unsorted. Returns the number of crossings
/// of each ray in `near`, and the number lost there for lack of room. The other rays affect which crossings are lost.
#[inline(always)]
pub(super) fn collect(
    tree: &Tree<'_>,
    packet: &Packet,
    visits: &mut Visits,
    lines: &mut [LineCrossings; RAYS],
    length_mm: &[f32; RAYS],
    near: &mut [&mut [Crossing]; RAYS],
    near_mm: &[f32; RAYS],
) -> ([usize; RAYS], u32) {
    let (mut counts, mut lost) = ([0; RAYS], 0);
    for (line, &length_mm) in lines.iter_mut().zip(length_mm) {
        line.clear(length_mm);
    }
    crossings(tree, packet, visits, |lane, t, triangle, enters| {
        let crossing = Crossing { t, triangle, enters };
        if t <= near_mm[lane] {
            match near[lane].get_mut(counts[lane]) {
                Some(slot) => {
                    *slot = crossing;
                    counts[lane] += 1;
                }
                None => lost += 1,
            }
        }
        if t > 0.0 && t <= length_mm[lane] {
            lines[lane].push(crossing);
        }
    });
    lines.iter_mut().for_each(LineCrossings::sort);
    (counts, lost)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::trace::search::tests::{alone, bvh, ray};
    use crate::host::trace::tree::WideNode;

    const LENGTH_MM: f32 = 80.0;

    #[test]
    fn a_path_passes_every_crossing_ahead_of_its_start_once_and_in_order() {
        let bvh = bvh();
        let nodes: Vec<_> = bvh.nodes.iter().map(WideNode::decode).collect();
        let tree = Tree { nodes: &nodes, triangles: &bvh.triangles };
        let (mut passed, mut touching) = (0, 0);
        for trial in 0..600 {
            let spread = [0.0, 0.01, 0.2, 2.0][trial as usize % 4];
            let mut packet = Packet::new();
            (0..RAYS).for_each(|lane| packet.set(lane, ray(trial, lane as u32, spread), -20.0, LENGTH_MM));
            let mut lines = Box::new([LineCrossings::new(); RAYS]);
            let (mut near, near_mm) = ([[Crossing::default(); 16]; RAYS], [3.0; RAYS]);
            let mut into = near.each_mut().map(|lane| &mut lane[..]);
            let visits = &mut Visits::new();
            let (counts, lost) = collect(&tree, &packet, visits, &mut lines, &[LENGTH_MM; RAYS], &mut into, &near_mm);
            assert_eq!(lost, 0);
            for lane in 0..RAYS {
                let near = &mut near[lane][..counts[lane]];
                near.sort_by(by_distance);
                assert_eq!(
                    near,
                    alone(&tree, &ray(trial, lane as u32, spread), [-20.0, 3.0]),
                    "ray {lane} of packet {trial}"
                );
                let expected = alone(&tree, &ray(trial, lane as u32, spread), [0.0, LENGTH_MM]);
                let (mut progress, mut found) = (Progress::default(), Vec::new());
                let left_mm = |progress: &Progress| LENGTH_MM - 1.0 - progress.travelled_mm;
                while let Some(coincident @ [first, ..]) = lines[lane].next(&progress, left_mm(&progress)) {
                    assert!(coincident.iter().all(|c| c.t - first.t <= TOUCH_MM), "{coincident:?}");
                    found.extend_from_slice(coincident);
                    touching += usize::from(coincident.len() > 1);
                    LineCrossings::pass(&mut progress, coincident);
                }
                let within = expected.partition_point(|c| c.t <= LENGTH_MM - 1.0);
                assert_eq!(found[..within], expected[..within], "ray {lane} of packet {trial}");
                passed += found.len();
            }
        }
        assert!(passed > 10_000 && touching > 1000, "{passed}, {touching}");
    }

    #[test]
    fn beyond_its_length_a_path_must_search_anew() {
        let mut line = LineCrossings::new();
        let mut progress = Progress::default();
        assert!(line.next(&progress, 10.0).is_none());
        line.clear(20.0);
        assert_eq!(line.next(&progress, 10.0), Some(&[][..]));
        assert!(line.next(&progress, 20.0).is_none());
        progress.travelled_mm = 10.0;
        assert!(line.next(&progress, 10.0).is_none());
        assert_eq!(line.next(&progress, 9.0), Some(&[][..]));
    }

    #[test]
    fn without_room_the_nearest_crossings_stay_and_the_others_are_missing() {
        let mut line = LineCrossings::new();
        line.clear(500.0);
        // Distances in a scattered order.
        let count = LineCrossings::MOST as u32 + 10;
        for i in 0..count {
            line.push(Crossing { t: (i * 37 % count) as f32, triangle: i, enters: true });
        }
        line.sort();
        assert_eq!(line.count, LineCrossings::MOST);
        assert!(line.list.iter().zip(0u32..).all(|(crossing, i)| crossing.t == i as f32));
        let mut progress = Progress::default();
        while let Some(coincident @ [_, ..]) = line.next(&progress, 400.0) {
            LineCrossings::pass(&mut progress, coincident);
        }
        assert_eq!(progress.travelled_mm, LineCrossings::MOST as f32 - 1.0);
        assert!(line.next(&progress, 400.0).is_none(), "the next crossing has no room");
    }
}
