//! A native window that shows the live station, with the page's keys.
//!
//! Operating systems require events to be read on the main thread, so the window has two halves. `WindowSink` is a
//! live sink; `run_on_main_thread` shows its frames until the window is closed or the sink ends. They share a
//! `WindowSlot`, which holds the newest frame.

#[cfg(feature = "window")]
mod event_loop;
#[cfg(feature = "window")]
mod graphics;
#[cfg(feature = "window")]
mod marks;
#[cfg(feature = "window")]
mod sink;

#[cfg(feature = "window")]
pub use event_loop::run_on_main_thread;
#[cfg(feature = "window")]
pub use sink::{WindowSink, WindowSlot};

pub use crate::settings::WindowSettings as Settings;
