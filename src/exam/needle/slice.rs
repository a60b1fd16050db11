//! The needle relative to the image.

use glam::DVec2;
use serde::Serialize;

use super::elevation::ElevationalProfile;
use super::event::NeedleEventKind;
use crate::needle::Needle;
use crate::pose::Pose;
use crate::transducer::{Probe, Sector};

/// Level above which the tip counts as visible, dB.
const VISIBLE_DB: f64 = -6.0;

/// Time for which a change of visibility must last before it is an event, s. It is longer than a period of tremor
/// (assumed).
pub const SETTLED_S: f64 = 0.25;

/// The needle relative to the image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TipInSlice {
    /// Distance of the tip from the image plane, mm.
    pub offset_mm: f64,
    /// Angle between the shaft and the image plane, degrees.
    pub angle_deg: f64,
    /// Whether the image shows the tip: it is in the sector, at −6 dB or more.
    pub visible: bool,
}

impl TipInSlice {
    /// `needle` relative to the image of `probe` at `scene_from_probe`.
    pub fn of(needle: &Needle, scene_from_probe: &Pose, probe: &Probe, profile: &dyn ElevationalProfile) -> Self {
        let probe_from_scene = scene_from_probe.inverse();
        let tip = probe_from_scene.transform_point(needle.tip_mm());
        let along = probe_from_scene.transform_vector(needle.direction());
        let depth_mm = Sector::polar(probe, DVec2::new(tip.x, tip.z)).map(|(_, depth_mm)| depth_mm);
        let level_db = depth_mm.map(|depth_mm| profile.level_db(tip.y.abs(), depth_mm));
        Self {
            offset_mm: tip.y.abs(),
            angle_deg: along.y.abs().min(1.0).asin().to_degrees(),
            visible: level_db.is_some_and(|level_db| level_db >= VISIBLE_DB),
        }
    }
}

/// Follows whether the image shows a tip in tissue. A tip that enters the body counts as shown.
#[derive(Debug, Clone, Copy)]
pub(super) struct SliceWatch {
    visible: bool,
    /// Time since which the opposite holds, s.
    changed_s: Option<f64>,
}

impl Default for SliceWatch {
    fn default() -> Self {
        Self { visible: true, changed_s: None }
    }
}

impl SliceWatch {
    /// Forgets since when the tip has been visible or not, because it was not followed for a while.
    pub(super) fn interrupt(&mut self) {
        self.changed_s = None;
    }

    /// Adds a sample; `slice` is `None` without an image. Returns the event of a lasting change.
    pub(super) fn advance(
        &mut self,
        time_s: f64,
        in_tissue: bool,
        slice: Option<TipInSlice>,
    ) -> Option<NeedleEventKind> {
        if !in_tissue {
            *self = Self::default();
            return None;
        }
        let Some(slice) = slice.filter(|slice| slice.visible != self.visible) else {
            self.changed_s = None;
            return None;
        };
        let changed_s = *self.changed_s.get_or_insert(time_s);
        if time_s - changed_s < SETTLED_S {
            return None;
        }
        *self = Self { visible: slice.visible, changed_s: None };
        Some(if slice.visible { NeedleEventKind::InSlice } else { NeedleEventKind::OutOfSlice })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(visible: bool) -> Option<TipInSlice> {
        Some(TipInSlice { offset_mm: 0.0, angle_deg: 0.0, visible })
    }

    #[test]
    fn a_tip_that_stays_out_of_the_slice_is_told_once_and_a_tremor_never() {
        let mut watch = SliceWatch::default();
        let mut told = Vec::new();
        let mut follow = |from: u32, to: u32, slice: &dyn Fn(u32) -> Option<TipInSlice>| {
            for i in from..to {
                let time_s = f64::from(i) / 60.0;
                told.extend(watch.advance(time_s, true, slice(i)).map(|kind| (kind.name(), i)));
            }
        };
        follow(0, 60, &|i| seen(i % 8 < 4));
        follow(60, 120, &|_| seen(false));
        follow(120, 180, &|_| None);
        follow(180, 240, &|_| seen(true));
        // 0.25 s are 15 samples.
        assert_eq!(told, [("out-of-slice", 75), ("in-slice", 195)]);
        assert_eq!(watch.advance(4.0, false, seen(false)), None);
        assert_eq!(watch.advance(4.1, true, seen(false)), None, "it has just entered");
        watch.interrupt();
        assert_eq!(watch.advance(6.0, true, seen(false)), None, "it was not followed meanwhile");
        assert_eq!(watch.advance(6.3, true, seen(false)).map(NeedleEventKind::name), Some("out-of-slice"));
    }
}
