//! Starts the stages, watches them, and ends them in their order.

use std::collections::BTreeMap;
use std::io;
use std::sync::Arc;
use std::time::Duration;

use thiserror::Error;
use tokio::sync::mpsc;

use super::clock::{Clock, Signal, lock};
use super::controls::Controls;
use super::deadline::ChoiceSettings;
use super::events::{Events, Observer};
use super::generate_stage::GenerateStage;
use super::generator_link::GeneratorLink;
use super::metrics::{Metrics, Status, counted, memory_bytes};
use super::parts::{Enhancer, FrameRenderer, PoseSource, RendererFactory};
use super::presenter::Presenter;
use super::quality_budget::QualityBudget;
use super::render_stage::{RenderParts, RenderStage};
use super::rendered::Rendered;
use super::shutdown::{Joined, Part, Stop, Thread, spawn};
use super::sink_stage::SinkStage;
use super::slot::Slot;
use super::summary::{GeneratorSummary, Summary};
use crate::render::RenderSettings;
use crate::sink::live::{Control, LiveSink};
use crate::transducer::Probe;

/// How often the session looks at itself.
const STATUS_PERIOD: Duration = Duration::from_millis(250);

/// How long each part may take to end.
const PART_TIME: Duration = Duration::from_secs(3);

/// How often a part is asked whether it has ended.
const ASK_PERIOD: Duration = Duration::from_millis(5);

/// The `[pipeline]` of a station.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Frames a second.
    pub frame_rate_hz: f64,
    /// From the sampling of a frame's pose until it is presented at the latest, ms.
    pub budget_ms: f64,
    /// When a held picture may stand for a frame, and how steady the generator must be.
    pub choice: ChoiceSettings,
    /// A generator run of this length hangs, ms.
    pub hang_ms: f64,
    /// How long the sinks may take to finish at the end: a video has to be completed, ms.
    pub finish_ms: f64,
}

impl Default for Settings {
    fn default() -> Self {
        let choice = ChoiceSettings { hold_mm: 0.3, hold_deg: 0.3, steady_frames: 8 };
        Self { frame_rate_hz: 30.0, budget_ms: 100.0, choice, hang_ms: 5000.0, finish_ms: 10_000.0 }
    }
}

/// When a session ends by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Limits {
    /// After this time.
    pub duration: Option<Duration>,
    /// After this many presented frames.
    pub frames: Option<u64>,
}

/// Why a session could not start.
#[derive(Debug, Error)]
pub enum PipelineError {
    /// The system refuses another thread.
    #[error("cannot start the thread `{name}`: {source}")]
    Thread {
        /// Name of the thread.
        name: String,
        /// Cause.
        source: io::Error,
    },
}

/// What a session is put together from.
pub struct Parts {
    /// Its time.
    pub clock: Arc<dyn Clock>,
    /// Ends it.
    pub stop: Stop,
    /// Knows where the probe is.
    pub poses: Box<dyn PoseSource>,
    /// Renders `probe` by `render`.
    pub renderer: Box<dyn FrameRenderer>,
    /// Makes another renderer when its device is lost.
    pub factory: Box<dyn RendererFactory>,
    /// The probe to begin with.
    pub probe: Probe,
    /// The renderer's settings to begin with.
    pub render: RenderSettings,
    /// Keeps the quality at what the machine affords, from the point that `render` begins with; none: it stays as set.
    pub quality: Option<QualityBudget>,
    /// Translates frames; none: rendered frames are shown.
    pub enhancer: Option<Box<dyn Enhancer>>,
    /// Where frames go.
    pub sinks: Vec<Box<dyn LiveSink>>,
    /// What watchers ask for.
    pub controls: mpsc::Receiver<Control>,
    /// Hears events, poses and settings, for a recording.
    pub observer: Option<Arc<dyn Observer>>,
    /// Ended before all stages: the tracker.
    pub before: Vec<Box<dyn Part>>,
    /// Ended after all sinks: the recorder.
    pub after: Vec<Box<dyn Part>>,
}

/// The threads of a session.
struct Stages {
    render: Thread<()>,
    generate: Option<Thread<()>>,
    presenter: Thread<()>,
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
    before: Vec<Box<dyn Part>>,
    after: Vec<Box<dyn Part>>,
    duration: Option<Duration>,
    finish: Duration,
}

