//! Classes of abdominal walls.

pub use crate::settings::Wall;

impl Wall {
    /// Default thickness of the subcutaneous fat for this class of wall, mm.
    pub fn fat_mm(self) -> f64 {
        match self {
            Self::Easy | Self::Average => 13.5,
            Self::Hard => 24.0,
        }
    }
}
