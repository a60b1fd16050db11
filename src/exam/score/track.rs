//! Positions of the probe over time, and its offsets from the planes.

use glam::DVec3;
use serde::Serialize;

use super::{HOLD_S, Reference};
use crate::anatomy::planes::StandardPlane;
use crate::exam::offset::Offset;
use crate::pose::TimedPose;
use crate::transducer::placement::DEPTH_MAX_MM;
use crate::transducer::{Contact, Misplacement, touch};

/// Longest time between two poses of one hold, s. A longer one is a gap.
pub(super) const GAP_S: f64 = 0.25;

/// Smallest part of the face in contact, 0..=1, for which the probe counts as on the skin (assumed).
const CONTACT_MIN: f64 = 0.5;

/// Interval over which positions are averaged before path lengths are summed, s. It suppresses tremor.
const PATH_STEP_S: f64 = 0.1;

/// Track of the probe in a session; each list has an entry for each pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Track {
    /// Time since the start, s.
    pub time_s: Vec<f64>,
    /// Centre of the probe's face, in the scene, mm.
    pub position_mm: Vec<[f64; 3]>,
    /// Whether the probe is on the skin.
    pub contact: Vec<bool>,
    /// Part of the face in contact, 0..=1.
    pub face: Vec<f64>,
    /// Impossible placement of the probe; `None` for one that a hand can reach.
    pub misplaced: Vec<Option<Misplacement>>,
    /// Offset from the nearest view of each plane: one list for each plane, in the order of the reference.
    pub offsets: Vec<Vec<Offset>>,
}

/// Part of the face on the skin, 0..=1. It is 0 if the face is too deep.
fn part_on_skin(contact: &Contact) -> f64 {
    let too_deep = contact.press_mm.is_some_and(|mm| mm > DEPTH_MAX_MM);
    if too_deep { 0.0 } else { contact.part }
}

/// Whether the probe counts as on the skin.
pub fn is_on_skin(contact: &Contact) -> bool {
    part_on_skin(contact) >= CONTACT_MIN
}

impl Track {
    /// Positions, contact and offsets at each pose.
    pub(super) fn of(poses: &[TimedPose], reference: &Reference<'_>) -> Self {
        let start_ns = poses.first().map_or(0, |p| p.host_time_ns);
        let touched = |(index, p): (usize, &TimedPose)| {
            let Some(skin) = reference.skin else { return (1.0, None) };
            let contact = touch(skin, &reference.probe_at(index), &p.pose, reference.contact).1;
            (part_on_skin(&contact), contact.misplaced)
        };
        let (face, misplaced): (Vec<f64>, Vec<_>) = poses.iter().enumerate().map(touched).unzip();
        // A plane without a view has no offset; loading rejects such planes.
        let offsets = |plane: &&StandardPlane| {
            let nearest = |(index, p): (usize, &TimedPose)| {
                Offset::nearest(plane, &reference.probe_at(index), &p.pose).map(|(_, offset)| offset)
            };
            poses.iter().enumerate().filter_map(nearest).collect()
        };
        Self {
            time_s: poses.iter().map(|p| (p.host_time_ns - start_ns) as f64 * 1e-9).collect(),
            position_mm: poses.iter().map(|p| p.pose.position_mm.to_array()).collect(),
            contact: face.iter().map(|&part| part >= CONTACT_MIN).collect(),
            face,
            misplaced,
            offsets: reference.planes.iter().map(offsets).collect(),
        }
    }
}

