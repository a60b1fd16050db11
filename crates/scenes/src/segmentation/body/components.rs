//! Connected parts of a mask, and removal of small fragments of labels.

use std::collections::HashMap;

use rayon::prelude::*;

/// Calls `visit` with the index of each neighbour that shares a face with the voxel.
fn each_neighbour(index: usize, size: [usize; 3], mut visit: impl FnMut(usize)) {
    let strides = [1, size[0], size[0] * size[1]];
    for axis in 0..3 {
        let at = index / strides[axis] % size[axis];
        if at > 0 {
            visit(index - strides[axis]);
        }
        if at + 1 < size[axis] {
            visit(index + strides[axis]);
        }
    }
}

/// Smallest volume of a part that is kept, relative to the largest part. Legs exceed it, as do arms that are separate
/// from the trunk.
const PART_SHARE: f64 = 0.01;

/// Keeps the large parts of `mask`, connected across voxel faces. Also keeps every part with a voxel for which `holds`
/// is true.
pub(crate) fn large_components(mask: &mut [bool], size: [usize; 3], holds: impl Fn(usize) -> bool) {
    let mut part_of = vec![0u32; mask.len()];
    // For each part, counted from 1: number of voxels, and whether the part is kept even if it is small.
    let mut found = vec![(0usize, false)];
    let mut stack = Vec::new();
    for start in 0..mask.len() {
        if !mask[start] || part_of[start] != 0 {
            continue;
        }
        let parts = found.len() as u32;
        let (mut count, mut held) = (0usize, false);
        part_of[start] = parts;
        stack.push(start);
        while let Some(index) = stack.pop() {
            count += 1;
            held |= holds(index);
            each_neighbour(index, size, |next| {
                if mask[next] && part_of[next] == 0 {
                    part_of[next] = parts;
                    stack.push(next);
                }
            });
        }
        found.push((count, held));
    }
    let most = found.iter().map(|(count, _)| *count).max().unwrap_or(0) as f64;
    let kept: Vec<bool> = found.iter().map(|&(count, held)| held || count as f64 >= PART_SHARE * most).collect();
    mask.par_iter_mut().zip(&part_of).for_each(|(inside, part)| *inside = *inside && kept[*part as usize]);
}

/// Gives each part of fewer than `voxels_min` voxels to the label that it touches most. A part is a connected region of
/// one label or of background. The last part of a label stays. Returns the number of parts that each label lost.
pub fn without_fragments(labels: &mut [u16], size: [usize; 3], voxels_min: usize) -> HashMap<u16, usize> {
    let mut totals: HashMap<u16, usize> = HashMap::new();
    for &label in labels.iter() {
        *totals.entry(label).or_default() += 1;
    }
    let shared: &[u16] = labels;
    // A fragment is found once, from the voxel with its lowest index.
    let fragments: Vec<Vec<usize>> = (0..labels.len())
        .into_par_iter()
        .filter_map(|start| {
            let label = shared[start];
            // Most voxels have a neighbour of their label with a lower index, so they start no part.
            let mut first = true;
            each_neighbour(start, size, |next| first &= !(next < start && shared[next] == label));
            first.then(|| fragment(shared, size, start, voxels_min)).flatten()
        })
        .collect();
    let mut gone = HashMap::new();
    for fragment in fragments {
        let label = labels[fragment[0]];
        if totals.get(&label).is_none_or(|&total| total == fragment.len()) {
            continue;
        }
        let mut touches: Vec<(u16, usize)> = Vec::new();
        for &index in &fragment {
            each_neighbour(index, size, |next| {
                let other = labels[next];
                if other != label {
                    match touches.iter_mut().find(|(known, _)| *known == other) {
                        Some((_, count)) => *count += 1,
                        None => touches.push((other, 1)),
                    }
                }
            });
        }
        let Some(&(most, _)) = touches.iter().max_by_key(|(other, count)| (*count, *other)) else { continue };
        for &index in &fragment {
            labels[index] = most;
        }
        *totals.entry(label).or_default() -= fragment.len();
        *totals.entry(most).or_default() += fragment.len();
        *gone.entry(label).or_default() += 1;
    }
    gone
}

/// Voxel indices of the part that contains `start`. `None` if the part has at least `voxels_min` voxels, or a voxel
/// with an index below `start`.
fn fragment(labels: &[u16], size: [usize; 3], start: usize, voxels_min: usize) -> Option<Vec<usize>> {
    let mut found = vec![start];
    let mut next = 0;
    while next < found.len() {
        let index = found[next];
        next += 1;
        let mut earlier = false;
        each_neighbour(index, size, |other| {
            if labels[other] == labels[start] && !found.contains(&other) {
                earlier |= other < start;
                found.push(other);
            }
        });
        if earlier || found.len() >= voxels_min {
            return None;
        }
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fragments_go_to_what_they_touch_most_and_a_labels_last_part_stays() {
        let size = [12, 6, 6];
        let mut labels = vec![0u16; 432];
        let at = |x: usize, y: usize, z: usize| (z * 6 + y) * 12 + x;
        for z in 1..5 {
            for y in 1..5 {
                for x in 1..7 {
                    labels[at(x, y, z)] = 1;
                }
            }
        }
        labels[at(3, 3, 3)] = 2; // enclosed by label 1
        labels[at(9, 3, 3)] = 2; // two parts of one voxel each: the last part stays
        labels[at(2, 2, 2)] = 0; // a hole
        labels[at(11, 5, 5)] = 3;
        let gone = without_fragments(&mut labels, size, 8);
        assert_eq!((labels[at(3, 3, 3)], labels[at(9, 3, 3)], labels[at(2, 2, 2)]), (1, 2, 1));
        assert_eq!((labels[at(11, 5, 5)], labels[at(1, 1, 1)], labels[0]), (3, 1, 0));
        assert_eq!(gone, HashMap::from([(2, 1), (0, 1)]));
    }

    #[test]
    fn large_parts_stay_and_those_that_hold_something() {
        let mut mask = vec![true; 1000];
        (mask[500], mask[997], mask[998]) = (false, false, true);
        (mask[3], mask[5]) = (false, false);
        let mut other = mask.clone();
        large_components(&mut mask, [1000, 1, 1], |_| false);
        let kept = |mask: &[bool]| [1, 4, 300, 700, 998].map(|i: usize| mask[i]);
        assert_eq!(kept(&mask), [false, false, true, true, false]);
        large_components(&mut other, [1000, 1, 1], |i| i == 4);
        assert_eq!(kept(&other), [false, true, true, true, false]);
    }
}
