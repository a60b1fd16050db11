//! Event loop of the window, on the main thread.

use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::mpsc;
use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::event::{ElementState, KeyEvent, StartCause, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop, OwnedDisplayHandle};
use winit::keyboard::{Key, NamedKey};
use winit::window::{Fullscreen, Window, WindowId};

use super::Settings;
use super::graphics::{Drawing, Drawn, Graphics};
use super::marks::{self, Banner, Figures};
use super::sink::{NAME, Shown, Wake, WindowSlot};
use crate::presented::FrameInfo;
use crate::settings::{Action, Control, Display, LiveSettings, hot_key};
use crate::sink::SinkError;
use crate::sink::canvas::Canvas;

/// Time without a new frame after which a picture is marked as not live, unless it is frozen.
const SILENCE: Duration = Duration::from_secs(2);
/// Period of updates of the figures, and of checks for missing frames.
const TICK: Duration = Duration::from_millis(500);
/// Time after a key press during which the values set by the key override those of frames rendered earlier.
const HOLD: Duration = Duration::from_millis(900);
/// Largest number of consecutive attempts to rebuild lost graphics.
const REBUILDS_MAX: u32 = 5;

/// Opens the window and shows the frames of `slot` until the window is closed or the sink ends. Keys go to `controls`;
/// closing the window sends [`Control::Quit`].
///
/// # Errors
/// There is no display, no graphics device can show a window, or the device is lost repeatedly.
///
/// # Panics
/// On some systems, if called on another thread than the main one.
pub fn run_on_main_thread(
    slot: WindowSlot,
    settings: &Settings,
    controls: mpsc::Sender<Control>,
) -> Result<(), SinkError> {
    let result = run(&slot, settings, controls);
    let mut state = slot.state();
    state.window_gone = Some(if result.is_ok() { "the window was closed" } else { "the window failed" });
    state.proxy = None;
    result
}

fn run(slot: &WindowSlot, settings: &Settings, controls: mpsc::Sender<Control>) -> Result<(), SinkError> {
    let event_loop = EventLoop::<Wake>::with_user_event().build().map_err(|e| {
        let remedy = "a window needs a display: set DISPLAY or WAYLAND_DISPLAY, or use the page ([browser])";
        failed(format!("{e}; {remedy}"))
    })?;
    slot.state().proxy = Some(event_loop.create_proxy());
    let mut app = App {
        slot: slot.clone(),
        full_screen: settings.full_screen,
        controls,
        display: event_loop.owned_display_handle(),
        window: None,
        shown: None,
        spare: Shown::default(),
        canvas: Canvas::new(1, 1, [0; 3]),
        drawn: None,
        wanted: LiveSettings::default(),
        wanted_at: None,
        arrivals: 0,
        frames_per_s: 0,
        latency_ms: None,
        counted_at: Instant::now(),
        newest_at: Instant::now(),
        help: false,
        rebuilds: 0,
        error: None,
    };
    event_loop.run_app(&mut app).map_err(|e| failed(e.to_string()))?;
    app.error.map_or(Ok(()), Err)
}

fn failed(reason: String) -> SinkError {
    SinkError::Ended { sink: NAME, reason }
}

struct App {
    slot: WindowSlot,
    full_screen: bool,
    controls: mpsc::Sender<Control>,
    display: OwnedDisplayHandle,
    window: Option<(Arc<Window>, Graphics)>,
    shown: Option<Shown>,
    spare: Shown,
    canvas: Canvas,
    /// Figures and frame that the drawn marks show; none before the first drawing. The marks are drawn again only when
    /// these change.
    drawn: Option<(Figures, Option<Shown>)>,
    /// Settings requested by keys.
    wanted: LiveSettings,
    wanted_at: Option<Instant>,
    arrivals: usize,
    frames_per_s: usize,
    latency_ms: Option<u64>,
    counted_at: Instant,
    newest_at: Instant,
    help: bool,
    rebuilds: u32,
    error: Option<SinkError>,
}

impl App {
    fn open(&mut self, event_loop: &ActiveEventLoop) -> Result<(), String> {
        let attributes = Window::default_attributes()
            .with_title("insonify")
            .with_inner_size(LogicalSize::new(1440.0, 900.0))
            .with_fullscreen(self.full_screen.then_some(Fullscreen::Borderless(None)));
        let window = Arc::new(event_loop.create_window(attributes).map_err(|e| e.to_string())?);
        let graphics = Graphics::new(&window, self.display.clone())?;
        self.window = Some((window, graphics));
        self.redraw_all();
        Ok(())
    }

