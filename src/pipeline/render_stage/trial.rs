//! Trial of a watcher's settings: they are taken back if the first frame with them takes too long.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use super::{Device, RenderStage};
use crate::chooser::PointController;
use crate::presented::PointText;
use crate::render::FrameQuality;
use crate::settings::{Change, LiveSettings, SettingsGroup as _};

/// Longest time of a frame that a watcher's settings may cause.
const FRAME_MAX: Duration = Duration::from_secs(1);

/// State before a watcher's change, kept until the first frame with the change is timed.
pub(super) struct Trial {
    before: LiveSettings,
    points: Option<PointController>,
    point: Option<Arc<PointText>>,
    /// Time of the first frame with the change, if it is too long.
    too_long: Option<Duration>,
}

impl RenderStage {
    /// Begins a trial of the current settings, which replace `before`, if frames may take longer with them.
    pub(super) fn begin_trial(&mut self, before: &LiveSettings) {
        let costs = before.change_to(&self.parts.controls.live) > Change::Nothing;
        // If frames took longer than the limit before, the change isn't to blame.
        if costs && self.trial.is_none() && self.pace.service() <= FRAME_MAX {
            let (points, point) = (self.parts.points.clone(), self.point.clone());
            self.trial = Some(Trial { before: *before, points, point, too_long: None });
        }
    }

    /// Judges the trial by a frame that was rendered with `settings` in the time `took`.
    pub(super) fn judge(&mut self, settings: &LiveSettings, took: Duration) {
        // Frames rendered with earlier settings say nothing about the current ones.
        if self.trial.is_none() || !settings.same_picture(&self.parts.controls.live) {
            return;
        }
        match &mut self.trial {
            Some(trial) if took > FRAME_MAX => trial.too_long = Some(took),
            Some(trial) if trial.too_long.is_some() => {}
            _ => self.trial = None,
        }
    }

    /// Takes back the settings that failed their trial.
    pub(super) fn take_back(&mut self) {
        let Some(took) = self.trial.as_ref().and_then(|trial| trial.too_long) else { return };
        let Some(trial) = self.trial.take() else { return };
        let failed = self.parts.controls.live;
        let live = &mut self.parts.controls.live;
        (live.probe, live.render) = (trial.before.probe, trial.before.render);
        if !matches!(self.device, Device::Ready(_)) || !self.reconfigure(&failed) {
            return;
        }
        (self.parts.points, self.point) = (trial.points, trial.point);
        let now = self.parts.clock.now();
        if let Some(points) = &mut self.parts.points {
            points.rest(now.as_secs_f64());
        }
        self.pace.begin_anew(now);
        self.note_points();
        self.parts.metrics.refused.fetch_add(1, Ordering::Relaxed);
        let (quality, took_s, max_s) = (FrameQuality::of(&failed.render), took.as_secs_f64(), FRAME_MAX.as_secs_f64());
        self.parts.events.warn(format!("not set: a frame ({quality}) took {took_s:.1} s, longer than {max_s:.0} s"));
        self.parts.events.settings(&self.parts.controls.live);
    }
}
