//! Render stage: samples the pose as late as possible, renders, and hands frames to the next stages.

mod device;
mod placement;
mod pose;
mod report;
mod settings;
mod trial;
mod untouched;

use std::collections::VecDeque;
use std::sync::atomic::Ordering;
use std::sync::{Arc, PoisonError};
use std::time::Duration;

use tracing::field::Empty;

use self::device::Device;
use self::placement::PlacementWatch;
use self::pose::PoseSampler;
use self::trial::Trial;
use self::untouched::UntouchedWatch;
use super::clock::{Clock, ms};
use super::controls::Controls;
use super::events::Events;
use super::generator_link::GeneratorLink;
use super::metrics::{Metrics, count};
use super::needle_stage::ToFollow;
use super::pace::Pace;
use super::parts::{FrameRenderer, ImageShape, PoseSource, RendererFactory};
use super::rendered::{Rendered, blacken};
use super::replay::is_scored;
use super::shutdown::Stop;
use super::slot::Slot;
use crate::chooser::PointController;
use crate::exam::needle::Sample;
use crate::presented::{FrameInfo, FrameTimeline, PointText, Pool};
use crate::render::{FRAMES_IN_FLIGHT, Frame, FrameQuality};
use crate::settings::Choice;
use crate::sink::live::MapsWanted;

/// Number of buffers of rendered frames: held by the slots, the generator and the presenter, and one to fill.
const FRAMES: usize = 8;

/// Upper limit of a frame's delay while the generator has its turn. The limit is half a frame period if that is less.
const TURN: Duration = Duration::from_millis(250);

/// A frame in flight.
#[derive(Debug)]
struct InFlight {
    info: FrameInfo,
    maps: bool,
    generator: Option<usize>,
    point: Option<Arc<PointText>>,
    /// Expected completion time on the session's clock.
    expected: Duration,
    /// Whether the device has finished the frame.
    done: bool,
}

/// Parts of the stage.
pub(super) struct RenderParts {
    pub(super) clock: Arc<dyn Clock>,
    pub(super) stop: Stop,
    pub(super) events: Events,
    pub(super) metrics: Arc<Metrics>,
    pub(super) factory: Box<dyn RendererFactory>,
    pub(super) controls: Controls,
    /// Controller of the operating point; none: quality and generator stay as set.
    pub(super) points: Option<PointController>,
    /// The station's choice whether to simulate the aperture. The controller may switch its simulation off.
    pub(super) aperture: Choice,
    pub(super) to_presenter: Arc<Slot<Arc<Rendered>>>,
    pub(super) to_generator: Option<Arc<Slot<Arc<Rendered>>>>,
    /// Slot of the needle stage; none without a needle.
    pub(super) to_needle: Option<Arc<Slot<ToFollow>>>,
    pub(super) generator: Option<Arc<GeneratorLink>>,
    /// For each sink that can use segmentation and attenuation, whether it reads them now.
    pub(super) map_readers: Vec<MapsWanted>,
    pub(super) period: Duration,
    /// Time from the sampling of a frame's pose to its deadline.
    pub(super) deadline_after: Duration,
}

impl RenderParts {
    /// Whether the generator or a sink reads the maps of a frame submitted now.
    fn maps_wanted(&self, generator: Option<usize>) -> bool {
        let read = self.generator.as_ref().zip(generator).is_some_and(|(link, generator)| link.reads_maps(generator));
        read || self.map_readers.iter().any(|wanted| wanted())
    }
}

