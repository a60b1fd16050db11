//! Filter and prediction of a tracker's poses.

use super::settings;

settings! {
    /// Filter and prediction of poses: `[filter]` of a station file.
    ///
    /// Defaults suit a tracker of about 60 measurements per second with noise of 0.1 to 0.2 mm and degrees. They trade
    /// noise at rest against error at display, as measured by the tests of the estimator.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct FilterSettings in "filter" {
        /// Cutoff of the position's One-Euro filter at rest; lower is steadier and lags more.
        min_cutoff_hz: f64 = 1.0, "Hz", 0.01..=1000.0, Everything;

        /// Rise of the position's cutoff with speed; higher lags less.
        beta: f64 = 0.5, "Hz per mm/s", 0.0..=100.0, Everything;

        /// Cutoff of the rotation's filter at rest.
        rotation_min_cutoff_hz: f64 = 1.0, "Hz", 0.01..=1000.0, Everything;

        /// Rise of the rotation's cutoff with angular speed; higher lags less.
        rotation_beta: f64 = 0.5, "Hz per degree/s", 0.0..=100.0, Everything;

        /// Cutoff of the low-pass filters of speed and angular speed.
        speed_cutoff_hz: f64 = 1.5, "Hz", 0.01..=1000.0, Everything;

        /// Longest prediction towards the time of display; 0 disables prediction.
        prediction_ms: f64 = 30.0, "ms", 0.0..=200.0, Everything;

        // The ranges of the next three do not overlap, so their values always ascend.
        /// Age of the last measurement above which the pose is held.
        held_ms: f64 = 100.0, "ms", 1.0..=500.0, Everything;

        /// Age of the last measurement above which the pose is stale.
        stale_ms: f64 = 500.0, "ms", 500.0..=2000.0, Everything;

        /// Age of the last measurement above which the pose is lost.
        lost_ms: f64 = 2000.0, "ms", 2000.0..=3_600_000.0, Everything;

        /// Duration of exactly equal readings that counts as stuck; 0 disables the check.
        stuck_ms: f64 = 2000.0, "ms", 0.0..=3_600_000.0, Everything;

        /// Fastest motion of a hand; a measurement beyond it is dropped unless the next one confirms it.
        max_speed_mm_s: f64 = 3000.0, "mm/s", 1.0..=1e9, Everything;

        /// Fastest rotation of a hand; a measurement beyond it is dropped unless the next one confirms it.
        max_speed_deg_s: f64 = 2000.0, "degrees/s", 1.0..=1e9, Everything;

        /// Speed at full deflection of a device that sends rates (SpaceMouse).
        puck_mm_s: f64 = 80.0, "mm/s", 0.0..=10_000.0, Everything;

        /// Angular speed at full deflection of a device that sends rates (SpaceMouse).
        puck_deg_s: f64 = 45.0, "degrees/s", 0.0..=10_000.0, Everything;
    }
}
