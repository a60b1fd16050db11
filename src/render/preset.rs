//! Quality points, rays × layers, and their names.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

use crate::settings::Quality;

/// Rays × layers, written `8x1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct QualityPoint {
    /// Rays per scanline and layer, 1..=256.
    pub rays: u32,
    /// Elevational layers, 1..=33.
    pub layers: u32,
}

impl QualityPoint {
    /// This point.
    pub const fn new(rays: u32, layers: u32) -> Self {
        Self { rays, layers }
    }

    /// The point with a seed.
    pub const fn with_seed(self, seed: u32) -> Quality {
        Quality { rays: self.rays, layers: self.layers, seed }
    }

    /// Paths per scanline: rays × layers.
    pub const fn paths(self) -> u32 {
        self.rays * self.layers
    }
}

impl From<Quality> for QualityPoint {
    fn from(quality: Quality) -> Self {
        Self::new(quality.rays, quality.layers)
    }
}

impl fmt::Display for QualityPoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.rays, self.layers)
    }
}

/// A text that names no preset.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("`{found}` is no preset; they are {}", Preset::NAMES.join(", "))]
pub struct UnknownPreset {
    /// The text.
    pub found: String,
}

/// A named point of the [`LADDER`](super::LADDER), in rising cost.
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
    pub const fn point(self) -> QualityPoint {
        match self {
            Self::Fast => QualityPoint::new(1, 1),
            Self::Balanced => QualityPoint::new(2, 3),
            Self::Accurate => QualityPoint::new(32, 3),
            Self::Reference => QualityPoint::new(128, 3),
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

    #[test]
    fn names_are_read() {
        assert_eq!(Preset::NAMES.iter().map(|name| name.parse().unwrap()).collect::<Vec<Preset>>(), Preset::ALL);
        let error = "best".parse::<Preset>().unwrap_err().to_string();
        assert_eq!(error, "`best` is no preset; they are fast, balanced, accurate, reference");
        assert_eq!(Preset::Reference.point().to_string(), "128x3");
    }
}
