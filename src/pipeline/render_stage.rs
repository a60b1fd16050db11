//! Samples the pose at the last moment, renders, and hands frames on.

use std::collections::VecDeque;
use std::sync::{Arc, PoisonError};
use std::time::Duration;

use super::clock::Clock;
use super::controls::Controls;
use super::events::Events;
use super::frames::Pool;
use super::generator_link::GeneratorLink;
use super::metrics::{Metrics, count};
use super::pace::Pace;
use super::parts::{FrameRenderer, ImageShape, PoseSample, PoseSource, RenderFault, RendererFactory};
use super::quality_budget::QualityBudget;
use super::rendered::{Rendered, blacken};
use super::shutdown::Stop;
use super::slot::Slot;
use crate::pose::{Pose, TrackingState};
use crate::render::{FRAMES_IN_FLIGHT, Frame, QualityPoint, RenderSettings};
use crate::sink::live::{FrameTimeline, LiveSettings, MapsWanted};
use crate::transducer::Probe;

/// Rendered frames that stages may hold: in each slot, at work in the generator and the presenter, and one to fill.
const FRAMES: usize = 8;

/// Shortest and longest wait before a device that failed again is opened.
const BACKOFF: (Duration, Duration) = (Duration::from_millis(250), Duration::from_secs(5));

/// A frame gives way to a generated picture for half a period, and no longer than this.
const TURN: Duration = Duration::from_millis(250);

/// A frame in flight.
#[derive(Debug)]
struct InFlight {
    number: u64,
    sample: PoseSample,
    timeline: FrameTimeline,
    settings: LiveSettings,
    maps: bool,
    /// When it is expected to be done.
    expected: Duration,
    /// Whether it is done.
    done: bool,
}

/// Where the renderer is.
enum Device {
    Ready(Box<dyn FrameRenderer>),
    /// Opened again at this time.
    Lost {
        again: Duration,
    },
}

/// What the stage is put together from.
pub(super) struct RenderParts {
    pub(super) clock: Arc<dyn Clock>,
    pub(super) stop: Stop,
    pub(super) events: Events,
    pub(super) metrics: Arc<Metrics>,
    pub(super) factory: Box<dyn RendererFactory>,
    pub(super) poses: Box<dyn PoseSource>,
    pub(super) controls: Controls,
    /// Keeps the quality at what the machine affords; none: it stays as it is set.
    pub(super) quality: Option<QualityBudget>,
    pub(super) to_presenter: Arc<Slot<Arc<Rendered>>>,
    pub(super) to_generator: Option<Arc<Slot<Arc<Rendered>>>>,
    pub(super) generator: Option<Arc<GeneratorLink>>,
    /// Sinks that may read segmentation and attenuation.
    pub(super) map_readers: Vec<MapsWanted>,
    pub(super) period: Duration,
    pub(super) budget: Duration,
}

impl RenderParts {
    /// Whether the generator or a sink reads the maps of a frame that is submitted now.
    fn maps_wanted(&self, settings: &LiveSettings) -> bool {
        let generator = self.generator.as_ref().is_some_and(|link| link.reads_maps());
        (generator && settings.enhance) || self.map_readers.iter().any(|wanted| wanted())
    }
}

/// The stage.
pub(super) struct RenderStage {
    parts: RenderParts,
    device: Device,
    /// Wait before a device that fails again is opened; zero once it gave a frame.
    backoff: Duration,
    shape: ImageShape,
    pace: Pace,
    /// When the last frame was begun.
    begun: Duration,
    in_flight: VecDeque<InFlight>,
    pool: Pool<Rendered>,
    /// Takes a frame for which no memory is left.
    scratch: Frame,
    /// Pose of a picture that stands still.
    frozen: Option<Pose>,
    last_pose: Option<Pose>,
    /// Time of the scene that was rendered last: it stands still with the picture.
    scene_time: Option<Duration>,
    tracking: TrackingState,
    number: u64,
}

impl RenderStage {
    /// A stage that begins with `renderer`.
    pub(super) fn new(parts: RenderParts, renderer: Box<dyn FrameRenderer>) -> Self {
        let live = parts.controls.live();
        Self {
            shape: renderer.shape(),
            device: Device::Ready(renderer),
            backoff: Duration::ZERO,
            pace: Pace::new(parts.period, parts.clock.now()),
            begun: Duration::ZERO,
            in_flight: VecDeque::with_capacity(FRAMES_IN_FLIGHT),
            pool: Pool::new(FRAMES, move || Rendered::empty(live)),
            scratch: Frame::default(),
            frozen: None,
            last_pose: None,
            scene_time: None,
            tracking: TrackingState::Lost,
            number: 0,
            parts,
        }
    }