/// The render stage.
pub(super) struct RenderStage {
    parts: RenderParts,
    device: Device,
    /// Wait before the next attempt to reopen a failed device; zero once a frame was rendered.
    backoff: Duration,
    shape: ImageShape,
    pace: Pace,
    /// Time at which the last frame was begun.
    begun: Duration,
    in_flight: VecDeque<InFlight>,
    pool: Pool<Rendered>,
    /// Frame that is received, and dropped, when no buffer is free.
    scratch: Frame,
    poses: PoseSampler,
    /// Number of the next frame.
    number: u64,
    /// Index of the generator for the next frames; none: they stay raw.
    generator: Option<usize>,
    /// Operating point of the next frames, for viewers; none without a controller.
    point: Option<Arc<PointText>>,
    /// Whether the face touched the skin in the last frame with a known contact; none before the first.
    coupled: Option<bool>,
    placement: PlacementWatch,
    untouched: UntouchedWatch,
    /// Trial of the settings that a watcher has changed; none if no trial is in progress.
    trial: Option<Trial>,
}

impl RenderStage {
    /// A stage that starts with `renderer`.
    pub(super) fn new(parts: RenderParts, poses: Box<dyn PoseSource>, renderer: Box<dyn FrameRenderer>) -> Self {
        Self {
            shape: renderer.shape(),
            device: Device::Ready(renderer),
            backoff: Duration::ZERO,
            pace: Pace::new(parts.period, parts.clock.now()),
            begun: Duration::ZERO,
            in_flight: VecDeque::with_capacity(FRAMES_IN_FLIGHT),
            pool: Pool::new(FRAMES),
            scratch: Frame::default(),
            poses: PoseSampler::new(poses, parts.events.clone()),
            number: 0,
            generator: match &parts.points {
                Some(points) => points.point().generator,
                None => parts.generator.is_some().then_some(0),
            },
            point: parts.points.as_ref().map(|points| Arc::new(points.text())),
            coupled: None,
            placement: PlacementWatch::default(),
            untouched: UntouchedWatch::default(),
            trial: None,
            parts,
        }
    }

    /// Renders until a stop is requested, then closes the slots of the next stages.
    pub(super) fn run(mut self) {
        self.parts.events.settings(&self.parts.controls.live);
        self.note_points();
        while !self.parts.stop.is_requested() {
            let submit_at = self.pace.submit_at();
            match self.in_flight.front() {
                // By `submit_at` the oldest frame should be done, or the queue is full.
                Some(oldest)
                    if oldest.done || oldest.expected <= submit_at || self.in_flight.len() == FRAMES_IN_FLIGHT =>
                {
                    self.receive();
                }
                // The generator gets its turn when no frame is in flight.
                Some(_) if self.takes_turns() => self.receive(),
                _ if self.parts.clock.now() < submit_at => {
                    self.parts.stop.wait(submit_at);
                }
                _ if self.gives_way(submit_at) => {}
                _ => self.tick(),
            }
        }
        self.end();
    }

    /// Whether a generator runs on the device that renders the frames. If they ran at once, frame and run would take
    /// twice as long, and the generated picture would miss its frame.
    fn takes_turns(&self) -> bool {
        let Device::Ready(renderer) = &self.device else { return false };
        let is_on = self.generator.is_some() && self.parts.controls.live.generator;
        is_on && self.parts.generator.as_ref().is_some_and(|link| link.takes_turns_with(renderer.compute_device()))
    }

    /// Waits for a generator that runs on the device that renders the frames; returns whether it waited. A generator
    /// slower than a period gets a turn only occasionally, so at least two thirds of the set frame rate remain.
    fn gives_way(&self, submit_at: Duration) -> bool {
        let RenderParts { clock, period, generator, .. } = &self.parts;
        // The next frame is due one period after the last one began. If a frame and a run together take longer than a
        // period, frames fall behind the ticks.
        let due = submit_at.max(self.begun.saturating_add(*period));
        let until = due.saturating_add((*period / 2).min(TURN));
        let shares = match (&self.device, generator) {
            (Device::Ready(renderer), Some(link)) => link.takes_turns_with(renderer.compute_device()),
            _ => false,
        };
        shares && generator.as_ref().is_some_and(|link| link.wait_for_turn(&**clock, until))
    }

