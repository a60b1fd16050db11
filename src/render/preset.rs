//! Named qualities.

use std::str::FromStr;

use thiserror::Error;

use super::frame_quality::FrameQuality;

/// A text that names no preset.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("`{found}` is no preset; they are {}", Preset::NAMES.join(", "))]
pub struct UnknownPreset {
    /// The text.
    pub found: String,
}

/// A named quality, in rising cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Preset {
    /// 1 ray × 1 layer: the paper's low quality.
    Fast,
    /// 2 rays × 3 layers: with the tissue beside the scan plane.
    Balanced,
    /// 32 rays × 3 layers: the paper's high quality.
    Accurate,
    /// 128 rays × 3 layers: four times the paths of the paper's high quality.
    Reference,
}

crate::names::named!(Preset {
    Fast = "fast",
    Balanced = "balanced",
    Accurate = "accurate",
    Reference = "reference",
});

impl Preset {
    /// Its rays and layers.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Quality;

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
}
