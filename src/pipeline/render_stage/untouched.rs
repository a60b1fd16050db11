//! A tracked probe that never touches the skin: reported once, because the tracker's unit or axes may be wrong.

use std::time::Duration;

use glam::DVec3;

use crate::pose::{Pose, TrackingState};
use crate::presented::FrameInfo;

/// Total time of good poses without contact after which the report is made.
const UNTOUCHED_FOR: Duration = Duration::from_secs(20);

/// Watch of a session's poses until the probe first touches the skin.
#[derive(Debug, Default)]
pub(super) struct UntouchedWatch {
    touched: bool,
    is_reported: bool,
    /// Total time of good poses so far.
    good: Duration,
    /// Time at which the last frame was rendered, if its pose was good.
    last: Option<Duration>,
    /// Opposite corners of the box around the probe's good positions so far, mm; none before the first.
    extent_mm: Option<[DVec3; 2]>,
}

/// Report of the watch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum UntouchedChange {
    /// The probe has not touched the skin for `UNTOUCHED_FOR` of good poses.
    Never {
        /// Time of good poses.
        good: Duration,
        /// Diagonal of the box around the positions of good poses, mm.
        extent_mm: f64,
        /// Last good pose.
        pose: Pose,
    },
    /// The probe touches the skin after all.
    Touched,
}

impl UntouchedWatch {
    /// Takes a rendered frame, and returns a change to report, if any. Frames do not count if the pose is not measured,
    /// is frozen or is reported as misplaced.
    pub(super) fn update(&mut self, info: &FrameInfo) -> Option<UntouchedChange> {
        let FrameInfo { estimate, contact, settings, misplaced, timeline, .. } = info;
        if self.touched {
            return None;
        }
        if contact.is_some_and(|contact| contact.coupled()) {
            self.touched = true;
            return self.is_reported.then_some(UntouchedChange::Touched);
        }
        let is_measured = estimate.first_byte_ns.is_some() && estimate.state == TrackingState::Good;
        let counts = is_measured && contact.is_some() && misplaced.is_none() && !settings.frozen && !self.is_reported;
        let Some(pose) = estimate.scene_from_probe.filter(|_| counts) else {
            self.last = None;
            return None;
        };
        let before = self.last.replace(timeline.rendered).unwrap_or(timeline.rendered);
        self.good = self.good.saturating_add(timeline.rendered.saturating_sub(before));
        let place_mm = pose.position_mm;
        let [low, high] = self.extent_mm.map_or([place_mm; 2], |[low, high]| [low.min(place_mm), high.max(place_mm)]);
        self.extent_mm = Some([low, high]);
        if self.good < UNTOUCHED_FOR {
            return None;
        }
        self.is_reported = true;
        Some(UntouchedChange::Never { good: self.good, extent_mm: low.distance(high), pose })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Estimate;
    use crate::presented::FrameTimeline;
    use crate::transducer::Contact;

    /// A frame of a tracked probe at `tenth` tenths of a second, with the part `part` of its face in contact.
    fn frame(tenth: u32, part: f64) -> FrameInfo {
        let position_mm = DVec3::new(0.0, 0.0, 0.3 * f64::from(tenth % 2));
        let estimate = Estimate {
            scene_from_probe: Some(Pose { position_mm, ..Pose::IDENTITY }),
            state: TrackingState::Good,
            first_byte_ns: Some(1),
            ..Estimate::default()
        };
        let timeline = FrameTimeline { rendered: Duration::from_millis(100) * tenth, ..FrameTimeline::default() };
        let contact = Some(Contact { part, press_mm: None, shift_mm: 0.0, misplaced: None });
        FrameInfo { estimate, timeline, contact, ..FrameInfo::default() }
    }

    /// Reports about 60 s of frames, with their times in tenths of a second.
    fn changes(frame: impl Fn(u32) -> FrameInfo) -> Vec<(u32, UntouchedChange)> {
        let mut watch = UntouchedWatch::default();
        (0..600).filter_map(|tenth| watch.update(&frame(tenth)).map(|change| (tenth, change))).collect()
    }

    #[test]
    fn a_probe_that_never_touches_is_told_once_and_a_later_touch_ends_it() {
        let found = changes(|tenth| frame(tenth, if tenth < 400 { 0.0 } else { 0.5 }));
        assert_eq!(found.len(), 2, "{found:?}");
        let (tenth, UntouchedChange::Never { good, extent_mm, .. }) = found[0] else { panic!("{found:?}") };
        assert_eq!((tenth, good), (200, UNTOUCHED_FOR));
        assert!((extent_mm - 0.3).abs() < 1e-9, "{extent_mm}");
        assert_eq!(found[1], (400, UntouchedChange::Touched));
        assert_eq!(changes(|tenth| frame(tenth, if tenth == 150 { 0.1 } else { 0.0 })), [], "it touched once");
    }

    #[test]
    fn only_good_poses_of_a_tracker_before_a_skin_count() {
        let with = |change: fn(&mut FrameInfo)| {
            changes(|tenth| {
                let mut info = frame(tenth, 0.0);
                change(&mut info);
                info
            })
        };
        assert_eq!(with(|info| info.contact = None), []);
        assert_eq!(with(|info| info.estimate.first_byte_ns = None), []);
        assert_eq!(with(|info| info.estimate.state = TrackingState::Stuck), []);
        assert_eq!(with(|info| info.settings.frozen = true), []);
        // Tracking is lost for 10 s, which don't count.
        let found = changes(|tenth| {
            let mut info = frame(tenth, 0.0);
            if (100..200).contains(&tenth) {
                info.estimate = Estimate::default();
            }
            info
        });
        assert!(matches!(found[..], [(301, UntouchedChange::Never { .. })]), "{found:?}");
    }
}
