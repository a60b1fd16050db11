//! Quality: number of paths, limits of their cost, and effects.

use serde::Serialize;

use super::live_control::hidden;
use super::{ContactSettings, EffectChoices, ImageSettings, LookSettings, NeedleSettings, ReceiverSettings, settings};

/// Largest value of `quality.reflections_max`.
pub(crate) const REFLECTIONS_MAX: u32 = 6;
/// Default of `quality.reflecting_share`: see `docs/notes/reflections.md`.
const REFLECTING_SHARE: f64 = 0.5;
/// Number of paths of a scanline that follow reflections at any `quality.reflecting_share`, if it has as many.
const REFLECTING_PATHS_MIN: f64 = 24.0;
/// Largest number of taps of the lateral kernel (the beam across scanlines) in its convolution pass; odd.
pub const BEAM_TAPS_MAX: u32 = 129;
/// Largest number of taps of the pulse in its convolution pass; odd.
pub const PULSE_TAPS_MAX: u32 = 257;

settings! {
    /// Number of paths, and their random seed.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
    pub struct Quality in "quality" {
        /// Number of rays per scanline and layer.
        rays: u32 = 1, "", 1.0..=256.0, Everything, hidden("Rays");

        /// Number of elevational layers.
        layers: u32 = 1, "", 1.0..=33.0, Everything, hidden("Layers");

        /// Seed of every random choice.
        seed: u32 = 0, "", 0.0..=4_294_967_295.0, Nothing;
    }
}

impl Quality {
    /// Low quality: 1 ray × 1 layer.
    pub const LQ: Self = Self { rays: 1, layers: 1, seed: 0 };
    /// High quality: 32 rays × 3 layers.
    pub const HQ: Self = Self { rays: 32, layers: 3, seed: 0 };

    /// Short name in captions and tables, independent of the seed: `LQ`, `HQ`, or rays × layers such as `8x1`.
    pub fn name(&self) -> String {
        match (Self { seed: 0, ..*self }) {
            Self::LQ => "LQ".to_owned(),
            Self::HQ => "HQ".to_owned(),
            Self { rays, layers, .. } => format!("{rays}x{layers}"),
        }
    }
}

settings! {
    /// All settings of a renderer except scene and probe. Serializes as the `[quality]` of a station.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
    pub struct RenderSettings in "quality" {
        /// Largest number of reflections of a path; 0: no mirror images or reverberation.
        reflections_max: u32 = REFLECTIONS_MAX, "", 0.0..=f64::from(REFLECTIONS_MAX), Nothing;

        /// Fraction of a scanline's paths that follow reflections; at least 24 paths follow them, or all if there are fewer.
        reflecting_share: f64 = REFLECTING_SHARE, "", 0.0..=1.0, Nothing;

        /// Whether an automatic number of samples is two thirds of the usual one: less time, and a coarser picture.
        coarse_samples: bool = false, "", 0.0..=1.0, Everything;

        /// Largest number of taps of the lateral beam, rounded down to odd; a wider beam is cut, with narrower speckle.
        beam_taps_max: u32 = BEAM_TAPS_MAX, "", 3.0..=f64::from(BEAM_TAPS_MAX), Tables;

        /// Largest number of taps of the pulse, rounded down to odd; a longer pulse is cut, with shorter speckle.
        pulse_taps_max: u32 = PULSE_TAPS_MAX, "", 3.0..=f64::from(PULSE_TAPS_MAX), Tables;
    }
    nested {
        /// Image.
        #[serde(skip)]
        image: ImageSettings,
        /// Number of paths, and their random seed.
        #[serde(flatten)]
        quality: Quality,
        /// Contact with the skin.
        #[serde(skip)]
        contact: ContactSettings,
        /// Additions of the receiver: noise, clutter, reverberation.
        #[serde(skip)]
        receiver: ReceiverSettings,
        /// Post-processing from lines to the display.
        #[serde(skip)]
        look: LookSettings,
    }
    plain {
        /// Whether frames carry the complex baseband lines.
        #[serde(skip)]
        lines: bool = false, Everything;
        /// Whether frames carry segmentation and attenuation maps. Without them, frames are faster; images are equal.
        #[serde(skip)]
        maps: bool = true, Nothing;
        /// Choices for effects, which override the plan.
        #[serde(skip)]
        effects: EffectChoices = EffectChoices::default(), Everything;
        /// The tracked needle; `None`: the station has no `[needle]`.
        #[serde(skip)]
        needle: Option<NeedleSettings> = None, Everything;
    }
}

impl RenderSettings {
    /// Number of paths of a scanline that follow reflections.
    pub fn reflecting_paths(&self) -> u32 {
        let paths = self.quality.rays * self.quality.layers;
        let wanted = (self.reflecting_share * f64::from(paths)).ceil().max(REFLECTING_PATHS_MIN);
        paths.min(wanted as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn qualities_have_short_names() {
        assert_eq!(Quality { seed: 1, ..Quality::HQ }.name(), "HQ");
        assert_eq!(Quality { rays: 8, layers: 1, seed: 0 }.name(), "8x1");
    }
}
