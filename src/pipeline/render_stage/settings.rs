//! Settings of the render stage: controls from watchers, and the controller of operating points.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::{Device, RenderStage};
use crate::chooser::PointController;
use crate::pipeline::generator_link::RunEnd;
use crate::pipeline::parts::RenderFault;
use crate::presented::PointText;
use crate::render::FrameQuality;
use crate::settings::LiveSettings;

impl RenderStage {
    /// Applies the controls received since the last frame.
    pub(super) fn apply_controls(&mut self) {
        let events = &self.parts.events;
        let before = self.parts.controls.live;
        let mut changes = self.parts.controls.apply_waiting(|text| events.warn(text), |control| events.marks(control));
        let metrics = self.parts.metrics.clone();
        metrics.controls.fetch_add(changes.applied, Ordering::Relaxed);
        metrics.refused.fetch_add(changes.refused, Ordering::Relaxed);
        if changes.quit {
            self.parts.stop.request("asked by a watcher");
        }
        if changes.quality && self.parts.points.as_ref().is_some_and(PointController::chooses_quality) {
            // All samples and the effect `aperture` come back, which the budget may have left out.
            let render = self.parts.controls.live.render;
            let whole = FrameQuality { coarse: false, aperture: true, ..FrameQuality::of(&render) };
            self.parts.controls.live.render = whole.apply(&render, self.parts.aperture);
            changes.picture |= !before.same_picture(&self.parts.controls.live);
            changes.any |= before != self.parts.controls.live;
        }
        if changes.picture && self.reconfigure(&before) {
            self.begin_trial(&before);
        }
        if changes.picture {
            let now_s = self.parts.clock.now().as_secs_f64();
            if let Some(points) = &mut self.parts.points {
                points.rest(now_s);
            }
        }
        if changes.quality {
            self.hold_quality();
        }
        if changes.any {
            self.parts.events.settings(&self.parts.controls.live);
        }
    }

    /// Ends the automatic choice of the quality, because a watcher has set the quality.
    fn hold_quality(&mut self) {
        let now_s = self.parts.clock.now().as_secs_f64();
        let quality = FrameQuality::of(&self.parts.controls.live.render);
        let Some(points) = &mut self.parts.points else { return };
        if points.chooses_quality() {
            self.parts.events.info("quality: set by hand, the budget no longer chooses it");
        }
        let goes_on = points.hold(now_s, quality);
        self.point = goes_on.then(|| {
            Arc::new(PointText { name: points.name(&points.point()), reason: "the quality was set by hand".to_owned() })
        });
        self.note_points();
        if !goes_on {
            self.parts.points = None;
        }
    }

    /// Reconfigures the renderer. If it refuses, restores the settings of `before` and returns false.
    pub(super) fn reconfigure(&mut self, before: &LiveSettings) -> bool {
        while !self.in_flight.is_empty() {
            self.receive();
        }
        let LiveSettings { probe, render, .. } = self.parts.controls.live;
        let Device::Ready(renderer) = &mut self.device else { return true };
        let _span = tracing::debug_span!("reconfigure").entered();
        match renderer.reconfigure(&probe, &render) {
            Ok(()) => self.shape = renderer.shape(),
            Err(RenderFault::Refused(reason)) => {
                let live = &mut self.parts.controls.live;
                (live.probe, live.render) = (before.probe, before.render);
                self.parts.events.warn(format!("not set: {reason}"));
                return false;
            }
            Err(fault) => self.lose(&fault),
        }
        true
    }

    /// Reports ended generator runs to the controller, and makes its change of the operating point, if one is due. A
    /// frozen picture is not changed.
    pub(super) fn keep_point(&mut self) {
        let now_s = self.parts.clock.now().as_secs_f64();
        let Some(points) = &mut self.parts.points else { return };
        while let Some(run) = self.parts.generator.as_ref().and_then(|link| link.next_run()) {
            match run.end {
                RunEnd::Done => points.ran(now_s, run.generator, 1e3 * run.took.as_secs_f64()),
                RunEnd::Terminated => points.terminated(now_s, run.generator, 1e3 * run.took.as_secs_f64()),
                RunEnd::Failed(reason) => points.failed(run.generator, &reason),
            }
        }
        points.allow_generators(self.parts.controls.live.generator);
        if self.parts.controls.live.frozen || !matches!(self.device, Device::Ready(_)) {
            return;
        }
        if let Some(overrun) = points.over_at_least(now_s) {
            let (point, limit_ms) = (points.name(&points.point()), points.limit_ms());
            self.parts.events.warn(format!("quality: no point keeps {limit_ms:.0} ms now; {point}: {overrun}"));
        }
        let Some(change) = points.change(now_s) else { return };
        // The controller judges frame times from here on, so a watcher's trial ends.
        self.trial = None;
        let [from, to] = [&change.from, &change.to].map(|point| points.name(point));
        let before = self.parts.controls.live;
        let renders_anew = change.to.quality != change.from.quality;
        if renders_anew {
            self.parts.controls.live.render = change.to.quality.apply(&before.render, self.parts.aperture);
        }
        if !renders_anew || self.reconfigure(&before) {
            self.generator = change.to.generator;
            self.point = Some(Arc::new(PointText { name: to.clone(), reason: change.reason.clone() }));
            if renders_anew {
                self.pace.begin_anew(self.parts.clock.now());
            }
            self.parts.events.info(&format!("quality: {from} -> {to}: {}", change.reason));
            self.parts.events.settings(&self.parts.controls.live);
        } else if let Some(points) = &mut self.parts.points {
            points.refused(now_s);
        }
        self.note_points();
    }

    /// Updates the session's summary of the operating points.
    pub(super) fn note_points(&self) {
        if let Some(points) = &self.parts.points {
            self.parts.metrics.set_points(points.summary());
        }
    }
}
