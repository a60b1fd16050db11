//! Image: size, brightness, contrast and time-gain compensation.

use serde::Serialize;

use super::live_control::slider;
use super::settings;

/// Number of TGC sliders.
pub const TGC_SLIDERS: usize = 8;

settings! {
    /// The `[image]` of a station.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
    pub struct ImageSettings in "image", uniforms ImageUniforms {
        /// Image width.
        width: u32 = 1386, "pixels", 16.0..=4096.0, Everything;

        /// Image height.
        height: u32 = 1000, "pixels", 16.0..=4096.0, Everything;

        /// Gain; at 0 dB an unattenuated perfect reflector is white.
        gain_db: f64 = 0.0, "dB", -200.0..=200.0, Nothing,
            slider("Gain", "image", -40.0..=80.0, 1.0)
                .key("ArrowUp", "Up", "more gain", 1.0)
                .key("ArrowDown", "Down", "less gain", -1.0);

        /// Dynamic range, from black to white.
        dynamic_range_db: f64 = 60.0, "dB", 1.0..=200.0, Nothing,
            slider("Dynamic range", "image", 20.0..=120.0, 1.0)
                .caption("DR")
                .key("ArrowRight", "Right", "more dynamic range", 2.0)
                .key("ArrowLeft", "Left", "less dynamic range", -2.0);

        /// Time-gain compensation per cm of depth.
        tgc_db_per_cm: f64 = 8.0, "dB/cm", 0.0..=100.0, Nothing,
            slider("Slope", "tgc", 0.0..=20.0, 0.1).caption("TGC").shown("dB/cm", 1.0, 1);

        /// Gain added to the compensation at eight depths, evenly spaced from the face to the full depth.
        tgc_sliders_db: [f64; TGC_SLIDERS] = [0.0; TGC_SLIDERS], "dB", -100.0..=100.0, Nothing,
            slider("TGC slider", "tgc_sliders", -24.0..=24.0, 1.0).caption("");
    }
}
