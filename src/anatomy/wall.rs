//! Classes of abdominal walls.

use serde::{Deserialize, Serialize};

/// Aberration class of an abdominal wall. Delays are RMS over 30 mm of aperture, about their best-fit plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Wall {
    /// At most 20 ns.
    #[default]
    Easy,
    /// 40 to 50 ns.
    Average,
    /// At least 60 ns, behind more fat.
    Hard,
}

impl Wall {
    /// Thickness of the subcutaneous fat unless another is asked for, mm.
    pub fn fat_mm(self) -> f64 {
        match self {
            Self::Easy | Self::Average => 13.5,
            Self::Hard => 24.0,
        }
    }
}

crate::names::named!(Wall { Easy = "easy", Average = "average", Hard = "hard" });