impl Pipeline {
    /// Runs a session until its `stop` is requested or a limit is reached, and ends it. `watch` hears a few times a
    /// second how it goes.
    ///
    /// # Errors
    /// The system refuses a thread. Whatever fails later is said, counted, and survived.
    pub fn run(
        settings: &Settings,
        limits: Limits,
        parts: Parts,
        mut watch: impl FnMut(&Status),
    ) -> Result<Summary, PipelineError> {
        let pipeline = Self::start(settings, limits, parts)?;
        let until = pipeline.duration.unwrap_or(super::NEVER);
        loop {
            let next = pipeline.clock.now().saturating_add(STATUS_PERIOD).min(until);
            let stopped = pipeline.stop.wait(next);
            watch(&pipeline.status());
            if stopped || pipeline.clock.now() >= until {
                break;
            }
        }
        pipeline.stop.request("its time is over");
        Ok(pipeline.end())
    }

    /// Starts every stage, the last first, so that each finds the one behind it.
    fn start(settings: &Settings, limits: Limits, parts: Parts) -> Result<Self, PipelineError> {
        let Parts { clock, stop, enhancer, .. } = parts;
        let events = Events::new(&clock, parts.observer);
        let metrics = Arc::<Metrics>::default();
        let refused = |name: &str| {
            let (name, stop) = (name.to_owned(), stop.clone());
            move |source| {
                // What was started already must not run on.
                stop.request("it could not start");
                PipelineError::Thread { name, source }
            }
        };
        let started_at = clock.now();
        let seconds = |ms: f64| Duration::from_secs_f64((ms * 1e-3).max(0.0));

        let map_readers = parts.sinks.iter().filter_map(|sink| sink.maps_wanted()).collect();
        let mut sinks = Vec::new();
        for sink in parts.sinks {
            let refused = refused(sink.name());
            sinks.push(SinkStage::start(sink, &clock, &events).map_err(refused)?);
        }

        let signal = Arc::<Signal>::default();
        let to_presenter = Arc::new(Slot::with_signal("presenter", &clock, &signal));
        let generated = Arc::new(Slot::with_signal("generated", &clock, &signal));
        let has_generator = enhancer.is_some();
        let (to_generator, generator, generate) = match enhancer {
            Some(enhancer) => {
                let link = Arc::new(GeneratorLink::new(&*enhancer, seconds(settings.hang_ms)));
                let slot = Arc::new(Slot::new("generator", &clock));
                let stage = GenerateStage {
                    clock: clock.clone(),
                    events: events.clone(),
                    enhancer,
                    link: link.clone(),
                    from_renderer: slot.clone(),
                    to_presenter: generated.clone(),
                };
                let thread = spawn(&clock, "generator", move || stage.run()).map_err(refused("generator"))?;
                (Some(slot), Some(link), Some(thread))
            }
            None => (None, None, None),
        };

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
        };
        let presenter = spawn(&clock, "presenter", move || presenter.run()).map_err(refused("presenter"))?;

        let render = RenderParts {
            clock: clock.clone(),
            stop: stop.clone(),
            events: events.clone(),
            metrics: metrics.clone(),
            factory: parts.factory,
            controls: Controls::new(parts.controls, parts.probe, parts.render, has_generator),
            quality: parts.quality,
            to_presenter: to_presenter.clone(),
            to_generator: to_generator.clone(),
            generator: generator.clone(),
            map_readers,
            period: Duration::from_secs_f64(1.0 / settings.frame_rate_hz.clamp(0.1, 1000.0)),
            budget: seconds(settings.budget_ms),
        };
        let (poses, renderer) = (parts.poses, parts.renderer);
        let render = spawn(&clock, "renderer", move || RenderStage::new(render, poses, renderer).run());
        let render = render.map_err(refused("renderer"))?;

