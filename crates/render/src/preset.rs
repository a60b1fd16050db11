//! Named qualities: rays and layers.

use std::str::FromStr;

use insonify_core::settings::{Quality, Setting, SettingsGroup};
use thiserror::Error;

use super::frame_quality::FrameQuality;

/// Error: a text that names no preset.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("`{found}` is no preset; they are {}", Preset::NAMES.join(", "))]
pub struct UnknownPreset {
    /// The text that was found.
    pub found: String,
}

/// A named quality; the variants are in order of rising cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Preset {
    /// 1 ray × 1 layer: the paper's low quality.
    Fast,
    /// 2 rays × 3 layers: includes the tissue on both sides of the scan plane.
    Balanced,
    /// 32 rays × 3 layers: the paper's high quality.
    Accurate,
    /// 128 rays × 3 layers: four times the paths of the paper's high quality.
    Reference,
}

insonify_core::names::named!(Preset {
    Fast = "fast",
    Balanced = "balanced",
    Accurate = "accurate",
    Reference = "reference",
});

impl Preset {
    /// Rays and layers of the preset.
    pub const fn quality(self) -> FrameQuality {
        match self {
            Self::Fast => FrameQuality::new(1, 1),
            Self::Balanced => FrameQuality::new(2, 3),
            Self::Accurate => FrameQuality::new(32, 3),
            Self::Reference => FrameQuality::new(128, 3),
        }
    }
}

impl FromStr for Preset {
    type Err = UnknownPreset;

    fn from_str(text: &str) -> Result<Self, UnknownPreset> {
        Self::named(text).ok_or_else(|| UnknownPreset { found: text.to_owned() })
    }
}

impl FrameQuality {
    /// Texts that [`FrameQuality`]'s [`FromStr`] accepts, in a phrase: presets, `lq`, `hq`, and the ranges of rays and
    /// layers.
    pub fn accepted() -> String {
        let preset = |preset: Preset| format!("{} ({})", preset.name(), preset.quality());
        let presets = Preset::ALL.map(preset).join(", ");
        let [rays, layers] =
            ["rays", "layers"].map(|key| Quality::setting(key).map_or_else(String::new, Setting::range));
        format!("{presets}, lq ({}), hq ({}), or rays x layers: {rays} x {layers}", Self::LQ, Self::HQ)
    }
}

/// Error: a text that names no quality.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("expected {}, such as `8x1`", FrameQuality::accepted())]
pub struct NoQuality;

impl FromStr for FrameQuality {
    type Err = NoQuality;

    /// Parses a preset, `lq`, `hq`, or rays and layers such as `8x1`; the quality has one steering angle.
    fn from_str(text: &str) -> Result<Self, NoQuality> {
        let text = text.to_ascii_lowercase();
        match text.as_str() {
            "lq" => Ok(Self::LQ),
            "hq" => Ok(Self::HQ),
            name => match Preset::named(name) {
                Some(preset) => Ok(preset.quality()),
                None => {
                    let numbers = name.split_once('x').and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
                    let given = numbers.map(|(rays, layers)| Self::new(rays, layers));
                    given.filter(|given| given.with_seed(0).validate().is_ok()).ok_or(NoQuality)
                }
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read() {
        assert_eq!(Preset::NAMES.iter().map(|name| name.parse().unwrap()).collect::<Vec<Preset>>(), Preset::ALL);
        let error = "best".parse::<Preset>().unwrap_err().to_string();
        assert_eq!(error, "`best` is no preset; they are fast, balanced, accurate, reference");
        assert_eq!(Preset::Reference.quality().to_string(), "128x3");
    }

    #[test]
    fn cost_rises_from_the_papers_low_quality_to_beyond_its_high_one() {
        assert!(Preset::ALL.map(|preset| preset.quality().paths()).is_sorted());
        for (preset, Quality { rays, layers, .. }) in [(Preset::Fast, Quality::LQ), (Preset::Accurate, Quality::HQ)] {
            assert_eq!(preset.quality(), FrameQuality::new(rays, layers));
        }
    }

    #[test]
    fn names_and_products_are_understood() {
        let quality = |text: &str| text.parse::<FrameQuality>().map(|q| q.with_seed(7));
        assert_eq!(quality("lq"), Ok(Quality { seed: 7, ..Quality::LQ }));
        assert_eq!(quality("HQ"), Ok(Quality { seed: 7, ..Quality::HQ }));
        assert_eq!(quality("8x2"), Ok(Quality { rays: 8, layers: 2, seed: 7 }));
        for (text, rays, layers) in [("fast", 1, 1), ("Balanced", 2, 3), ("accurate", 32, 3), ("reference", 128, 3)] {
            assert_eq!(quality(text), Ok(Quality { rays, layers, seed: 7 }));
        }
        let error = quality("best").unwrap_err().to_string();
        assert!(error.contains("balanced (2x3)") && error.contains("hq (32x3)"), "{error}");
        assert!(error.contains("rays x layers: 1..=256 x 1..=33"), "{error}");
        for wrong in ["", "x", "8", "8x", "0x1", "1x0", "257x1", "1x34", "-1x1", "8x2x1", "mq"] {
            assert!(quality(wrong).is_err(), "{wrong}");
        }
    }
}
