//! A native window that shows the live station.

/// The `[window]` of a station.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Settings {
    /// Whether the window fills the screen at first.
    pub full_screen: bool,
}