    fn fail(&mut self, event_loop: &ActiveEventLoop, reason: String) {
        self.error = Some(failed(reason));
        event_loop.exit();
    }

    /// Uploads the picture again and draws everything again.
    fn redraw_all(&mut self) {
        self.drawn = None;
        if let (Some((window, graphics)), Some(shown)) = (&mut self.window, &self.shown) {
            graphics.set_picture(shown.width, shown.height, &shown.image);
            window.request_redraw();
        }
    }

    /// Takes the newest frame, and exits if the sink has ended.
    fn poll(&mut self, event_loop: &ActiveEventLoop) {
        self.take_newest();
        if self.slot.state().sink_ended {
            event_loop.exit();
        }
    }

    fn take_newest(&mut self) {
        if !self.slot.take(&mut self.spare) {
            return;
        }
        let shown = self.shown.get_or_insert_default();
        std::mem::swap(shown, &mut self.spare);
        (self.newest_at, self.arrivals) = (Instant::now(), self.arrivals + 1);
        if self.wanted_at.is_none_or(|at| at.elapsed() > HOLD) {
            self.wanted = shown.info.settings;
        }
        if let Some((window, graphics)) = &mut self.window {
            graphics.set_picture(shown.width, shown.height, &shown.image);
            window.request_redraw();
        }
    }

    fn draw(&mut self, event_loop: &ActiveEventLoop) {
        let Some((window, graphics)) = &mut self.window else { return };
        let size = window.inner_size();
        let scale = (window.scale_factor().round() as u32).max(1);
        let marks_size = (size.width.div_ceil(scale).max(1), size.height.div_ceil(scale).max(1));
        let shown = self.shown.as_ref();
        let banner = marks::banner(shown, self.newest_at.elapsed() > SILENCE);
        let (frames_per_s, latency_ms) = (self.frames_per_s, self.latency_ms);
        let figures = Figures { frames_per_s, latency_ms, help: self.help, banner };
        let resized = self.canvas.size() != marks_size;
        let is_drawn = self.drawn.as_ref().is_some_and(|(drawn_figures, drawn)| {
            *drawn_figures == figures && drawn.as_ref().map(labels) == shown.map(labels)
        });
        if resized || !is_drawn {
            if resized {
                self.canvas = Canvas::new(marks_size.0, marks_size.1, [0; 3]);
            }
            marks::draw(&mut self.canvas, shown, &figures);
            graphics.set_marks(&self.canvas);
            self.drawn = Some((figures, shown.map(without_image)));
        }
        let picture = marks::placement(shown.map_or((1, 1), |s| (s.width, s.height)), marks_size);
        let brightness = match banner {
            Some(Banner::Waiting) => 0.0,
            Some(Banner::Silent | Banner::Lost) => 0.4,
            Some(Banner::Stale | Banner::Stuck) | None => 1.0,
        };
        window.pre_present_notify();
        match graphics.draw(&Drawing { picture, brightness, marks_scale: scale }) {
            Drawn::Done => self.rebuilds = 0,
            Drawn::Again => window.request_redraw(),
            Drawn::Lost => self.rebuild(event_loop),
        }
    }

    /// Rebuilds device and surface.
    fn rebuild(&mut self, event_loop: &ActiveEventLoop) {
        self.rebuilds += 1;
        if self.rebuilds > REBUILDS_MAX {
            return self.fail(event_loop, "its graphics are lost again and again; update the driver".to_owned());
        }
        tracing::warn!("the window's surface was lost; it is built anew");
        // Drops the old surface first, because a window has one surface at a time.
        let Some((window, graphics)) = self.window.take() else { return };
        drop(graphics);
        match Graphics::new(&window, self.display.clone()) {
            Ok(graphics) => {
                self.window = Some((window, graphics));
                self.redraw_all();
            }
            Err(reason) => self.fail(event_loop, reason),
        }
    }

