//! Live session: rate, deadline, and choice between raw and generated frames.

use super::settings;

settings! {
    /// Conditions for showing generated pictures.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct ChoiceSettings in "pipeline" {
        /// Largest distance from the last generated frame's pose at which that frame is held.
        hold_mm: f64 = 0.3, "mm", 0.0..=100.0, Nothing;

        /// Largest angle from the last generated frame's pose at which that frame is held.
        hold_deg: f64 = 0.3, "degrees", 0.0..=180.0, Nothing;

        /// Consecutive frames that the generator must be ready for before its frames are shown.
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

        /// Time limit of submitting a frame to a GPU, and of waiting for it; beyond it the GPU counts as lost and is opened again.
        device_hang_ms: f64 = 2000.0, "ms", 100.0..=600_000.0, Everything;

        /// Time in which displays and files must take their last frame at the end; one that is later counts as stuck.
        finish_ms: f64 = 10_000.0, "ms", 100.0..=600_000.0, Everything;
    }
    nested {
        /// Conditions for showing generated pictures.
        choice: ChoiceSettings,
    }
}
