//! Presenter stage: chooses each frame's picture and hands the frame to the sinks.

use std::sync::{Arc, PoisonError};

use tracing::field::Empty;

use super::clock::{Clock, NEVER, Signal, ms};
use super::deadline::{DeadlineChooser, near};
use super::events::Events;
use super::freshness::Freshness;
use super::generate_stage::Generated;
use super::generator_link::GeneratorLink;
use super::metrics::{Metrics, count};
use super::rendered::Rendered;
use super::shutdown::Stop;
use super::slot::{Slot, Taken};
use crate::look::{Look, Shape};
use crate::presented::{FrameInfo, FrameSource, FrameTimeline, Pool, PresentedFrame};
use crate::render::Frame;
use crate::settings::ChoiceSettings;
use crate::sink::FrameLog;

/// Number of frame buffers, which all sinks share; without a free buffer, a frame is dropped.
const FRAMES: usize = 64;

/// The presenter stage.
pub(super) struct Presenter {
    pub(super) clock: Arc<dyn Clock>,
    pub(super) stop: Stop,
    pub(super) events: Events,
    pub(super) metrics: Arc<Metrics>,
    pub(super) choice: ChoiceSettings,
    /// Notified by the slots of rendered and of generated frames.
    pub(super) signal: Arc<Signal>,
    pub(super) rendered: Arc<Slot<Arc<Rendered>>>,
    pub(super) generated: Arc<Slot<Arc<Generated>>>,
    pub(super) generator: Option<Arc<GeneratorLink>>,
    pub(super) sinks: Vec<Arc<Slot<Arc<PresentedFrame>>>>,
    /// Number of presented frames after which the session ends, if limited.
    pub(super) frames_max: Option<u64>,
    /// Log of all presented frames, if one is written.
    pub(super) log: Option<FrameLog>,
    /// Whether the user was warned that frames wait for the log.
    pub(super) log_waited: bool,
}

impl Presenter {
    /// Presents rendered frames until the slot is closed. Returns the log, if there is one; the caller finishes it.
    pub(super) fn run(mut self) -> Option<FrameLog> {
        let mut state = State {
            chooser: DeadlineChooser::new(self.choice),
            held: None,
            look: Look::default(),
            freshness: Freshness::default(),
            pool: Pool::new(FRAMES),
        };
        while let Some(rendered) = self.next(&mut state) {
            if self.frames_max.is_some_and(|max| self.metrics.shown(|s| s.presented) >= max) {
                count(&self.metrics.ended);
                continue;
            }
            self.await_own(&rendered, &mut state);
            let source = self.choose(&rendered, &mut state);
            self.present(rendered, source, &mut state);
            if self.frames_max.is_some_and(|max| self.metrics.shown(|s| s.presented) >= max) {
                self.stop.request("all frames are presented");
            }
        }
        self.log
    }

    /// Waits for the next rendered frame; none at the session's end.
    fn next(&self, state: &mut State) -> Option<Arc<Rendered>> {
        loop {
            let seen = self.signal.generation();
            self.check_generator(state);
            match self.rendered.try_take() {
                Taken::Item(rendered) => return Some(rendered),
                Taken::Closed => return None,
                Taken::TimedOut => {
                    let hangs_at = self.generator.as_ref().and_then(|g| g.hangs_at()).unwrap_or(NEVER);
                    self.clock.wait(&self.signal, seen, hangs_at);
                }
            }
        }
    }

    /// Takes a new generated picture, and checks the generator's watchdog.
    fn check_generator(&self, state: &mut State) {
        if let Some(generator) = &self.generator
            && let Some(text) = generator.watch(self.clock.now())
        {
            self.events.warn(text);
        }
        if let Taken::Item(generated) = self.generated.try_take() {
            state.chooser.ready(generated.info.number, generated.run.1, generated.deadline);
            state.held = Some(generated);
        }
    }

    /// Waits for the frame's own generated picture, as long as it can come before the deadline.
    fn await_own(&self, rendered: &Rendered, state: &mut State) {
        let Some(generator) = &self.generator else { return };
        if !state.chooser.waits() || rendered.generator.is_none() || rendered.info.pose().is_none() {
            return;
        }
        loop {
            let seen = self.signal.generation();
            self.check_generator(state);
            let now = self.clock.now();
            let worthwhile = !state.is_own(rendered)
                && now < rendered.deadline
                && !self.stop.is_requested()
                && generator.expected(rendered.info.number, now).is_some_and(|ready| ready <= rendered.deadline);
            if !worthwhile {
                return;
            }
            self.clock.wait(&self.signal, seen, rendered.deadline);
        }
    }