    fn key(&mut self, event_loop: &ActiveEventLoop, key: &Key) {
        let action = match key {
            Key::Named(NamedKey::Escape) if self.help => Some(Action::Help),
            key => key_name(key).and_then(|name| hot_key(Display::Window, name)),
        };
        let Some(action) = action else { return };
        match action {
            Action::Help => self.help = !self.help,
            Action::FullScreen => {
                if let Some((window, _)) = &self.window {
                    let full = window.fullscreen().is_none().then_some(Fullscreen::Borderless(None));
                    window.set_fullscreen(full);
                }
            }
            Action::Quit => return self.quit(event_loop),
            action => {
                self.wanted_at = Some(Instant::now());
                let assignments = action.assignments(&self.wanted);
                // The key's action keeps values in range. Otherwise the settings stay unchanged.
                self.wanted = self.wanted.with(&assignments).unwrap_or(self.wanted);
                if let Err(e) = self.controls.try_send(Control::Set(assignments)) {
                    tracing::warn!("a key was not followed: {e}");
                }
            }
        }
        if let Some((window, _)) = &self.window {
            window.request_redraw();
        }
    }

    fn quit(&mut self, event_loop: &ActiveEventLoop) {
        if let Err(e) = self.controls.try_send(Control::Quit) {
            tracing::warn!("the window is closed, but the session did not hear of it: {e}");
        }
        event_loop.exit();
    }
}

/// Values of a frame that the marks depend on.
fn labels(shown: &Shown) -> impl PartialEq + '_ {
    let FrameInfo { estimate, settings, .. } = &shown.info;
    let picture = (shown.width, shown.height, shown.pixel_mm, shown.face_row);
    (picture, shown.source, estimate.state, settings, &shown.generator, &shown.notice)
}

fn without_image(shown: &Shown) -> Shown {
    Shown { image: Vec::new(), generator: shown.generator.clone(), notice: shown.notice.clone(), ..*shown }
}

/// Name of the key as in the browser's `KeyboardEvent.key`; `None` for special keys that the window does not use.
fn key_name(key: &Key) -> Option<&str> {
    match key {
        Key::Character(text) => Some(text.as_str()),
        Key::Named(named) => Some(match named {
            NamedKey::Space => " ",
            NamedKey::ArrowUp => "ArrowUp",
            NamedKey::ArrowDown => "ArrowDown",
            NamedKey::ArrowLeft => "ArrowLeft",
            NamedKey::ArrowRight => "ArrowRight",
            NamedKey::PageUp => "PageUp",
            NamedKey::PageDown => "PageDown",
            NamedKey::Home => "Home",
            NamedKey::End => "End",
            _ => return None,
        }),
        _ => None,
    }
}

impl ApplicationHandler<Wake> for App {
    fn new_events(&mut self, event_loop: &ActiveEventLoop, cause: StartCause) {
        if !matches!(cause, StartCause::ResumeTimeReached { .. } | StartCause::Init) {
            return;
        }
        let seconds = self.counted_at.elapsed().as_secs_f64();
        if seconds >= 1.0 {
            self.frames_per_s = (self.arrivals as f64 / seconds).round() as usize;
            (self.arrivals, self.counted_at) = (0, Instant::now());
        }
        self.latency_ms = self.shown.as_ref().and_then(|shown| shown.latency).map(|time| time.as_millis() as u64);
        if let Some((window, _)) = &self.window {
            window.request_redraw();
        }
        event_loop.set_control_flow(ControlFlow::WaitUntil(Instant::now() + TICK));
    }

    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.window.is_none()
            && let Err(reason) = self.open(event_loop)
        {
            self.fail(event_loop, reason);
        }
        // A frame may have arrived before this loop could be woken.
        self.poll(event_loop);
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, _wake: Wake) {
        self.poll(event_loop);
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _id: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => self.quit(event_loop),
            WindowEvent::Resized(size) => {
                if let Some((window, graphics)) = &mut self.window {
                    graphics.resize(size.width, size.height);
                    window.request_redraw();
                }
            }
            WindowEvent::ScaleFactorChanged { .. } => self.redraw_all(),
            WindowEvent::RedrawRequested => self.draw(event_loop),
            WindowEvent::KeyboardInput { event, .. } => {
                let KeyEvent { logical_key, state: ElementState::Pressed, .. } = event else { return };
                self.key(event_loop, &logical_key);
            }
            _ => {}
        }
    }

    fn exiting(&mut self, _event_loop: &ActiveEventLoop) {
        // The surface must be dropped before the connection to the display.
        self.window = None;
    }
}
