//! What a frame shall look like and how much work goes into it.

use thiserror::Error;

use super::constants::{AXIAL_HALF_MAX, LATERAL_HALF_MAX};
use super::effect::EffectChoices;

/// Reflections after which a path is always given up.
pub const REFLECTIONS_MAX: u32 = 6;
/// Taps of the widest lateral beam that its pass holds.
pub const BEAM_TAPS_MAX: u32 = 2 * LATERAL_HALF_MAX + 1;
/// Taps of the longest pulse that its pass holds.
pub const PULSE_TAPS_MAX: u32 = 2 * AXIAL_HALF_MAX + 1;

/// A setting outside its range.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("{key} is {value}; it must lie in {min}..={max}")]
pub struct SettingsError {
    /// Key in the station file, with its table.
    pub key: &'static str,
    /// Value found.
    pub value: f64,
    /// Least accepted.
    pub min: f64,
    /// Greatest accepted.
    pub max: f64,
}

/// The `[image]` of a station.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageSettings {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Levels from black to white, dB.
    pub dynamic_range_db: f64,
    /// Level added everywhere, dB. With 0 dB an unattenuated perfect reflector is white.
    pub gain_db: f64,
    /// Time-gain compensation, dB a cm of depth.
    pub tgc_db_per_cm: f64,
    /// The sliders: gain at eight depths evenly from the face to the full depth, dB, with straight lines between them.
    pub tgc_sliders_db: [f64; 8],
}

impl Default for ImageSettings {
    fn default() -> Self {
        Self {
            width: 1386,
            height: 1000,
            dynamic_range_db: 60.0,
            gain_db: 0.0,
            tgc_db_per_cm: 8.0,
            tgc_sliders_db: [0.0; 8],
        }
    }
}

/// How many paths, and which.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quality {
    /// Rays per scanline and layer.
    pub rays: u32,
    /// Elevational layers.
    pub layers: u32,
    /// Seed of every random choice.
    pub seed: u32,
}

impl Quality {
    /// Low quality: 1 ray × 1 layer.
    pub const LQ: Self = Self { rays: 1, layers: 1, seed: 0 };
    /// High quality: 32 rays × 3 layers.
    pub const HQ: Self = Self { rays: 32, layers: 3, seed: 0 };
}

impl Default for Quality {
    fn default() -> Self {
        Self::LQ
    }
}

/// All that a renderer is built for, beside scene and probe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderSettings {
    /// Image.
    pub image: ImageSettings,
    /// Paths.
    pub quality: Quality,
    /// Reflections that a path is followed through, 0..=6: with 0 none ever forms a mirror image or reverberates.
    pub reflections_max: u32,
    /// Most taps of the lateral beam, 3..=65; a wider beam is cut, and its speckle is narrower. An even number has one less.
    pub beam_taps_max: u32,
    /// Most taps of the pulse, 3..=257; likewise.
    pub pulse_taps_max: u32,
    /// Whether frames carry the complex baseband lines.
    pub lines: bool,
    /// Whether frames carry segmentation and attenuation. Without them the image is the same, bit for bit, and sooner there.
    pub maps: bool,
    /// What is said of effects, over what the plan finds ([`EffectPlan`](super::EffectPlan)).
    pub effects: EffectChoices,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            image: ImageSettings::default(),
            quality: Quality::default(),
            reflections_max: REFLECTIONS_MAX,
            beam_taps_max: BEAM_TAPS_MAX,
            pulse_taps_max: PULSE_TAPS_MAX,
            lines: false,
            maps: true,
            effects: EffectChoices::default(),
        }
    }
}

impl RenderSettings {
    /// Checks every value against its range.
    ///
    /// # Errors
    /// The first value outside its range, NaN included.
    pub fn validate(&self) -> Result<(), SettingsError> {
        let checks = [
            ("image.width", f64::from(self.image.width), 16.0, 4096.0),
            ("image.height", f64::from(self.image.height), 16.0, 4096.0),
            ("image.dynamic_range_db", self.image.dynamic_range_db, 1.0, 200.0),
            ("image.gain_db", self.image.gain_db, -200.0, 200.0),
            ("image.tgc_db_per_cm", self.image.tgc_db_per_cm, 0.0, 100.0),
            ("quality.rays", f64::from(self.quality.rays), 1.0, 256.0),
            ("quality.layers", f64::from(self.quality.layers), 1.0, 33.0),
            ("quality.reflections_max", f64::from(self.reflections_max), 0.0, f64::from(REFLECTIONS_MAX)),
            ("quality.beam_taps_max", f64::from(self.beam_taps_max), 3.0, f64::from(BEAM_TAPS_MAX)),
            ("quality.pulse_taps_max", f64::from(self.pulse_taps_max), 3.0, f64::from(PULSE_TAPS_MAX)),
        ];
        let sliders = self.image.tgc_sliders_db.iter().map(|&db| ("image.tgc_sliders_db", db, -100.0, 100.0));
        for (key, value, min, max) in checks.into_iter().chain(sliders) {
            if !(value >= min && value <= max) {
                return Err(SettingsError { key, value, min, max });
            }
        }
        Ok(())
    }
}
