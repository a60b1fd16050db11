//! Scaling of grey levels for feature extractors.

use std::fmt;
use std::str::FromStr;

/// Range to which grey levels are scaled for a feature extractor's input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FeatureScale {
    /// −1..=1, the range of Inception v3.
    #[default]
    Signed,
    /// 0..=1.
    Unit,
    /// 0..=255.
    Grey,
}

crate::names::named!(FeatureScale { Signed = "signed", Unit = "unit", Grey = "grey" });

impl fmt::Display for FeatureScale {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for FeatureScale {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::named(text)
            .ok_or_else(|| format!("unknown scale `{text}`; scales are signed (-1..1), unit (0..1) and grey (0..255)"))
    }
}
