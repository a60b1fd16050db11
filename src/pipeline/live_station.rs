//! A station's live session: generators, operating point, tracker, recording and sinks, from the station file.

use std::path::{Path, PathBuf};
use std::time::Duration;

use thiserror::Error;
use tokio::sync::mpsc;

use super::local_renderer::LocalRendererFactory;
use super::parts::{FrameGenerators, PoseSource};
use super::recorded::{RecordedSlot, RecorderPart, RecordingObserver, start_recorder};
use super::session::Parts;
use super::sources::WithStandingNeedle;
use super::tracked::TrackedPoses;
use super::{Generators, RecordError};
use crate::anatomy::Scene;
use crate::chooser;
use crate::generator::{Generator, GeneratorError, Kind, load_generators};
use crate::measuring::{MeasuringError, timed_needle};
use crate::pose::Pose;
use crate::recording::RecorderHandle;
use crate::render::{Effect, RenderError};
use crate::settings::Control;
use crate::sink::live::LiveSink;
use crate::sink::openigtlink::OpenIgtLink;
#[cfg(feature = "video")]
use crate::sink::{FrameRate, LiveVideo};
use crate::sink::{LiveSinkKind, NullSink, PngSequence, SinkError};
use crate::station::Station;
use crate::tracker::{self, TrackerError, TrackerStream};