    /// Renders until the session is to stop, then closes the slots behind it.
    pub(super) fn run(mut self) {
        self.parts.events.settings(&self.parts.controls.live());
        self.note_quality(false);
        while !self.parts.stop.is_requested() {
            let submit_at = self.pace.submit_at();
            match self.in_flight.front() {
                // The oldest is done by then, or there is no room for another.
                Some(oldest)
                    if oldest.done || oldest.expected <= submit_at || self.in_flight.len() == FRAMES_IN_FLIGHT =>
                {
                    self.receive();
                }
                _ if self.parts.clock.now() < submit_at => {
                    self.parts.stop.wait(submit_at);
                }
                _ if self.gives_way(submit_at) => {}
                _ => self.tick(),
            }
        }
        self.end();
    }

    /// Waits where frames and generated pictures are made on the same processors and one of the latter is still at work:
    /// at once both would take twice as long, and the picture would miss its frame. Returns whether it waited. A generator
    /// that isn't about to be done gets a turn now and then only: frames come at two thirds of their rate at the least.
    fn gives_way(&self, submit_at: Duration) -> bool {
        let RenderParts { clock, period, generator, .. } = &self.parts;
        // From when it could be there at the cadence: where both take longer than a period, frames come later and later.
        let due = submit_at.max(self.begun.saturating_add(*period));
        let until = due.saturating_add((*period / 2).min(TURN));
        let on_processors = matches!(&self.device, Device::Ready(renderer) if renderer.on_processors());
        on_processors && generator.as_ref().is_some_and(|link| link.wait_for_turn(&**clock, until))
    }

    /// Begins a frame.
    fn tick(&mut self) {
        self.apply_controls();
        self.keep_quality();
        self.reopen();
        let missed = self.pace.missed();
        let sample = self.sample();
        let now = self.parts.clock.now();
        let first_byte = sample.first_byte_ns.map(|ns| self.parts.clock.since_start(ns));
        let timeline = FrameTimeline { first_byte, sampled: now, submitted: now, ..FrameTimeline::default() };
        let number = self.number;
        self.number += 1;
        count(&self.parts.metrics.produced);
        let scene_time = self.scene_time(now);
        let settings = self.parts.controls.live();
        let maps = self.parts.maps_wanted(&settings);
        match (&mut self.device, sample.scene_from_probe) {
            (Device::Ready(renderer), Some(pose)) => {
                let _span = tracing::debug_span!("submit", number).entered();
                self.begun = now;
                renderer.set_maps(maps);
                renderer.set_time_s(scene_time.as_secs_f64());
                match renderer.submit(&pose) {
                    Ok(()) => {
                        let expected = self.pace.submitted(now);
                        let done = renderer.on_processors();
                        let begun = InFlight { number, sample, timeline, settings, maps, expected, done };
                        self.in_flight.push_back(begun);
                    }
                    Err(fault) => {
                        self.pace.ticked(now);
                        count(&self.parts.metrics.device_lost);
                        self.lose(&fault);
                    }
                }
            }
            _ => {
                // Frames stay in order: what is in flight comes first.
                while !self.in_flight.is_empty() {
                    self.receive();
                }
                self.pace.ticked(now);
                self.without_picture(number, &sample, timeline);
            }
        }
        let missed = self.pace.missed() - missed;
        self.parts.metrics.missed_ticks.fetch_add(missed, std::sync::atomic::Ordering::Relaxed);
    }

