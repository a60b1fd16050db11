//! Start and supervision of a session's stages.

mod ending;

use std::io;
use std::sync::Arc;
use std::time::Duration;

use thiserror::Error;
use tokio::sync::mpsc;

use super::clock::{Clock, Signal, SystemClock};
use super::controls::{CONTROLS_WAITING, Controls};
use super::events::{Events, Observer};
use super::generate_stage::GenerateStage;
use super::generator_link::GeneratorLink;
use super::local_renderer::LocalRendererFactory;
use super::metrics::{Metrics, Status, counted};
use super::needle_stage::NeedleStage;
use super::parts::{FrameGenerators, FrameRenderer, PoseSource, RendererFactory};
use super::presenter::Presenter;
use super::render_stage::{RenderParts, RenderStage};
use super::rendered::Rendered;
use super::shutdown::{Part, Stop, Thread, spawn};
use super::sink_stage::SinkStage;
use super::slot::Slot;
use super::summary::Summary;
use super::tracker_watch::{TrackerNotice, TrackerWatch};
use crate::chooser::PointController;
use crate::exam::needle::NeedleWatch;
use crate::render::{RenderError, RenderSettings, Renderer};
use crate::settings::{Choice, Control, Effect, LiveSettings, PipelineSettings};
use crate::sink::FrameLog;
use crate::sink::live::LiveSink;
use crate::transducer::Probe;

/// Period of status reports.
const STATUS_PERIOD: Duration = Duration::from_millis(250);

/// Limits at which a session ends automatically.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Limits {
    /// Duration of the session, if limited.
    pub duration: Option<Duration>,
    /// Number of presented frames, if limited.
    pub frames: Option<u64>,
}

/// Errors at the start of a session.
#[derive(Debug, Error)]
pub enum PipelineError {
    /// The system cannot start another thread.
    #[error("cannot start the thread `{name}`: {source}")]
    Thread {
        /// Name of the thread.
        name: String,
        /// Cause.
        source: io::Error,
    },
}

/// Parts of a session.
pub struct Parts {
    /// Clock of the session.
    pub clock: Arc<dyn Clock>,
    /// Request for the session's end.
    pub stop: Stop,
    /// Source of the probe's poses.
    pub poses: Box<dyn PoseSource>,
    /// Renderer, configured with `probe` and `render`.
    pub renderer: Box<dyn FrameRenderer>,
    /// Factory of a new renderer when the device is lost.
    pub factory: Box<dyn RendererFactory>,
    /// Initial probe.
    pub probe: Probe,
    /// Settings of the renderer at the start.
    pub render: RenderSettings,
    /// Controller of the operating point, which starts at the quality of `render`. Without a controller, the quality
    /// stays as set, and the first generator runs.
    pub points: Option<PointController>,
    /// The station's choice whether to simulate the aperture. The controller may switch the aperture off.
    pub aperture: Choice,
    /// Generators; none: raw frames are shown.
    pub generators: Option<Box<dyn FrameGenerators>>,
    /// Watch of the needle's tip in the renderer's scene, before its first sample; none: no events of the tip.
    pub needle: Option<NeedleWatch>,
    /// Sinks of the presented frames.
    pub sinks: Vec<Box<dyn LiveSink>>,
    /// Log of all presented frames; none: no log is written.
    pub log: Option<FrameLog>,
    /// Controls from watchers.
    pub controls: mpsc::Receiver<Control>,
    /// Observer that records events, poses and settings; none: they are not recorded.
    pub observer: Option<Arc<dyn Observer>>,
    /// State of the tracker, which is shown and summarised; none without a tracker.
    pub tracker: Option<TrackerWatch>,
    /// Parts that end before all stages: the tracker.
    pub before: Vec<Box<dyn Part>>,
    /// Parts that end after all sinks: the recorder.
    pub after: Vec<Box<dyn Part>>,
}

impl Parts {
    /// Parts of a session on the system's clock that shows `poses` at a fixed quality. It has no sink, log, generator
    /// or recording yet. Watchers send their controls through the sender.
    ///
    /// # Errors
    /// Errors of [`Renderer::new`](crate::render::Renderer::new).
    pub fn new(
        poses: impl PoseSource + 'static,
        factory: LocalRendererFactory,
        probe: Probe,
        render: RenderSettings,
    ) -> Result<(Self, mpsc::Sender<Control>), RenderError> {
        let renderer = factory.build_renderer(&probe, &render)?;
        Ok(Self::with_renderer(poses, renderer, factory, probe, render))
    }

