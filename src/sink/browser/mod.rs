//! A page that shows the live station in a browser, and lets viewers control it.
//!
//! The sink listens on its own thread. Frames go to each page over a WebSocket as binary messages ([`wire`] has the
//! layout). A page acknowledges each drawn frame. At most two frames are unacknowledged, so a slow page skips frames.
//! Requests of a page are small JSON messages, which are checked before they become a
//! [`Control`](crate::settings::Control).

mod scene;

#[cfg(feature = "browser")]
mod access;
#[cfg(feature = "browser")]
mod assets;
#[cfg(feature = "browser")]
mod client;
#[cfg(feature = "browser")]
mod connections;
#[cfg(feature = "browser")]
mod messages;
#[cfg(feature = "browser")]
mod refusal;
#[cfg(feature = "browser")]
mod server;
#[cfg(feature = "browser")]
mod shared;
#[cfg(feature = "browser")]
mod sink;
#[cfg(feature = "browser")]
pub mod wire;

pub use crate::settings::{BrowserSettings as Settings, TOKEN_CHARS_MIN};
pub use scene::ScenePacket;

#[cfg(feature = "browser")]
pub use shared::ClientCounters;
#[cfg(feature = "browser")]
pub use sink::{BrowserMonitor, BrowserSink};

/// Tissues and surfaces of the scene, for pages.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SceneInfo {
    /// Names of the tissues; number n of a segmentation is `tissues[n - 1]`.
    pub tissues: Vec<String>,
    /// Surfaces for the 3-D view; without surfaces, the page has no 3-D view.
    pub surfaces: Option<ScenePacket>,
    /// Caliper measures of the scene's standard planes, by which measurements on the page can be named.
    pub measures: Vec<MeasureInfo>,
}

/// A caliper measure of a standard plane.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct MeasureInfo {
    /// Name, for example `BPD`.
    pub name: String,
    /// Display name.
    pub title: String,
    /// Tool that measures it on the page: `distance` or `ellipse`.
    pub kind: &'static str,
}
