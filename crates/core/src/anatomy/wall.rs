//! Classes of abdominal walls.

pub use crate::settings::Wall;

impl Wall {
    /// Thickness of the subcutaneous fat unless another is asked for, mm.
    pub fn fat_mm(self) -> f64 {
        match self {
            Self::Easy | Self::Average => 13.5,
            Self::Hard => 24.0,
        }
    }
}
