//! Settings of the render stage: controls from watchers, and the quality controller.

use std::sync::atomic::Ordering;

use super::{Device, RenderStage};
use crate::pipeline::parts::RenderFault;
use crate::settings::LiveSettings;

impl RenderStage {
    /// Applies the controls received since the last frame.
    pub(super) fn apply_controls(&mut self) {
        let events = &self.parts.events;
        let before = self.parts.controls.live;
        let changes = self.parts.controls.apply_waiting(|text| events.warn(text));
        let metrics = self.parts.metrics.clone();
        metrics.controls.fetch_add(changes.applied, Ordering::Relaxed);
        metrics.refused.fetch_add(changes.refused, Ordering::Relaxed);
        if changes.quit {
            self.parts.stop.request("asked by a watcher");
        }
        if changes.quality && self.parts.quality.is_some() {
            self.note_quality(true);
            self.parts.quality = None;
            self.parts.events.info("quality: set by hand, the budget no longer chooses it");
        }
        if changes.picture {
            self.reconfigure(&before);
            let now_s = self.parts.clock.now().as_secs_f64();
            if let Some(quality) = &mut self.parts.quality {
                quality.rest(now_s);
            }
        }
        if changes.any {
            self.parts.events.settings(&self.parts.controls.live);
        }
    }

    /// Reconfigures the renderer. If it refuses, restores the settings of `before` and returns false.
    fn reconfigure(&mut self, before: &LiveSettings) -> bool {
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

    /// Makes a change of quality if one is due. A frozen picture is not changed.
    pub(super) fn keep_quality(&mut self) {
        if self.parts.controls.live.frozen || !matches!(self.device, Device::Ready(_)) {
            return;
        }
        let now_s = self.parts.clock.now().as_secs_f64();
        let Some(quality) = &mut self.parts.quality else { return };
        let budget_ms = quality.budget_ms();
        if let Some(frame_ms) = quality.over_at_least() {
            let point = quality.point();
            self.parts.events.warn(format!(
                "quality: {point} is the least there is, and frames take {frame_ms:.0} ms of {budget_ms}"
            ));
        }
        let Some(change) = quality.change(now_s) else { return };
        let before = self.parts.controls.live;
        self.parts.controls.live.render.quality = change.to.with_seed(before.render.quality.seed);
        if self.reconfigure(&before) {
            self.pace.begin_anew(self.parts.clock.now());
            let (from, to, ms) = (change.from, change.to, change.frame_ms);
            self.parts.events.info(&format!("quality: {from} -> {to}: frames take {ms:.0} ms of {budget_ms}"));
            self.parts.events.settings(&self.parts.controls.live);
        } else if let Some(quality) = &mut self.parts.quality {
            quality.refused(now_s);
        }
        self.note_quality(false);
    }

    /// Updates the summary of the quality controller.
    pub(super) fn note_quality(&self, by_hand: bool) {
        if let Some(quality) = &self.parts.quality {
            self.parts.metrics.set_quality(quality.summary(by_hand));
        }
    }
}