    /// As [`Parts::new`], with a renderer that has these settings already.
    pub(super) fn with_renderer(
        poses: impl PoseSource + 'static,
        renderer: Renderer,
        factory: LocalRendererFactory,
        probe: Probe,
        render: RenderSettings,
    ) -> (Self, mpsc::Sender<Control>) {
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let (sender, controls) = mpsc::channel(CONTROLS_WAITING);
        let parts = Self {
            stop: Stop::new(&clock),
            clock,
            poses: Box::new(poses),
            renderer: Box::new(renderer),
            factory: Box::new(factory),
            probe,
            render,
            points: None,
            aperture: render.effects.of(Effect::Aperture),
            generators: None,
            needle: None,
            sinks: Vec::new(),
            log: None,
            controls,
            observer: None,
            tracker: None,
            before: Vec::new(),
            after: Vec::new(),
        };
        (parts, sender)
    }
}

/// The threads of a session.
struct Stages {
    render: Thread<()>,
    generate: Option<Thread<()>>,
    needle: Option<NeedleStage>,
    presenter: Thread<Option<FrameLog>>,
    sinks: Vec<SinkStage>,
}

/// A running session.
pub struct Pipeline {
    clock: Arc<dyn Clock>,
    stop: Stop,
    events: Events,
    metrics: Arc<Metrics>,
    to_presenter: Arc<Slot<Arc<Rendered>>>,
    to_generator: Option<Arc<Slot<Arc<Rendered>>>>,
    generator: Option<Arc<GeneratorLink>>,
    stages: Stages,
    tracker: Option<TrackerWatch>,
    before: Vec<Box<dyn Part>>,
    after: Vec<Box<dyn Part>>,
    /// Time at which the stages started.
    started_at: Duration,
    duration: Option<Duration>,
    finish: Duration,
}

impl Pipeline {
    /// Runs a session until its `stop` is requested or a limit is reached, and ends it. `watch` gets the status four
    /// times per second.
    ///
    /// # Errors
    /// A thread cannot be started. Later faults are logged and counted, and the session continues.
    pub fn run(
        settings: &PipelineSettings,
        limits: Limits,
        parts: Parts,
        mut watch: impl FnMut(&Status),
    ) -> Result<Summary, PipelineError> {
        let pipeline = Self::start(settings, limits, parts)?;
        let until = pipeline.duration.unwrap_or(super::NEVER);
        loop {
            let next = pipeline.clock.now().saturating_add(STATUS_PERIOD).min(until);
            let stopped = pipeline.stop.wait(next);
            match pipeline.tracker.as_ref().and_then(TrackerWatch::notice) {
                Some(TrackerNotice::News(text)) => pipeline.events.show(text),
                Some(TrackerNotice::Trouble(text)) => pipeline.events.show_if_free(text),
                None => {}
            }
            watch(&pipeline.status());
            if stopped || pipeline.clock.now() >= until {
                break;
            }
        }
        pipeline.stop.request("its time is over");
        Ok(pipeline.end())
    }