/// Reason why a station's session cannot begin.
#[derive(Debug, Error)]
pub enum LiveError {
    /// No renderer can be made.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// No operating point can be chosen.
    #[error(transparent)]
    Chooser(#[from] MeasuringError),
    /// The station requires an inference provider that is unavailable.
    #[error("{path}: {source}")]
    Provider {
        /// File of the generator's model.
        path: PathBuf,
        /// Cause.
        source: GeneratorError,
    },
    /// The recording can't be started.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The tracker can't be started.
    #[error(transparent)]
    Tracker(#[from] TrackerError),
    /// A sink can't be opened.
    #[error(transparent)]
    Sink(#[from] SinkError),
    /// A sink that this build lacks.
    #[error("this build has no {sink}: `cargo build --release --features {feature}` makes one with it")]
    NotBuilt {
        /// The sink.
        sink: &'static str,
        /// Cargo feature that adds the sink.
        feature: &'static str,
    },
}

/// A station's session before it runs.
pub struct LiveStation {
    /// Parts for [`Pipeline::run`](super::Pipeline::run).
    pub parts: Parts,
    /// Sender of the watchers' controls. It must outlive the session, or the channel closes if no sink takes input.
    pub control: mpsc::Sender<Control>,
    /// Sentences for the user: the operating point and the addresses of displays.
    pub messages: Vec<String>,
    /// Slot of the native window, if the station has one; the main thread has to show the window.
    #[cfg(feature = "window")]
    pub window: Option<crate::sink::window::WindowSlot>,
    recording: Option<RecorderHandle>,
}

impl LiveStation {
    /// Loads the station's generators if they are wanted, and chooses the operating point (quality and generator). It
    /// is chosen for a view of the scene from `pose`, or from the station's pose, and replaces the station's settings.
    /// Generators that can't be used are logged, and frames stay raw.
    ///
    /// # Errors
    /// No renderer can be made, no operating point can be chosen, or the machine lacks the inference provider that the
    /// station requires.
    pub fn new(
        station: &mut Station,
        factory: LocalRendererFactory,
        poses: impl PoseSource + 'static,
        pose: Option<Pose>,
        generate: bool,
    ) -> Result<Self, LiveError> {
        let aperture = station.settings.effects.of(Effect::Aperture);
        let factory = factory.answering_within(Duration::from_secs_f64(station.pipeline.device_hang_ms * 1e-3));
        let mut renderer = factory.build_renderer(&station.probe, &station.settings)?;
        let mut messages = Vec::new();
        let mut generators = if generate { generators(station, &mut messages)? } else { Vec::new() };
        let needle = station.standing_needle();
        // A tracked needle has no pose yet. It is timed at an assumed one, so the operating point has time for it.
        let at = pose.or(station.default_pose).unwrap_or(Pose::IDENTITY);
        renderer.set_needle(needle.or_else(|| timed_needle(&station.settings, &station.probe, &at)));
        let poses = WithStandingNeedle { poses, needle };
        let is_needle = station.settings.needle.is_some_and(|needle| needle.echoes());
        let watch = is_needle.then(|| factory.needle_watch(station.exercise.as_ref()));
        let start = chooser::choose(&mut renderer, station, &mut generators, pose)?;
        messages.extend(start.messages);
        let (mut parts, control) = Parts::with_renderer(poses, renderer, factory, station.probe, station.settings);
        (parts.points, parts.aperture, parts.needle) = (start.controller, aperture, watch);
        parts.generators = Generators::new(generators).map(|found| Box::new(found) as Box<dyn FrameGenerators>);
        Ok(Self {
            parts,
            control,
            messages,
            #[cfg(feature = "window")]
            window: None,
            recording: None,
        })
    }

    /// Records the session to `path`: tracker bytes, poses, settings and events. `stream` holds the tracker's protocol
    /// and the sensors of its tools; `adapter` names the rendering device. The returned slot holds the result
    /// after the session. Call this before [`Self::track`].
    ///
    /// # Errors
    /// The file can't be made, or the station file can't be read again.
    pub fn record(
        &mut self,
        path: &Path,
        station: &Station,
        stream: TrackerStream,
        adapter: &str,
    ) -> Result<RecordedSlot, LiveError> {
        let began_ns = self.parts.clock.start_unix_ns();
        let recorder = start_recorder(path, station, stream, "station's tracker", adapter, began_ns)?;
        self.recording = Some(recorder.handle());
        self.parts.observer = Some(std::sync::Arc::new(RecordingObserver(recorder.handle())));
        let (part, slot) = RecorderPart::new(recorder);
        self.parts.after.push(Box::new(part));
        Ok(slot)
    }

    /// Starts the tracker that feeds `poses`.
    ///
    /// # Errors
    /// Errors of [`TrackedPoses::track`].
    pub fn track(&mut self, poses: &TrackedPoses, tracker: &tracker::Settings) -> Result<(), LiveError> {
        let part = poses.track(tracker, self.recording.clone(), self.parts.stop.clone())?;
        self.parts.tracker = Some(poses.watch());
        self.parts.before.push(Box::new(part));
        Ok(())
    }

    /// Opens the sinks of the station. They write their files below `out`.
    ///
    /// # Errors
    /// A sink that can't be opened, or that this build lacks.
    pub fn open_sinks(
        &mut self,
        kinds: &[LiveSinkKind],
        station: &Station,
        scene: &Scene,
        out: &Path,
    ) -> Result<(), LiveError> {
        for kind in kinds {
            let sink: Box<dyn LiveSink> = match kind {
                LiveSinkKind::Null => Box::new(NullSink),
                LiveSinkKind::Png => Box::new(PngSequence::create(&out.join("png"))?),
                LiveSinkKind::Video => video(station, out)?,
                LiveSinkKind::OpenIgtLink => {
                    let sink = OpenIgtLink::new(station.openigtlink.clone().unwrap_or_default(), station.probe)?;
                    self.messages.push(format!("OpenIGTLink: {}", sink.address()));
                    Box::new(sink)
                }
                LiveSinkKind::Browser => self.browser(station, scene)?,
                LiveSinkKind::Window => self.window()?,
            };
            self.parts.sinks.push(sink);
        }
        Ok(())
    }

    #[cfg(feature = "browser")]
    fn browser(&mut self, station: &Station, scene: &Scene) -> Result<Box<dyn LiveSink>, LiveError> {
        let settings = station.browser.clone().unwrap_or_default();
        let scene = scene_info(station, scene);
        let sink = crate::sink::browser::BrowserSink::new(&settings, self.control.clone(), &scene)?;
        self.messages.push(format!("page: {}", sink.address()));
        self.messages.extend(sink.origin_addresses().iter().map(|address| format!("page: {address}")));
        Ok(Box::new(sink))
    }

    #[cfg(not(feature = "browser"))]
    fn browser(&mut self, _: &Station, _: &Scene) -> Result<Box<dyn LiveSink>, LiveError> {
        Err(LiveError::NotBuilt { sink: "page", feature: "browser" })
    }

    #[cfg(feature = "window")]
    fn window(&mut self) -> Result<Box<dyn LiveSink>, LiveError> {
        let (sink, slot) = crate::sink::window::WindowSink::new();
        self.window = Some(slot);
        Ok(Box::new(sink))
    }

    #[cfg(not(feature = "window"))]
    fn window(&mut self) -> Result<Box<dyn LiveSink>, LiveError> {
        Err(LiveError::NotBuilt { sink: "window", feature: "window" })
    }
}

#[cfg(feature = "video")]
fn video(station: &Station, out: &Path) -> Result<Box<dyn LiveSink>, LiveError> {
    let rate = FrameRate::new(station.pipeline.frame_rate_hz)?;
    Ok(Box::new(LiveVideo::new(&out.join("video"), rate)))
}

#[cfg(not(feature = "video"))]
fn video(_: &Station, _: &Path) -> Result<Box<dyn LiveSink>, LiveError> {
    Err(LiveError::NotBuilt { sink: "video", feature: "video" })
}

/// Tissues and surfaces of the station's scene, for the browser page.
#[cfg(feature = "browser")]
pub fn scene_info(station: &Station, scene: &Scene) -> crate::sink::browser::SceneInfo {
    use crate::sink::browser::{SceneInfo, ScenePacket};
    let surfaces = ScenePacket::new(scene, &station.probe, station.settings.needle.as_ref(), station.axes(scene));
    SceneInfo { tissues: station.tissues.names().to_vec(), surfaces: Some(surfaces), measures: measures(station) }
}

/// Caliper measures of the station's standard planes, one for each name; empty for a scene without planes.
#[cfg(feature = "browser")]
fn measures(station: &Station) -> Vec<crate::sink::browser::MeasureInfo> {
    use crate::anatomy::planes::{CaliperKind, PlanesError};
    use crate::sink::browser::MeasureInfo;
    let planes = match station.standard_planes() {
        Ok(planes) => planes.planes,
        Err(crate::station::StationError::Planes(PlanesError::None { .. })) => Vec::new(),
        Err(error) => {
            tracing::warn!("measurements can't be named after the standard planes: {error}");
            Vec::new()
        }
    };
    let mut measures: Vec<MeasureInfo> = Vec::new();
    for caliper in planes.into_iter().flat_map(|plane| plane.views).flat_map(|view| view.calipers) {
        let kind = match caliper.kind {
            CaliperKind::Line => "distance",
            CaliperKind::Ellipse => "ellipse",
        };
        if measures.iter().all(|known| known.name != caliper.name) {
            measures.push(MeasureInfo { name: caliper.name, title: caliper.title, kind });
        }
    }
    measures
}

/// The station's generators; empty without models, without ONNX Runtime, or if every model is refused.
fn generators(station: &Station, messages: &mut Vec<String>) -> Result<Vec<Generator>, LiveError> {
    let loaded = match load_generators(&station.generator, station.tissues.names()) {
        Ok(loaded) => loaded,
        Err(error) => {
            tracing::warn!("no generator runs, the rendered image is shown: {error}");
            return Ok(Vec::new());
        }
    };
    for refused in loaded.refused {
        // A requested provider that is unavailable is an error, never a silent fallback.
        if let GeneratorError::Provider { .. } = refused.error {
            return Err(LiveError::Provider { path: refused.path, source: refused.error });
        }
        tracing::warn!("{} is not used: {}", refused.path.display(), refused.error);
    }
    for manifest in loaded.generators.iter().map(Generator::manifest).filter(|m| m.kind == Kind::FixedFilter) {
        messages.push(format!("generator: {}: a fixed filter, no trained generator", manifest.name));
    }
    Ok(loaded.generators)
}