    fn choose(&self, rendered: &Rendered, state: &mut State) -> FrameSource {
        let Some(pose) = rendered.info.pose().filter(|_| rendered.generator.is_some()) else {
            state.chooser.reset();
            return FrameSource::Raw;
        };
        let own = state.is_own(rendered);
        let near = state.held.as_ref().is_some_and(|held| {
            held.size == (rendered.shape.width, rendered.shape.height)
                && held.info.settings.same_picture(&rendered.info.settings)
                && held.info.pose().is_some_and(|at| near(&self.choice, &at, &pose))
        });
        state.chooser.choose(own, near)
    }

    fn present(&mut self, rendered: Arc<Rendered>, source: FrameSource, state: &mut State) {
        let FrameInfo { number: frame, timeline, .. } = rendered.info;
        let span = tracing::debug_span!(
            "present",
            frame,
            ?source,
            sampled_ms = ms(timeline.sampled),
            rendered_ms = ms(timeline.rendered),
            presented_ms = Empty
        )
        .entered();
        let held = state.held.as_deref().filter(|_| source != FrameSource::Raw);
        let number = self.metrics.shown(|s| s.presented);
        let filled = state.pool.fill(|frame| {
            frame.number = number;
            frame.source = source;
            (frame.width, frame.height) = (rendered.shape.width, rendered.shape.height);
            frame.pixel_mm = rendered.shape.pixel_mm;
            maps_into(frame, &rendered);
            if let Some(held) = held {
                frame.image.clear();
                frame.image.extend_from_slice(&held.image);
            }
            let settings = &rendered.info.settings.render;
            let angles = settings.look.independent_angles(&rendered.info.settings.probe);
            let shape = Shape::new(frame.width, frame.pixel_mm, &frame.mask, &settings.image, angles);
            // Without a pose the picture is black. An earlier generated picture must not be shown instead.
            match rendered.info.pose() {
                Some(_) => state.look.apply(&settings.look, shape, &mut frame.image),
                None => state.look.reset(),
            }
            match (held, &mut frame.generator) {
                (Some(held), Some(generator)) => generator.clone_from(&held.generator),
                (held, generator) => *generator = held.map(|held| held.generator.clone()),
            }
            frame.point.clone_from(&rendered.point);
            self.events.notice_into(&mut frame.notice);
            frame.tip_events = self.events.tip_events();
            let inference = held.filter(|held| held.info.number == rendered.info.number).map(|held| held.run);
            let presented = self.clock.now();
            span.record("presented_ms", ms(presented));
            let timeline = FrameTimeline { inference, presented, ..timeline };
            let new = state.freshness.next(&rendered.info, &*self.clock);
            frame.info = FrameInfo { timeline, new, ..rendered.info };
        });
        let Some((frame, ())) = filled else { return count(&self.metrics.frames_held) };
        self.metrics.presented(&frame);
        self.log(&frame);
        for sink in &self.sinks {
            sink.put(frame.clone());
        }
    }

    /// Adds a frame to the log. The log drops no lines: if the disk is too slow, this blocks.
    fn log(&mut self, frame: &PresentedFrame) {
        let Some(log) = &mut self.log else { return };
        match log.push(frame) {
            Ok(false) => {}
            Ok(true) if self.log_waited => {}
            Ok(true) => {
                self.log_waited = true;
                self.events.warn("metrics: the disk is slower than the frames, which wait for it".to_owned());
            }
            Err(error) => self.events.warn(format!("metrics: {error}; no more lines are written")),
        }
    }
}

struct State {
    chooser: DeadlineChooser,
    /// The last generated picture; none before the first.
    held: Option<Arc<Generated>>,
    look: Look,
    freshness: Freshness,
    pool: Pool<PresentedFrame>,
}

impl State {
    /// Whether the last generated picture belongs to this frame.
    fn is_own(&self, rendered: &Rendered) -> bool {
        self.held.as_ref().is_some_and(|held| held.info.number == rendered.info.number)
    }
}

/// Moves the maps if only this stage and the pool hold the frame; copies them if the generator holds it too.
fn maps_into(into: &mut PresentedFrame, rendered: &Arc<Rendered>) {
    if Arc::strong_count(rendered) == 2
        && let Ok(mut frame) = rendered.frame.try_write()
    {
        let Frame { bmode, segmentation, attenuation, mask, .. } = &mut *frame;
        std::mem::swap(&mut into.image, bmode);
        std::mem::swap(&mut into.segmentation, segmentation);
        std::mem::swap(&mut into.attenuation, attenuation);
        std::mem::swap(&mut into.mask, mask);
        return;
    }
    let frame = rendered.frame.read().unwrap_or_else(PoisonError::into_inner);
    into.image.clone_from(&frame.bmode);
    into.segmentation.clone_from(&frame.segmentation);
    into.attenuation.clone_from(&frame.attenuation);
    into.mask.clone_from(&frame.mask);
}
