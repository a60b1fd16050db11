//! Native window.

use super::settings;

settings! {
    /// The `[window]` of a station.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct WindowSettings in "window" {
        /// Whether the native window fills the screen; the key F toggles it.
        full_screen: bool = false, "", 0.0..=1.0, Everything;
    }
}
