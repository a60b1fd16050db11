//! Live session: rate, deadline, and choice between raw and generated frames.

use super::settings;

settings! {
    /// Conditions for showing generated pictures.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct ChoiceSettings in "pipeline" {
        /// Largest distance from the last generated frame's pose at which that frame stays on display.
        hold_mm: f64 = 0.3, "mm", 0.0..=100.0, Nothing;

        /// Largest angle from the last generated frame's pose at which that frame stays on display.
        hold_deg: f64 = 0.3, "degrees", 0.0..=180.0, Nothing;

        /// Number of consecutive frames for which the generator must be ready before its frames are shown.
        steady_frames: u32 = 8, "", 1.0..=256.0, Nothing;
    }
}

settings! {
    /// The `[pipeline]` of a station.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct PipelineSettings in "pipeline" {
        /// Frames per second; a slower device gives as many as it can.
        frame_rate_hz: f64 = 30.0, "Hz", 0.1..=1000.0, Everything;

        /// Longest time from sampling a frame's pose until it is shown, whatever the generator does.
        deadline_ms: f64 = 100.0, "ms", 0.0..=10_000.0, Everything;

        /// Duration of a generator run that counts as hanging.
        hang_ms: f64 = 5000.0, "ms", 10.0..=600_000.0, Everything;

        /// Time limit for a GPU to accept and to complete a frame; a slower GPU counts as lost and is opened again.
        device_hang_ms: f64 = 2000.0, "ms", 100.0..=600_000.0, Everything;

        /// Time limit for displays and files to take the session's last frame; a slower one counts as stuck.
        finish_ms: f64 = 10_000.0, "ms", 100.0..=600_000.0, Everything;
    }
    nested {
        /// Conditions for showing generated pictures.
        choice: ChoiceSettings,
    }
}