    /// Starts all stages, consumers first.
    fn start(settings: &PipelineSettings, limits: Limits, parts: Parts) -> Result<Self, PipelineError> {
        let Parts { clock, stop, generators, log, .. } = parts;
        let events = Events::new(&clock, parts.observer);
        let metrics = Arc::<Metrics>::default();
        let refused = |name: &str| {
            let (name, stop) = (name.to_owned(), stop.clone());
            move |source| {
                // Stages that were already started must end.
                stop.request("it could not start");
                PipelineError::Thread { name, source }
            }
        };
        let started_at = clock.now();

        let map_readers = parts.sinks.iter().filter_map(|sink| sink.maps_wanted()).collect();
        let mut sinks = Vec::new();
        for sink in parts.sinks {
            let refused = refused(sink.name());
            sinks.push(SinkStage::start(sink, &clock, &events).map_err(refused)?);
        }

        let signal = Arc::<Signal>::default();
        let to_presenter = Arc::new(Slot::with_signal("presenter", &clock, &signal));
        let generated = Arc::new(Slot::with_signal("generated", &clock, &signal));
        let has_generator = generators.is_some();
        let (mut to_generator, mut generator, mut generate) = (None, None, None);
        if let Some(generators) = generators {
            let link = Arc::new(GeneratorLink::new(&*generators, milliseconds(settings.hang_ms)));
            let slot = Arc::new(Slot::new("generator", &clock));
            let stage = GenerateStage {
                clock: clock.clone(),
                events: events.clone(),
                generators,
                link: link.clone(),
                from_renderer: slot.clone(),
                to_presenter: generated.clone(),
            };
            generate = Some(spawn(&clock, "generator", move || stage.run()).map_err(refused("generator"))?);
            (to_generator, generator) = (Some(slot), Some(link));
        }

        let presenter = Presenter {
            clock: clock.clone(),
            stop: stop.clone(),
            events: events.clone(),
            metrics: metrics.clone(),
            choice: settings.choice,
            signal,
            rendered: to_presenter.clone(),
            generated,
            generator: generator.clone(),
            sinks: sinks.iter().map(|sink| sink.slot().clone()).collect(),
            frames_max: limits.frames,
            log,
            log_waited: false,
        };
        let presenter = spawn(&clock, "presenter", move || presenter.run()).map_err(refused("presenter"))?;

        let needle = parts.needle.map(|watch| NeedleStage::start(watch, &clock, &events));
        let needle = needle.transpose().map_err(refused("needle"))?;
        let live = live_settings(parts.probe, parts.render, has_generator);
        let render = RenderParts {
            clock: clock.clone(),
            stop: stop.clone(),
            events: events.clone(),
            metrics: metrics.clone(),
            factory: parts.factory,
            controls: Controls::new(parts.controls, live),
            points: parts.points,
            aperture: parts.aperture,
            to_presenter: to_presenter.clone(),
            to_generator: to_generator.clone(),
            to_needle: needle.as_ref().map(|stage| stage.slot().clone()),
            generator: generator.clone(),
            map_readers,
            period: Duration::from_secs_f64(1.0 / settings.frame_rate_hz.clamp(0.1, 1000.0)),
            deadline_after: milliseconds(settings.deadline_ms),
        };
        let render = spawn(&clock, "renderer", move || RenderStage::new(render, parts.poses, parts.renderer).run());
        let render = render.map_err(refused("renderer"))?;

        Ok(Self {
            started_at,
            duration: limits.duration.map(|duration| started_at.saturating_add(duration)),
            finish: milliseconds(settings.finish_ms),
            stages: Stages { render, generate, needle, presenter, sinks },
            tracker: parts.tracker,
            before: parts.before,
            after: parts.after,
            clock,
            stop,
            events,
            metrics,
            to_presenter,
            to_generator,
            generator,
        })
    }

    /// Current status.
    fn status(&self) -> Status {
        let mut notice = None;
        self.events.notice_into(&mut notice);
        let dropped = drops(&self.metrics, &self.to_presenter).iter().map(|(_, count)| count).sum();
        let damaged = self.tracker.as_ref().map_or(0, |tracker| tracker.totals().damaged);
        self.metrics.status([self.started_at, self.clock.now()], dropped, damaged, notice)
    }
}

/// Live settings of a session that begins.
fn live_settings(probe: Probe, render: RenderSettings, generator: bool) -> LiveSettings {
    LiveSettings { probe, render, generator, ..LiveSettings::default() }
}

fn milliseconds(ms: f64) -> Duration {
    Duration::from_secs_f64((ms * 1e-3).max(0.0))
}

/// Numbers of frames begun but not presented, by cause.
fn drops(metrics: &Metrics, to_presenter: &Slot<Arc<Rendered>>) -> [(&'static str, u64); 4] {
    [
        ("replaced before presentation", to_presenter.dropped()),
        ("lost with the device", counted(&metrics.device_lost)),
        ("held by slow sinks", counted(&metrics.frames_held)),
        ("session ended", counted(&metrics.ended)),
    ]
}
