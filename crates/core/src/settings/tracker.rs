//! Trackers: waiting times, formats, and the playback of recordings.

use super::{settings, stored_word};

/// Report value of a SpaceMouse axis at full deflection.
pub const PUCK_RANGE: f64 = 350.0;

/// Format in which an NDI device is asked to reply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReplyFormat {
    /// `BX`: binary.
    #[default]
    Binary,
    /// `TX`: text, the only format of older devices.
    Text,
}

crate::names::named!(ReplyFormat { Binary = "BX", Text = "TX" });

/// Whether playback of a recording restarts at its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Repeat {
    /// The session ends with the recording.
    #[default]
    No,
    /// Playback restarts from the beginning.
    Yes,
}

crate::names::named!(Repeat { No = "no", Yes = "yes" });

stored_word!(ReplyFormat);
stored_word!(Repeat);

settings! {
    /// Settings of `[tracker]`, in addition to its transport.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct TrackerSettings in "tracker" {
        /// Duration of silence after which the tracker is restarted.
        silence_ms: f64 = 2000.0, "ms", 10.0..=600_000.0, Everything;

        /// Time that a Polhemus device takes to start after a reset.
        reset_delay_ms: f64 = 20_000.0, "ms", 0.0..=120_000.0, Everything;

        /// Whether an NDI tool outside of the characterised volume still gives poses.
        ndi_out_of_volume: bool = true, "", 0.0..=1.0, Everything;

        /// Format of replies requested from an NDI device: binary, or text, the only format of older devices.
        ndi_reply: ReplyFormat = ReplyFormat::Binary, "", ReplyFormat::RANGE, Everything;

        /// Report value of a SpaceMouse at full deflection; `[filter] puck_mm_s` and `puck_deg_s` are the speeds there.
        puck_range: f64 = PUCK_RANGE, "", 1.0..=32_767.0, Everything;

        /// Playback speed relative to the recording; 0: as fast as the session takes measurements.
        speed: f64 = 1.0, "", 0.0..=1000.0, Everything;

        /// Whether playback restarts at the end of the recording.
        repeat: Repeat = Repeat::No, "", Repeat::RANGE, Everything;
    }
}