    /// Begins a frame.
    fn tick(&mut self) {
        self.take_back();
        self.apply_controls();
        self.keep_point();
        self.reopen();
        let missed = self.pace.missed();
        let frozen = self.parts.controls.live.frozen;
        let scene_time = self.poses.scene_time(self.parts.clock.now(), frozen);
        // Moving surfaces are updated first, so that the pose is sampled as late as possible.
        if let Device::Ready(renderer) = &mut self.device {
            renderer.set_time_s(scene_time.as_secs_f64());
        }
        let info = self.sample();
        self.follow_needle(&info, scene_time);
        count(&self.parts.metrics.produced);
        let now = info.timeline.submitted;
        if let (Some(points), Some(speed), false) = (&mut self.parts.points, info.estimate.speed, info.settings.frozen)
        {
            points.moves(now.as_secs_f64(), speed);
        }
        let generator = self.generator.filter(|_| info.settings.generator);
        let maps = self.parts.maps_wanted(generator);
        match (&mut self.device, info.pose()) {
            (Device::Ready(renderer), Some(pose)) => {
                let _span = tracing::debug_span!("submit", frame = info.number, submitted_ms = ms(now)).entered();
                self.begun = now;
                renderer.set_maps(maps);
                renderer.set_needle(info.needle.and_then(|estimate| estimate.needle));
                match renderer.submit(&pose) {
                    Ok(()) => {
                        let expected = self.pace.submitted(now);
                        let done = renderer.renders_in_submit();
                        self.in_flight.push_back(InFlight {
                            info,
                            maps,
                            generator,
                            point: self.point.clone(),
                            expected,
                            done,
                        });
                    }
                    Err(fault) => {
                        self.pace.ticked(now);
                        count(&self.parts.metrics.device_lost);
                        self.lose(&fault);
                    }
                }
            }
            _ => {
                // Frames in flight are handed on first, to keep the order.
                while !self.in_flight.is_empty() {
                    self.receive();
                }
                self.pace.ticked(now);
                self.without_picture(info);
            }
        }
        self.count_missed(missed);
    }

    /// Adds the ticks missed since `before`, an earlier count of missed ticks, to the metrics.
    fn count_missed(&self, before: u64) {
        self.parts.metrics.missed_ticks.fetch_add(self.pace.missed() - before, Ordering::Relaxed);
    }

    /// Samples the pose of the next frame.
    fn sample(&mut self) -> FrameInfo {
        let clock = &self.parts.clock;
        let number = self.number;
        self.number += 1;
        let span = tracing::debug_span!("sample", frame = number, sampled_ms = Empty, first_byte_ms = Empty).entered();
        let settings = self.parts.controls.live;
        let now_ns = clock.unix_ns();
        let ahead_ns = u64::try_from(self.parts.metrics.expected().as_nanos()).unwrap_or(0);
        let (estimate, needle) = self.poses.sample(now_ns, now_ns.saturating_add(ahead_ns), settings.frozen);
        let now = clock.now();
        let first_byte = estimate.first_byte_ns.map(|ns| clock.since_start(ns));
        span.record("sampled_ms", ms(now));
        first_byte.map(|time| span.record("first_byte_ms", ms(time)));
        let timeline = FrameTimeline { first_byte, sampled: now, submitted: now, ..FrameTimeline::default() };
        FrameInfo { number, estimate, needle, timeline, settings, ..FrameInfo::default() }
    }

    /// Hands the poses of a frame at `scene_time` to the needle stage, if they count in a score.
    fn follow_needle(&self, info: &FrameInfo, scene_time: Duration) {
        let needle = info.needle.filter(|estimate| is_scored(estimate.state)).and_then(|estimate| estimate.needle);
        let Some((slot, needle)) = self.parts.to_needle.as_ref().zip(needle) else { return };
        let (time_s, probe) = (scene_time.as_secs_f64(), info.pose().filter(|_| is_scored(info.estimate.state)));
        slot.put(ToFollow { sample: Sample { time_s, probe, needle: Some(needle) }, probe: info.settings.probe });
    }

