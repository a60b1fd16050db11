//! Placement of the probe over time: one that no hand can reach is told once it has lasted.

use std::time::Duration;

use crate::transducer::{Contact, Misplacement};

/// Time for which a placement must last before it is told.
const LASTS: Duration = Duration::from_secs(2);

/// Time for which a placement must be right before it is taken back.
const RIGHT: Duration = Duration::from_secs(1);

/// Placement told to viewers, with hysteresis: a probe that is turned in the air for a moment is no fault.
#[derive(Debug, Default)]
pub(super) struct PlacementWatch {
    told: Option<Misplacement>,
    /// Since when the frames say otherwise.
    otherwise_since: Option<Duration>,
}

/// Change of the placement that is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum PlacementChange {
    /// It is impossible.
    Wrong(Misplacement),
    /// It is right again.
    Right,
}

impl PlacementWatch {
    /// Takes the contact of a frame rendered at `now`; none without a picture, or where everything is coupled.
    pub(super) fn update(&mut self, now: Duration, contact: Option<&Contact>) -> Option<PlacementChange> {
        let Some(Contact { misplaced, .. }) = contact else {
            self.otherwise_since = None;
            return None;
        };
        if misplaced.is_some() == self.told.is_some() {
            self.otherwise_since = None;
            if misplaced.is_some() {
                self.told = *misplaced;
            }
            return None;
        }
        let since = *self.otherwise_since.get_or_insert(now);
        let lasts = if misplaced.is_some() { LASTS } else { RIGHT };
        if now.saturating_sub(since) < lasts {
            return None;
        }
        (self.told, self.otherwise_since) = (*misplaced, None);
        Some(misplaced.map_or(PlacementChange::Right, PlacementChange::Wrong))
    }

    /// Placement to tell, as of the last frame; none for a right one.
    pub(super) fn told(&self) -> Option<Misplacement> {
        self.told
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transducer::placement::Fault;

    const WRONG: Misplacement = Misplacement { fault: Fault::LooksOut, likely: None };

    fn contact(misplaced: Option<Misplacement>) -> Contact {
        Contact { part: 1.0, press_mm: Some(1.0), shift_mm: 0.0, misplaced }
    }

    /// Changes of a probe that is wrong in these tenths of a second, and their times in tenths.
    fn changes(wrong: impl Fn(u32) -> bool) -> Vec<(u32, PlacementChange)> {
        let mut watch = PlacementWatch::default();
        let frame = |tenth| {
            let now = contact(wrong(tenth).then_some(WRONG));
            let change = watch.update(Duration::from_millis(100) * tenth, Some(&now));
            assert!(change.is_none_or(|c| (c == PlacementChange::Right) == watch.told().is_none()));
            change.map(|change| (tenth, change))
        };
        (0..100).filter_map(frame).collect()
    }

    #[test]
    fn a_placement_is_told_once_after_two_seconds_and_taken_back_after_one() {
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
    fn frames_without_contact_tell_nothing() {
        let mut watch = PlacementWatch::default();
        for second in 0..10 {
            let contact = (second % 2 == 0).then(|| contact(Some(WRONG)));
            assert_eq!(watch.update(Duration::from_secs(second), contact.as_ref()), None);
        }
    }
}
