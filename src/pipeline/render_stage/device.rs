//! Loss of the render stage's device, and attempts to open it again.

use std::time::Duration;

use super::RenderStage;
use crate::pipeline::metrics::count;
use crate::pipeline::parts::{FrameRenderer, RenderFault};

/// Shortest and longest wait before a device that failed repeatedly is reopened.
const BACKOFF: (Duration, Duration) = (Duration::from_millis(250), Duration::from_secs(5));

/// State of the device.
pub(super) enum Device {
    /// Renders frames.
    Ready(Box<dyn FrameRenderer>),
    /// Lost; to be reopened at the time `again`.
    Lost { again: Duration },
}

impl RenderStage {
    /// Gives up the device and all frames in flight.
    pub(super) fn lose(&mut self, fault: &RenderFault) {
        for _ in self.in_flight.drain(..) {
            count(&self.parts.metrics.device_lost);
        }
        count(&self.parts.metrics.losses);
        self.pace.begin_anew(self.parts.clock.now());
        // First present a black frame with the notice: building may take seconds.
        let wait = self.back_off().max(self.parts.period);
        let lost = Device::Lost { again: self.parts.clock.now().saturating_add(wait) };
        let given_up = std::mem::replace(&mut self.device, lost);
        // A driver that is stuck may block the thread that releases its memory, so another thread drops the renderer.
        if let Err(error) = std::thread::Builder::new().name("lost renderer".to_owned()).spawn(move || drop(given_up)) {
            tracing::warn!("the lost renderer has no thread to end on: {error}");
        }
        self.parts.events.warn(format!("the renderer failed and is built anew: {fault}"));
    }

    /// Wait before the next attempt, longer each time.
    fn back_off(&mut self) -> Duration {
        let wait = self.backoff;
        self.backoff = (2 * wait).clamp(BACKOFF.0, BACKOFF.1);
        wait
    }

    /// Reopens a lost device once its wait is over.
    pub(super) fn reopen(&mut self) {
        let Device::Lost { again } = self.device else { return };
        if self.parts.clock.now() < again {
            return;
        }
        let _span = tracing::info_span!("rebuild").entered();
        match self.parts.factory.build(&self.parts.controls.live.probe, &self.parts.controls.live.render) {
            Ok(renderer) => {
                self.shape = renderer.shape();
                self.device = Device::Ready(renderer);
                self.pace.begin_anew(self.parts.clock.now());
                count(&self.parts.metrics.rebuilt);
                self.parts.events.info("the renderer was built anew");
            }
            Err(fault) => {
                let wait = self.back_off().max(BACKOFF.0);
                self.device = Device::Lost { again: self.parts.clock.now().saturating_add(wait) };
                let wait_s = wait.as_secs_f64();
                self.parts.events.warn(format!("no renderer, next attempt in {wait_s:.2} s: {fault}"));
            }
        }
    }
}
