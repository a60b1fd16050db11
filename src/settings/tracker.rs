//! Trackers: times, and the playback of recordings.

use super::settings;

/// Report value of a SpaceMouse at full deflection.
pub const PUCK_RANGE: f64 = 350.0;

settings! {
    /// Settings of `[tracker]`, beside its transport.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct TrackerSettings in "tracker" {
        /// Silence after which the tracker is started anew.
        silence_ms: f64 = 2000.0, "ms", 10.0..=600_000.0, Everything;

        /// Time that a Polhemus device takes to start after a reset.
        reset_delay_ms: f64 = 20_000.0, "ms", 0.0..=120_000.0, Everything;

        /// Whether an NDI tool outside of the characterised volume still gives poses.
        ndi_out_of_volume: bool = true, "", 0.0..=1.0, Everything;

        /// What a SpaceMouse reports when it is pushed all the way; `[filter] puck_mm_s` and `puck_deg_s` are the speeds there.
        puck_range: f64 = PUCK_RANGE, "", 1.0..=32_767.0, Everything;

        /// How many times as fast as recorded; 0: as fast as it is taken.
        speed: f64 = 1.0, "", 0.0..=1000.0, Everything;
    }
}