    /// The pose for a frame that is submitted now.
    fn sample(&mut self) -> PoseSample {
        let now_ns = self.parts.clock.unix_ns();
        let ahead_ns = u64::try_from(self.parts.metrics.expected().as_nanos()).unwrap_or(0);
        let mut sample = self.parts.poses.sample(now_ns, now_ns.saturating_add(ahead_ns));
        self.parts.events.pose(&sample);
        if sample.state != self.tracking {
            match (self.tracking, sample.state) {
                (TrackingState::Good | TrackingState::Held, TrackingState::Stale) => {
                    self.parts.events.warn("the tracker is silent: the picture no longer follows the probe".to_owned());
                }
                (_, TrackingState::Lost) => self.parts.events.warn("tracking lost".to_owned()),
                (TrackingState::Stale | TrackingState::Lost, TrackingState::Good) => {
                    self.parts.events.info("tracking");
                }
                _ => {}
            }
            self.tracking = sample.state;
        }
        if sample.state == TrackingState::Lost {
            sample.scene_from_probe = None;
        }
        if self.parts.controls.frozen {
            self.frozen = self.frozen.or(self.last_pose).or(sample.scene_from_probe);
            sample.scene_from_probe = self.frozen;
        } else {
            self.frozen = None;
            self.last_pose = sample.scene_from_probe;
        }
        sample
    }

    /// The scene's time for a frame that is submitted `now`.
    fn scene_time(&mut self, now: Duration) -> Duration {
        let held = self.scene_time.filter(|_| self.parts.controls.frozen);
        *self.scene_time.insert(held.unwrap_or(now))
    }

    fn apply_controls(&mut self) {
        let events = &self.parts.events;
        let before = (self.parts.controls.probe, self.parts.controls.settings);
        let changes = self.parts.controls.apply_waiting(|text| events.warn(text));
        let metrics = self.parts.metrics.clone();
        metrics.controls.fetch_add(changes.applied, std::sync::atomic::Ordering::Relaxed);
        metrics.refused.fetch_add(changes.refused, std::sync::atomic::Ordering::Relaxed);
        if changes.quit {
            self.parts.stop.request("asked by a watcher");
        }
        if changes.quality && self.parts.quality.is_some() {
            self.note_quality(true);
            self.parts.quality = None;
            self.parts.events.info("quality: set by hand, the budget no longer chooses it");
        }
        if changes.picture {
            self.reconfigure(before);
            let now_s = self.parts.clock.now().as_secs_f64();
            if let Some(quality) = &mut self.parts.quality {
                quality.rest(now_s);
            }
        }
        if changes.any {
            self.parts.events.settings(&self.parts.controls.live());
        }
    }

    /// Brings the settings to the renderer. False where it refuses them: they are as `before` again.
    fn reconfigure(&mut self, before: (Probe, RenderSettings)) -> bool {
        while !self.in_flight.is_empty() {
            self.receive();
        }
        let (probe, settings) = (self.parts.controls.probe, self.parts.controls.settings);
        let Device::Ready(renderer) = &mut self.device else { return true };
        let _span = tracing::debug_span!("reconfigure").entered();
        match renderer.reconfigure(&probe, &settings) {
            Ok(()) => self.shape = renderer.shape(),
            Err(RenderFault::Refused(reason)) => {
                (self.parts.controls.probe, self.parts.controls.settings) = before;
                self.parts.events.warn(format!("not set: {reason}"));
                return false;
            }
            Err(fault) => self.lose(&fault),
        }
        true
    }

