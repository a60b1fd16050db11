//! How far a live pose can be trusted.

/// State of the probe's pose, each visible to the user.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, PartialOrd, Ord)]
pub enum TrackingState {
    /// Measured lately.
    Good,
    /// The last pose is held over a short gap.
    Held,
    /// No measurement for so long that the picture no longer follows the probe.
    Stale,
    /// No measurement for so long that there is no picture, or none yet.
    #[default]
    Lost,
}
