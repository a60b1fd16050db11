//! Renders a probe sweep for the browser, without tracker or pipeline: `cargo run --release --example browser_demo --
//! configs/sphere.toml [--port N] [--width PIXELS]`. With `--features window`, `--window yes` also opens a window.
//!
//! Prints the page's address, and the marks that viewers set on the page. Lines on the standard input control the rest:
//! `tracking good|held|stuck|stale|lost`, `source generated|held|raw`, `notice TEXT`, `quit`.

use std::io::BufRead as _;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use anyhow::{Context as _, bail};
use glam::{DQuat, DVec3};
use insonify::anatomy::Axes;
use insonify::anatomy::Scene;
use insonify::phantom;
use insonify::pose::{Pose, TrackingState};
use insonify::recording::{Event, mark_event, removal_event};
use insonify::render::{Backend, BackendChoice, Frame, Renderer};
use insonify::settings::{Control, LiveSettings};
use insonify::sink::browser::{BrowserSink, MeasureInfo, SceneInfo, ScenePacket, Settings};
use insonify::sink::live::{FrameSource, FrameTimeline, LiveSink, PresentedFrame};
#[cfg(feature = "window")]
use insonify::sink::window::{WindowSink, run_on_main_thread};
use insonify::station::{SceneSource, Station};

fn main() -> anyhow::Result<()> {
    tracing_subscriber::fmt().with_writer(std::io::stderr).init();
    let mut arguments = std::env::args().skip(1);
    let path = PathBuf::from(arguments.next().unwrap_or_else(|| "configs/sphere.toml".to_owned()));
    let mut station = Station::load(&path)?;
    #[cfg(feature = "window")]
    let mut window = station.window;
    let mut settings = station.browser.clone().unwrap_or(Settings { port: 0, ..Settings::default() });
    while let Some(argument) = arguments.next() {
        let value = arguments.next().with_context(|| format!("{argument} needs a value"))?;
        match argument.as_str() {
            "--port" => settings.port = value.parse()?,
            "--width" => {
                station.settings.image.width = value.parse()?;
                station.settings.image.height = station.settings.image.width * 1000 / 1386;
            }
            #[cfg(feature = "window")]
            "--window" => window = Some(Default::default()),
            _ => bail!("unknown argument {argument}; it is --port, --width or, with the feature `window`, --window"),
        }
    }
    let scene = load_scene(&station)?;
    let tissues = scene.tissues.names().to_vec();
    let axes = match &station.scene {
        SceneSource::ObstetricPhantom { .. } => Axes::Anatomical,
        SceneSource::File(_) => Axes::Depth,
    };
    let surfaces = ScenePacket::new(&scene, &station.probe, station.settings.needle.as_ref(), axes);
    let (sender, controls) = tokio::sync::mpsc::channel(64);
    let browser = BrowserSink::new(
        &settings,
        sender.clone(),
        &SceneInfo { tissues, surfaces: Some(surfaces), measures: measures() },
    )?;
    println!("address {}", browser.address());
    let sinks: Vec<Box<dyn LiveSink>> = vec![Box::new(browser)];

    let (lines_in, lines) = mpsc::sync_channel(16);
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            if lines_in.send(line).is_err() {
                return;
            }
        }
    });
    let demo = Demo::new(scene, station)?;
    #[cfg(feature = "window")]
    if let Some(window) = window {
        let (sink, slot) = WindowSink::new();
        let sinks = sinks.into_iter().chain([Box::new(sink) as Box<dyn LiveSink>]).collect();
        let presenter = std::thread::spawn(move || present(demo, sinks, controls, &lines));
        run_on_main_thread(slot, &window, sender)?;
        return presenter.join().map_err(|_| anyhow::anyhow!("the presenter panicked"))?;
    }
    present(demo, sinks, controls, &lines)
}

/// Renders and shows frames until a line of the input or the window ends the demo.
fn present(
    mut demo: Demo,
    mut sinks: Vec<Box<dyn LiveSink>>,
    mut controls: tokio::sync::mpsc::Receiver<Control>,
    lines: &mpsc::Receiver<String>,
) -> anyhow::Result<()> {
    loop {
        let mut changed = false;
        let mut quit = false;
        while let Ok(control) = controls.try_recv() {
            quit |= control == Control::Quit;
            changed |= demo.follow(&control);
        }
        while let Ok(line) = lines.try_recv() {
            if line == "quit" {
                quit = true;
            } else {
                demo.obey(&line)?;
            }
        }
        if quit {
            return sinks.into_iter().try_for_each(|sink| Ok(sink.finish()?));
        }
        if changed {
            demo.rebuild()?;
        }
        // A frozen picture is presented once more, marked as frozen, and after that only if settings change.
        let frozen = demo.shown.info.settings.frozen;
        if frozen && demo.live.frozen && !changed {
            std::thread::sleep(Duration::from_millis(20));
            continue;
        }
        demo.render()?;
        sinks.retain_mut(|sink| match sink.present(&demo.shown) {
            Ok(()) => true,
            Err(e) => {
                tracing::warn!("{} is closed: {e}", sink.name());
                false
            }
        });
    }
}

