//! Reasons why planes were not found, and why a session could not be judged.

use super::track::{GAP_S, Track, best_second};
use super::{HOLD_S, Reference};
use crate::anatomy::planes::StandardPlane;
use crate::exam::offset::Offset;
use crate::pose::TimedPose;

/// Reason for planes that were not found because no second of the session is without a gap.
pub(super) const NO_SECOND: &str = "not judged: every second has a gap";

/// Reason why a session with poses at these times can't be judged, as a sentence; `None` if at least one second has no
/// gap.
pub(super) fn not_judged(time_s: &[f64]) -> Option<String> {
    if best_second(time_s, &vec![0.0; time_s.len()]).is_some() {
        return None;
    }
    let (count, length_s) = (time_s.len(), time_s.last().copied().unwrap_or(0.0));
    let gap_s = time_s.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    Some(format!(
        "only {count} poses in {length_s:.1} s (gaps of up to {gap_s:.2} s): planes must be held for {HOLD_S} s without a gap of \
         more than {GAP_S} s, so nothing could be judged"
    ))
}

/// Reason why `plane` was not found: the conditions that failed in its best second, from `start` to `end`.
/// `longest_hold_s` is the longest time in which no condition failed.
pub(super) fn why_not(
    plane: &StandardPlane,
    offsets: &[Offset],
    poses: &[TimedPose],
    track: &Track,
    (start, end): (usize, usize),
    longest_hold_s: f64,
    reference: &Reference<'_>,
) -> String {
    let second = start..=end;
    let worst = second.clone().max_by(|&a, &b| offsets[a].cost.total_cmp(&offsets[b].cost));
    let mut reasons = worst.map_or_else(Vec::new, |i| {
        let (probe, pose) = (reference.probe_at(i), poses[i].pose);
        let nearest = Offset::nearest(plane, &probe, &pose);
        let shown = nearest.and_then(|(index, offset)| Some((plane.views.get(index)?, offset)));
        shown.map_or_else(Vec::new, |(view, offset)| offset.faults(view, &plane.tolerances, &probe, &pose))
    });
    let off_skin = second.filter(|&i| !track.contact[i]).count();
    if off_skin > 0 {
        reasons.push(format!("off the skin in {off_skin} of {} poses", end - start + 1));
    }
    let beyond = format!("in the best second {}", reasons.join(", "));
    // Rounded down, so that 0.98 s does not appear as 1.0 s.
    let held_s = (10.0 * longest_hold_s).floor() / 10.0;
    if held_s > 0.0 { format!("held for {held_s:.1} s (at least {HOLD_S}); {beyond}") } else { beyond }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sparse_poses_are_told_with_their_gaps() {
        let at = |step_s: f64, count: u32| (0..count).map(|i| step_s * f64::from(i)).collect::<Vec<_>>();
        assert_eq!(not_judged(&at(0.05, 40)), None);
        let told = not_judged(&at(1.0, 13)).unwrap();
        assert!(
            told.starts_with("only 13 poses in 12.0 s (gaps of up to 1.00 s): planes must be held for 1 s"),
            "{told}"
        );
        assert!(not_judged(&at(1.0 / 3.0, 30)).unwrap().contains("gaps of up to 0.33 s"));
        assert!(not_judged(&[]).unwrap().starts_with("only 0 poses in 0.0 s"));
    }
}
