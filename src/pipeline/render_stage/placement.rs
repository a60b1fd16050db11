//! Impossible placements of the probe, reported once they have lasted.

use std::mem::discriminant;
use std::time::Duration;

use crate::transducer::placement::MISPLACED_FOR;
use crate::transducer::{Contact, Misplacement};

/// Time for which the placement must be possible again before the report is taken back.
const RIGHT: Duration = Duration::from_secs(1);

/// Placement as reported to viewers, with hysteresis: a probe that is turned in the air for a moment is no fault.
#[derive(Debug, Default)]
pub(super) struct PlacementWatch {
    reported: Option<Misplacement>,
    /// Start of the latest frames that contradict `reported`, and whether the probe is misplaced in them. `None` if the
    /// last frame agrees with the report or its contact is unknown.
    otherwise: Option<(Duration, bool)>,
}

/// Change of the reported placement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum PlacementChange {
    /// The placement is impossible, or impossible for another reason than before.
    Wrong(Misplacement),
    /// The placement is possible again.
    Right,
}

impl PlacementWatch {
    /// Takes the contact of a frame rendered at `now`; `None` if the contact is unknown. Returns a change to report, if
    /// any.
    pub(super) fn update(&mut self, now: Duration, contact: Option<&Contact>) -> Option<PlacementChange> {
        let Some(Contact { misplaced, .. }) = contact else {
            self.otherwise = None;
            return None;
        };
        let kind = |placement: &Option<Misplacement>| placement.map(|placement| discriminant(&placement.fault));
        if kind(misplaced) == kind(&self.reported) {
            (self.reported, self.otherwise) = (*misplaced, None);
            return None;
        }
        let is_wrong = misplaced.is_some();
        let since = match self.otherwise {
            Some((since, was_wrong)) if was_wrong == is_wrong => since,
            _ => now,
        };
        self.otherwise = Some((since, is_wrong));
        let lasts = if is_wrong { MISPLACED_FOR } else { RIGHT };
        if now.saturating_sub(since) < lasts {
            return None;
        }
        (self.reported, self.otherwise) = (*misplaced, None);
        Some(misplaced.map_or(PlacementChange::Right, PlacementChange::Wrong))
    }

    /// Forgets all frames so far. Returns whether a fault was reported.
    pub(super) fn reset(&mut self) -> bool {
        std::mem::take(self).reported.is_some()
    }

    /// Reported placement, with the values of the last frame; none if the placement is possible.
    pub(super) fn reported(&self) -> Option<Misplacement> {
        self.reported
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transducer::placement::Fault;

    const WRONG: Misplacement = Misplacement { fault: Fault::LooksOut, likely: None };
    const DEEP: Misplacement = Misplacement { fault: Fault::Deep { depth_mm: 80.0 }, likely: None };

    fn contact(misplaced: Option<Misplacement>) -> Contact {
        Contact { part: 1.0, press_mm: Some(1.0), shift_mm: 0.0, misplaced }
    }

    /// Changes reported for a probe that is misplaced whenever `wrong` holds, each with its time. Times are in tenths
    /// of a second.
    fn changes(wrong: impl Fn(u32) -> bool) -> Vec<(u32, PlacementChange)> {
        changes_of(|tenth| wrong(tenth).then_some(WRONG))
    }

    /// Changes reported for a probe whose placement in each tenth of a second is `placed`, each with its time in
    /// tenths.
    fn changes_of(placed: impl Fn(u32) -> Option<Misplacement>) -> Vec<(u32, PlacementChange)> {
        let mut watch = PlacementWatch::default();
        let frame = |tenth| {
            let now = contact(placed(tenth));
            let change = watch.update(Duration::from_millis(100) * tenth, Some(&now));
            assert!(change.is_none_or(|c| (c == PlacementChange::Right) == watch.reported().is_none()));
            change.map(|change| (tenth, change))
        };
        (0..100).filter_map(frame).collect()
    }

    #[test]
    fn a_placement_is_reported_once_after_two_seconds_and_taken_back_after_one() {
        let found = changes(|tenth| (10..60).contains(&tenth));
        assert_eq!(found, [(30, PlacementChange::Wrong(WRONG)), (70, PlacementChange::Right)]);
    }

    #[test]
    fn moments_change_nothing() {
        assert_eq!(changes(|tenth| tenth % 20 < 15), [], "never two seconds in a row");
        assert_eq!(changes(|tenth| tenth % 10 != 0), [], "right ten times");
        let found = changes(|tenth| tenth < 30 || tenth % 5 != 0);
        assert_eq!(found, [(20, PlacementChange::Wrong(WRONG))], "wrong most of the time stays wrong");
    }

    #[test]
    fn another_fault_is_told_after_two_seconds_of_it() {
        let deep = PlacementChange::Wrong(DEEP);
        let found = changes_of(|tenth| Some(if tenth < 40 { DEEP } else { WRONG }));
        assert_eq!(found, [(20, deep), (60, PlacementChange::Wrong(WRONG))]);
        let found = changes_of(|tenth| Some(if tenth < 40 || tenth % 20 < 5 { DEEP } else { WRONG }));
        assert_eq!(found, [(20, deep)], "never two seconds in a row");
        // Time with the other fault doesn't count towards the second in which the placement must be possible.
        let found = changes_of(|tenth| match tenth {
            0..40 => Some(DEEP),
            40..55 => Some(WRONG),
            _ => None,
        });
        assert_eq!(found, [(20, deep), (65, PlacementChange::Right)]);
        // Before any report, frames of both faults count together.
        let found = changes_of(|tenth| Some(if tenth % 2 == 0 { WRONG } else { DEEP }));
        assert_eq!(found, [(20, PlacementChange::Wrong(WRONG))]);
    }

    #[test]
    fn a_watch_begins_anew_after_a_reset() {
        let mut watch = PlacementWatch::default();
        let deep = contact(Some(DEEP));
        let mut at = |seconds| watch.update(Duration::from_secs(seconds), Some(&deep));
        assert_eq!((at(0), at(2)), (None, Some(PlacementChange::Wrong(DEEP))));
        assert!(watch.reset() && watch.reported().is_none() && !watch.reset());
        let mut at = |seconds| watch.update(Duration::from_secs(seconds), Some(&deep));
        assert_eq!((at(3), at(4), at(5)), (None, None, Some(PlacementChange::Wrong(DEEP))));
    }

    #[test]
    fn frames_without_contact_tell_nothing() {
        let mut watch = PlacementWatch::default();
        for second in 0..10 {
            let contact = (second % 2 == 0).then(|| contact(Some(WRONG)));
            assert_eq!(watch.update(Duration::from_secs(second), contact.as_ref()), None);
        }
    }
}