fn load_scene(station: &Station) -> anyhow::Result<Scene> {
    let path = match &station.scene {
        SceneSource::File(path) => path.clone(),
        SceneSource::ObstetricPhantom(options) => {
            let cache = std::env::var_os("INSONIFY_CACHE").context("set INSONIFY_CACHE to the phantom's directory")?;
            phantom::cached(Path::new(&cache), options, &|_| {})?
        }
    };
    Ok(station.load_scene_from(&path)?)
}

/// Prints a mark of the page in the form of a recorded event.
fn report(event: &Event) {
    println!("{} {}", event.name, event.value.clone().unwrap_or_default());
}

/// The measures that the page offers for measurements.
fn measures() -> Vec<MeasureInfo> {
    let measure = |name: &str, title: &str, kind| MeasureInfo { name: name.to_owned(), title: title.to_owned(), kind };
    vec![
        measure("BPD", "biparietal diameter", "distance"),
        measure("FL", "femur length", "distance"),
        measure("HC", "head circumference", "ellipse"),
    ]
}

struct Demo {
    station: Station,
    renderer: Renderer,
    live: LiveSettings,
    frame: Frame,
    shown: PresentedFrame,
    started: Instant,
}

impl Demo {
    fn new(scene: Scene, station: Station) -> anyhow::Result<Self> {
        let backend = Backend::open(BackendChoice::from_environment()?.unwrap_or_default())?;
        let renderer = Renderer::new(&backend, &scene, &station.probe, &station.settings)?;
        let (probe, render) = (station.probe, station.settings);
        let live = LiveSettings { probe, render, frozen: false, generator: false };
        let mut shown = PresentedFrame::default();
        shown.info.settings = live;
        shown.info.estimate.state = TrackingState::Good;
        let (frame, started) = (Frame::default(), Instant::now());
        Ok(Self { station, renderer, live, frame, shown, started })
    }

    /// Applies a control. Returns whether the renderer must be reconfigured.
    fn follow(&mut self, control: &Control) -> bool {
        let before = self.live;
        match control {
            Control::Set(assignments) => self.live = before.with(assignments).unwrap_or(before),
            Control::Mark(mark) => report(&mark_event(0, 0, mark)),
            Control::Unmark(ids) => ids.iter().for_each(|id| report(&removal_event(0, id))),
            Control::Quit => {}
        }
        !before.same_picture(&self.live)
    }

    fn obey(&mut self, line: &str) -> anyhow::Result<()> {
        match line.split_once(' ').unwrap_or((line, "")) {
            ("tracking", name) => {
                let state = TrackingState::ALL.into_iter().find(|state| state.name() == name);
                self.shown.info.estimate.state = state.with_context(|| format!("no state `{name}`"))?;
            }
            ("source", "generated") => self.shown.source = FrameSource::Generated,
            ("source", "held") => self.shown.source = FrameSource::HeldGenerated,
            ("source", "raw") => self.shown.source = FrameSource::Raw,
            ("notice", text) => self.shown.notice = Some(text.to_owned()).filter(|text| !text.is_empty()),
            _ => bail!("unknown line `{line}`"),
        }
        Ok(())
    }

    fn rebuild(&mut self) -> anyhow::Result<()> {
        self.renderer.reconfigure(&self.live.probe, &self.live.render)?;
        Ok(())
    }

    /// Renders the next pose of the sweep into `shown`; if the picture is frozen, the last pose again.
    fn render(&mut self) -> anyhow::Result<()> {
        let sampled = self.started.elapsed();
        if !self.live.frozen || self.shown.info.pose().is_none() {
            self.shown.info.estimate.scene_from_probe = Some(self.pose(sampled));
        }
        let pose = self.shown.info.pose().context("no pose")?;
        self.renderer.render(&pose, &mut self.frame)?;
        let (shown, frame) = (&mut self.shown, &mut self.frame);
        shown.number += 1;
        (shown.width, shown.height) = (frame.width, frame.height);
        shown.pixel_mm = self.renderer.sector().pixel_mm;
        std::mem::swap(&mut shown.image, &mut frame.bmode);
        std::mem::swap(&mut shown.segmentation, &mut frame.segmentation);
        std::mem::swap(&mut shown.attenuation, &mut frame.attenuation);
        std::mem::swap(&mut shown.mask, &mut frame.mask);
        let now = self.started.elapsed();
        let info = &mut shown.info;
        info.timeline = FrameTimeline { sampled, submitted: sampled, rendered: now, presented: now, ..info.timeline };
        info.settings = self.live;
        Ok(())
    }

    /// The station's pose, moved along x and y and tilted, at a time of the sweep.
    fn pose(&self, time: Duration) -> Pose {
        let base = self.station.default_pose.unwrap_or(Pose { position_mm: DVec3::ZERO, orientation: DQuat::IDENTITY });
        let phase = 0.35 * time.as_secs_f64();
        let shift = DVec3::new(9.0 * phase.sin(), 14.0 * (0.7 * phase).sin(), 0.0);
        Pose {
            position_mm: base.transform_point(shift),
            orientation: (base.orientation * DQuat::from_rotation_x(0.12 * (1.3 * phase).sin())).normalize(),
        }
    }
}
