//! Generator stage, in parallel with the renderer.

use std::sync::{Arc, PoisonError};
use std::time::Duration;

use tracing::field::Empty;

use super::clock::{Clock, NEVER, lock, ms};
use super::events::Events;
use super::generator_link::{GeneratorLink, Run, RunEnd};
use super::parts::{FrameGenerators, GenerateError};
use super::rendered::Rendered;
use super::slot::{Slot, Taken};
use crate::presented::{FrameInfo, Pool};

/// Number of buffers of generated frames: the presenter holds two during an exchange, the slot one, and one is filled.
const FRAMES: usize = 4;

/// A generated picture.
#[derive(Debug, Default)]
pub(super) struct Generated {
    /// Number, pose and settings of the rendered frame.
    pub(super) info: FrameInfo,
    /// Width and height of the rendered frame, pixels.
    pub(super) size: (u32, u32),
    /// Grey levels [height × width].
    pub(super) image: Vec<u8>,
    /// Start and end of the generator's run.
    pub(super) run: (Duration, Duration),
    /// Deadline of the rendered frame.
    pub(super) deadline: Duration,
    /// Name of the generator.
    pub(super) generator: String,
}

/// The generator stage.
pub(super) struct GenerateStage {
    pub(super) clock: Arc<dyn Clock>,
    pub(super) events: Events,
    pub(super) generators: Box<dyn FrameGenerators>,
    pub(super) link: Arc<GeneratorLink>,
    pub(super) from_renderer: Arc<Slot<Arc<Rendered>>>,
    pub(super) to_presenter: Arc<Slot<Arc<Generated>>>,
}

impl GenerateStage {
    /// Translates the newest frame in a loop until the slot is closed.
    pub(super) fn run(mut self) {
        let mut pool = Pool::new(FRAMES);
        let mut failing = false;
        while let Taken::Item(rendered) = self.from_renderer.take(NEVER) {
            let number = rendered.info.number;
            // The first frames after a change were rendered without maps (segmentation and attenuation).
            let ready = |generator: &usize| rendered.maps || !self.generators.reads_maps(*generator);
            match rendered.generator.filter(ready) {
                Some(generator) => self.translate(rendered, generator, &mut pool, &mut failing),
                None => lock(&self.link.state).counts.dropped += 1,
            }
            self.link.done_with(number, &*self.clock);
            // Without a generated picture, the presenter must not wait until the deadline.
            self.to_presenter.wake();
        }
        self.to_presenter.close();
    }

    fn translate(&mut self, rendered: Arc<Rendered>, generator: usize, pool: &mut Pool<Generated>, failing: &mut bool) {
        let started = self.clock.now();
        let frame = rendered.info.number;
        let span = tracing::debug_span!("infer", frame, started_ms = ms(started), ended_ms = Empty).entered();
        self.link.begin(frame, started);
        let filled = pool.fill(|generated| {
            let frame = rendered.frame.read().unwrap_or_else(PoisonError::into_inner);
            generated.image.clear();
            let result = self.generators.generate(generator, &frame, &mut generated.image);
            let (found, expected) = (generated.image.len(), frame.bmode.len());
            if result.is_ok() && found != expected {
                return Err(GenerateError::Failed(format!("it gave {found} pixels for a frame of {expected}")));
            }
            generated.info = rendered.info;
            generated.size = (frame.width, frame.height);
            generated.deadline = rendered.deadline;
            generated.run = (started, self.clock.now());
            generated.generator.clear();
            generated.generator.push_str(self.generators.name(generator));
            result
        });
        // Released early: the presenter can then move the frame instead of copying it.
        drop(rendered);
        let ended = self.clock.now();
        span.record("ended_ms", ms(ended));
        let took = ended.saturating_sub(started);
        if self.link.end() {
            let after_s = took.as_secs_f64();
            self.events.info(&format!("the generator that was given up is back after {after_s:.1} s"));
        }
        let mut state = lock(&self.link.state);
        // Without a free buffer the generator did not run.
        let end = filled.as_ref().map(|(_, result)| match result {
            Ok(()) => RunEnd::Done,
            Err(GenerateError::Terminated) => RunEnd::Terminated,
            Err(GenerateError::Failed(reason)) => RunEnd::Failed(reason.clone()),
        });
        if let Some(end) = end {
            state.report(Run { generator, took, end });
        }
        match filled {
            Some((generated, Ok(()))) => {
                state.took(took);
                state.counts.done += 1;
                state.counts.late += u64::from(ended > generated.deadline);
                drop(state);
                *failing = false;
                self.to_presenter.put(generated);
            }
            Some((_, Err(reason))) => {
                state.counts.failed += 1;
                drop(state);
                // Only the first of consecutive failures is logged. The controller of operating points stops using a
                // generator that keeps failing.
                if !std::mem::replace(failing, true) {
                    let generator = self.generators.name(generator);
                    self.events.warn(format!("generator {generator} failed: {reason}; the raw frame is shown"));
                }
            }
            None => state.counts.dropped += 1,
        }
    }
}