    /// Waits for the oldest frame in flight and hands it to the next stages.
    fn receive(&mut self) {
        let Device::Ready(renderer) = &mut self.device else { return };
        let Some(oldest) = self.in_flight.pop_front() else { return };
        let InFlight { info, maps, generator, point, .. } = oldest;
        let timeline = &info.timeline;
        let span = tracing::debug_span!(
            "receive",
            frame = info.number,
            submitted_ms = ms(timeline.submitted),
            rendered_ms = Empty
        )
        .entered();
        let (mut placement, mut untouched) = (None, None);
        let filled = self.pool.fill(|rendered| {
            let received = renderer.receive(rendered.frame.get_mut().unwrap_or_else(PoisonError::into_inner));
            describe(rendered, info, maps, &self.parts, self.shape);
            if received.is_ok() {
                let FrameInfo { timeline, contact, .. } = &rendered.info;
                placement = self.placement.update(timeline.rendered, contact.as_ref());
                rendered.info.misplaced = self.placement.reported();
                untouched = self.untouched.update(&rendered.info);
            }
            (rendered.generator, rendered.point) = (generator, point);
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
        span.record("rendered_ms", ms(now));
        let took = self.pace.rendered(timeline.submitted, now, left);
        self.judge(&info.settings, took);
        if let Some(points) = &mut self.parts.points {
            let quality = FrameQuality::of(&info.settings.render);
            points.rendered(now.as_secs_f64(), quality, 1e3 * took.as_secs_f64());
        }
        match rendered {
            Some(rendered) => {
                self.report_contact(rendered.info.contact);
                placement.into_iter().for_each(|change| self.report_placement(change));
                untouched.into_iter().for_each(|change| self.report_untouched(change));
                self.hand_on(rendered);
            }
            None => count(&self.parts.metrics.frames_held),
        }
    }

    /// Hands on a black frame without a pose, and ends a reported misplacement of the probe.
    fn without_picture(&mut self, mut info: FrameInfo) {
        info.estimate.scene_from_probe = None;
        if self.placement.reset() {
            self.parts.events.end_lasting();
        }
        let filled = self.pool.fill(|rendered| {
            blacken(rendered.frame.get_mut().unwrap_or_else(PoisonError::into_inner), self.shape);
            describe(rendered, info, true, &self.parts, self.shape);
            (rendered.generator, rendered.point) = (None, None);
        });
        match filled {
            Some((rendered, ())) => self.hand_on(rendered),
            None => count(&self.parts.metrics.frames_held),
        }
    }

    fn hand_on(&self, rendered: Arc<Rendered>) {
        if let (Some(generator), Some(link)) = (&self.parts.to_generator, &self.parts.generator)
            && rendered.info.pose().is_some()
            && rendered.generator.is_some()
        {
            link.give(rendered.info.number);
            generator.put(rendered.clone());
        }
        self.parts.to_presenter.put(rendered);
    }

    /// Waits for the frames in flight and closes the slots of the next stages.
    fn end(mut self) {
        let missed = self.pace.missed();
        self.pace.ended(self.parts.stop.requested_at().unwrap_or_else(|| self.parts.clock.now()));
        self.count_missed(missed);
        // Marks set since the last tick belong in the recording.
        let events = &self.parts.events;
        self.parts.controls.apply_waiting(|_| (), |control| events.marks(control));
        if let Device::Ready(renderer) = &mut self.device {
            for _ in self.in_flight.drain(..) {
                // Finish frames in flight before dropping the renderer; faults no longer matter.
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

fn describe(rendered: &mut Rendered, info: FrameInfo, maps: bool, parts: &RenderParts, shape: ImageShape) {
    let timeline = FrameTimeline { rendered: parts.clock.now(), ..info.timeline };
    let contact = rendered.frame.get_mut().unwrap_or_else(PoisonError::into_inner).contact;
    rendered.info = FrameInfo { timeline, contact, ..info };
    rendered.deadline = timeline.sampled.saturating_add(parts.deadline_after);
    (rendered.shape, rendered.maps) = (shape, maps);
}