        Ok(Self {
            duration: limits.duration.map(|duration| started_at.saturating_add(duration)),
            finish: seconds(settings.finish_ms),
            stages: Stages { render, generate, presenter, sinks },
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

    /// How it goes.
    fn status(&self) -> Status {
        let mut notice = None;
        self.events.notice_into(&mut notice);
        self.metrics.status(
            self.clock.now(),
            drops(&self.metrics, &self.to_presenter).iter().map(|(_, count)| count).sum(),
            notice,
        )
    }

    /// Ends every part in its order, none waited for without bound, and says what the session did.
    fn end(mut self) -> Summary {
        let reason = self.stop.reason().unwrap_or_default();
        tracing::info!("the session ends: {reason}");
        let mut stuck = Vec::new();
        end_parts(&self.clock, &mut self.before, &mut stuck);
        let elapsed_s = self.clock.now().as_secs_f64();
        let Stages { render, generate, presenter, sinks } = self.stages;
        join(&self.clock, render, &mut stuck);
        // A renderer that is stuck didn't close its slots.
        self.to_generator.iter().for_each(|slot| slot.close());
        if let Some(generator) = &self.generator {
            generator.terminate();
        }
        let generator_stuck = generate.is_some_and(|thread| join(&self.clock, thread, &mut stuck));
        self.to_presenter.close();
        join(&self.clock, presenter, &mut stuck);
        sinks.iter().for_each(SinkStage::close);
        let until = self.clock.now().saturating_add(self.finish);
        let sinks: Vec<_> = sinks.into_iter().map(|sink| sink.join(until)).collect();
        for sink in sinks.iter().filter(|sink| sink.stuck) {
            self.events.warn(format!("{} doesn't come back and is left behind", sink.name));
        }
        stuck.extend(sinks.iter().filter(|sink| sink.stuck).map(|sink| sink.name.clone()));
        end_parts(&self.clock, &mut self.after, &mut stuck);

        if let Some(slot) = &self.to_generator {
            slot.clear();
        }
        let generator = self.generator.as_ref().zip(self.to_generator.as_ref()).map(|(link, slot)| {
            let counts = lock(&link.state).counts.clone();
            GeneratorSummary {
                offered: slot.offered(),
                dropped: counts.dropped + slot.dropped(),
                stuck: generator_stuck,
                ..counts
            }
        });
        self.to_presenter.clear();
        let metrics = &self.metrics;
        let mut drops = BTreeMap::from(drops(metrics, &self.to_presenter));
        metrics.shown(|shown| {
            if !stuck.is_empty() {
                let known = shown.presented + drops.values().sum::<u64>();
                drops.insert("left in a stuck stage", counted(&metrics.produced).saturating_sub(known));
            }
            let span_s = shown.first.map_or(0.0, |first| (shown.last - first).as_secs_f64());
            let intervals = shown.presented.saturating_sub(1) as f64;
            let enhanced = shown.by_source[0] + shown.by_source[1];
            Summary {
                elapsed_s,
                produced: counted(&metrics.produced),
                presented: shown.presented,
                drops,
                missed_ticks: counted(&metrics.missed_ticks),
                frames_per_s: if span_s > 0.0 { intervals / span_s } else { 0.0 },
                enhanced_ratio: if shown.presented > 0 { enhanced as f64 / shown.presented as f64 } else { 0.0 },
                by_source: shown.by_source,
                by_tracking: shown.by_tracking,
                pose_to_present: shown.pose_to_present.percentiles(),
                sample_to_present: shown.sample_to_present.percentiles(),
                render: shown.render.percentiles(),
                inference: shown.inference.percentiles(),
                device_losses: counted(&metrics.losses),
                device_rebuilt: counted(&metrics.rebuilt),
                controls: counted(&metrics.controls),
                controls_refused: counted(&metrics.refused),
                quality: metrics.quality(),
                generator,
                sinks,
                stuck,
                memory_bytes: memory_bytes(),
            }
        })
    }
}

/// Frames begun and not presented, by cause.
fn drops(metrics: &Metrics, to_presenter: &Slot<Arc<Rendered>>) -> [(&'static str, u64); 4] {
    [
        ("replaced before presentation", to_presenter.dropped()),
        ("lost with the device", counted(&metrics.device_lost)),
        ("held by slow sinks", counted(&metrics.frames_held)),
        ("session ended", counted(&metrics.ended)),
    ]
}

/// Waits for a stage's end; true if it is left behind.
fn join(clock: &Arc<dyn Clock>, thread: Thread<()>, stuck: &mut Vec<String>) -> bool {
    let name = thread.name().to_owned();
    let until = clock.now().saturating_add(PART_TIME);
    match thread.join(until) {
        Joined::Done(()) => false,
        Joined::Panicked => {
            tracing::error!("the thread `{name}` panicked");
            stuck.push(format!("{name} (panicked)"));
            false
        }
        Joined::Stuck => {
            tracing::warn!("the thread `{name}` doesn't come back and is left behind");
            stuck.push(name);
            true
        }
    }
}

/// Asks parts to end and waits for each, not without bound.
fn end_parts(clock: &Arc<dyn Clock>, parts: &mut Vec<Box<dyn Part>>, stuck: &mut Vec<String>) {
    parts.iter_mut().for_each(|part| part.stop());
    for mut part in parts.drain(..) {
        let until = clock.now().saturating_add(PART_TIME);
        loop {
            if part.has_ended() {
                break;
            }
            if clock.now() >= until {
                tracing::warn!("`{}` doesn't come back and is left behind", part.name());
                stuck.push(part.name().to_owned());
                break;
            }
            clock.sleep_until(clock.now().saturating_add(ASK_PERIOD));
        }
    }
}