    /// Takes another quality where the budget asks for one. A picture that stands still stays as it is.
    fn keep_quality(&mut self) {
        if self.parts.controls.frozen || !matches!(self.device, Device::Ready(_)) {
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
        let before = (self.parts.controls.probe, self.parts.controls.settings);
        self.parts.controls.settings.quality = change.to.with_seed(before.1.quality.seed);
        if self.reconfigure(before) {
            self.pace.begin_anew(self.parts.clock.now());
            let (from, to, ms) = (change.from, change.to, change.frame_ms);
            self.parts.events.info(&format!("quality: {from} -> {to}: frames take {ms:.0} ms of {budget_ms}"));
            self.parts.events.settings(&self.parts.controls.live());
        } else if let Some(quality) = &mut self.parts.quality {
            quality.refused(now_s);
        }
        self.note_quality(false);
    }

    /// Notes for the summary what the budget did.
    fn note_quality(&self, by_hand: bool) {
        if let Some(quality) = &self.parts.quality {
            self.parts.metrics.set_quality(quality.summary(by_hand));
        }
    }

    /// Waits for the oldest frame in flight and hands it on.
    fn receive(&mut self) {
        let Device::Ready(renderer) = &mut self.device else { return };
        let Some(oldest) = self.in_flight.pop_front() else { return };
        let _span = tracing::debug_span!("receive", number = oldest.number).entered();
        let filled = self.pool.fill(|rendered| {
            let received = renderer.receive(rendered.frame.get_mut().unwrap_or_else(PoisonError::into_inner));
            describe(rendered, &oldest, &self.parts, self.shape);
            received
        });
        let (rendered, received) = match filled {
            Some((rendered, received)) => (Some(rendered), received),
            None => (None, renderer.receive(&mut self.scratch)),
        };
        if let Err(fault) = received {
            count(&self.parts.metrics.device_lost);
            drop(rendered);
            return self.lose(&fault);
        }
        self.backoff = Duration::ZERO;
        let left = u32::try_from(self.in_flight.len()).unwrap_or(0);
        let now = self.parts.clock.now();
        let took = self.pace.rendered(oldest.timeline.submitted, now, left);
        if let Some(quality) = &mut self.parts.quality {
            let point = QualityPoint::new(oldest.settings.rays, oldest.settings.layers);
            quality.frame(now.as_secs_f64(), point, 1e3 * took.as_secs_f64());
        }
        match rendered {
            Some(rendered) => self.hand_on(rendered),
            None => count(&self.parts.metrics.frames_held),
        }
    }

    /// A frame that says that there is no picture.
    fn without_picture(&mut self, number: u64, sample: &PoseSample, timeline: FrameTimeline) {
        let sample = PoseSample { scene_from_probe: None, ..*sample };
        let settings = self.parts.controls.live();
        let expected = Duration::ZERO;
        let begun = InFlight { number, sample, timeline, settings, maps: true, expected, done: true };
        let filled = self.pool.fill(|rendered| {
            blacken(rendered.frame.get_mut().unwrap_or_else(PoisonError::into_inner), self.shape);
            describe(rendered, &begun, &self.parts, self.shape);
        });
        match filled {
            Some((rendered, ())) => self.hand_on(rendered),
            None => count(&self.parts.metrics.frames_held),
        }
    }

    fn hand_on(&self, rendered: Arc<Rendered>) {
        if let (Some(generator), Some(link)) = (&self.parts.to_generator, &self.parts.generator)
            && rendered.pose.is_some()
            && rendered.settings.enhance
        {
            link.give(rendered.number);
            generator.put(rendered.clone());
        }
        self.parts.to_presenter.put(rendered);
    }

    /// The device is lost with all that is in flight.
    fn lose(&mut self, fault: &RenderFault) {
        for _ in self.in_flight.drain(..) {
            count(&self.parts.metrics.device_lost);
        }
        count(&self.parts.metrics.losses);
        self.pace.begin_anew(self.parts.clock.now());
        // A frame that says so comes first: building may take seconds.
        let wait = self.back_off().max(self.parts.period);
        self.device = Device::Lost { again: self.parts.clock.now().saturating_add(wait) };
        self.parts.events.warn(format!("the renderer failed and is built anew: {fault}"));
    }

    /// The wait before the next attempt, longer each time.
    fn back_off(&mut self) -> Duration {
        let wait = self.backoff;
        self.backoff = (2 * wait).clamp(BACKOFF.0, BACKOFF.1);
        wait
    }

    /// Opens a lost device again, if it is time to.
    fn reopen(&mut self) {
        let Device::Lost { again } = self.device else { return };
        if self.parts.clock.now() < again {
            return;
        }
        let _span = tracing::info_span!("rebuild").entered();
        match self.parts.factory.build(&self.parts.controls.probe, &self.parts.controls.settings) {
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

    /// Lets the device finish, and says to the stages behind that nothing more comes.
    fn end(mut self) {
        if let Device::Ready(renderer) = &mut self.device {
            for _ in self.in_flight.drain(..) {
                // What it was given is finished before it is dropped; a fault now changes nothing any more.
                let _ = renderer.receive(&mut self.scratch);
                count(&self.parts.metrics.ended);
            }
        }
        if let Some(generator) = &self.parts.to_generator {
            generator.close();
        }
        self.parts.to_presenter.close();
    }
}

fn describe(rendered: &mut Rendered, begun: &InFlight, parts: &RenderParts, shape: ImageShape) {
    rendered.number = begun.number;
    rendered.shape = shape;
    rendered.pose = begun.sample.scene_from_probe;
    rendered.tracking = begun.sample.state;
    rendered.timeline = FrameTimeline { rendered: parts.clock.now(), ..begun.timeline };
    rendered.deadline = begun.timeline.sampled.saturating_add(parts.budget);
    rendered.settings = begun.settings;
    rendered.maps = begun.maps;
}