/// Path length of the face up to each pose, mm, measured between means over [`PATH_STEP_S`].
pub(super) fn path_mm(track: &Track) -> Vec<f64> {
    let mut path = Vec::with_capacity(track.time_s.len());
    let (mut total_mm, mut last): (f64, Option<DVec3>) = (0.0, None);
    let bin = |t: f64| (t / PATH_STEP_S) as u64;
    let mut rest = track.time_s.as_slice();
    let mut positions = track.position_mm.as_slice();
    while let Some(&first) = rest.first() {
        let count = rest.partition_point(|&t| bin(t) <= bin(first)).max(1);
        let sum: DVec3 = positions[..count].iter().map(|p| DVec3::from_array(*p)).sum();
        let mean = sum / count as f64;
        total_mm += last.map_or(0.0, |last| last.distance(mean));
        last = Some(mean);
        path.extend(std::iter::repeat_n(total_mm, count));
        (rest, positions) = (&rest[count..], &positions[count..]);
    }
    path
}

/// Runs of consecutive poses without gaps that satisfy `holds`: first and last index of each.
pub(super) fn stretches(time_s: &[f64], holds: impl Fn(usize) -> bool) -> Vec<(usize, usize)> {
    let mut found: Vec<(usize, usize)> = Vec::new();
    for i in (0..time_s.len()).filter(|&i| holds(i)) {
        match found.last_mut() {
            Some((_, last)) if *last + 1 == i && time_s[i] - time_s[*last] <= GAP_S => *last = i,
            _ => found.push((i, i)),
        }
    }
    found
}

/// First and last index of the second with the smallest mean of `cost`; `None` if every second has a gap.
pub(super) fn best_second(time_s: &[f64], cost: &[f64]) -> Option<(usize, usize)> {
    let mut best: Option<(f64, (usize, usize))> = None;
    for (first, last) in stretches(time_s, |_| true) {
        let (mut start, mut sum) = (first, 0.0);
        for end in first..=last {
            sum += cost[end];
            // Drops poses at the start while the window still spans a second.
            while start < end && time_s[end] - time_s[start + 1] >= HOLD_S - 1e-6 {
                sum -= cost[start];
                start += 1;
            }
            let mean = sum / (end - start + 1) as f64;
            if time_s[end] - time_s[start] >= HOLD_S - 1e-6 && best.is_none_or(|(least, _)| mean < least) {
                best = Some((mean, (start, end)));
            }
        }
    }
    best.map(|(_, window)| window)
}

/// Time from the first to the last pose of a run, s.
pub(super) fn length_s(time_s: &[f64], &(first, last): &(usize, usize)) -> f64 {
    time_s[last] - time_s[first]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_held_over_a_gap() {
        let time_s = [0.0, 0.1, 0.2, 0.3, 0.9, 1.0, 1.1];
        assert_eq!(stretches(&time_s, |_| true), [(0, 3), (4, 6)]);
        assert_eq!(stretches(&time_s, |i| i != 1), [(0, 0), (2, 3), (4, 6)]);
        assert_eq!(best_second(&time_s, &[0.0; 7]), None, "no second without a gap");
    }

    #[test]
    fn the_best_second_is_the_cheapest() {
        let time_s: Vec<f64> = (0..400).map(|i| f64::from(i) / 100.0).collect();
        let cost: Vec<f64> = time_s.iter().map(|t| (t - 2.5).abs()).collect();
        let (start, end) = best_second(&time_s, &cost).unwrap();
        assert_eq!((start, end), (200, 300));
    }

    #[test]
    fn tremor_adds_no_path_length() {
        let time_s: Vec<f64> = (0..600).map(|i| f64::from(i) / 60.0).collect();
        // A movement of 20 mm/s along x, with a transverse tremor of 10 Hz and 0.5 mm.
        let position_mm =
            time_s.iter().map(|t| [20.0 * t, 0.5 * (std::f64::consts::TAU * 10.0 * t).sin(), 0.0]).collect();
        let (contact, face, misplaced) = (vec![true; 600], vec![1.0; 600], vec![None; 600]);
        let track = Track { contact, face, misplaced, offsets: Vec::new(), time_s, position_mm };
        let total_mm = *path_mm(&track).last().unwrap();
        assert!((total_mm - 198.0).abs() < 2.0, "{total_mm}");
    }
}
