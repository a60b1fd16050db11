//! Grid of positions for a model in beam coordinates.

use serde::{Deserialize, Serialize};

/// Grid of a model in beam coordinates: rows are range cells, the first at the face; columns are scanlines.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BeamGrid {
    /// Number of scanlines over the sector's lateral extent, 16..=1024. It may differ from the probe's.
    pub scanlines: u32,
    /// Length of a range cell along the scanline, mm, 0.02..=2.
    pub cell_mm: f64,
    /// Share of the picture's detail finer than the grid that stays in the output, 0..=1. With 0, the output on the grid
    /// replaces the picture; with 1, the picture is changed by the difference between output and input on the grid.
    #[serde(default)]
    pub detail_kept: f32,
}

impl BeamGrid {
    /// Checks the values. The error describes the fault and the accepted range.
    pub(super) fn check(&self) -> Result<(), String> {
        if !(16..=1024).contains(&self.scanlines) {
            return Err(format!("beam.scanlines is {}; it must be 16..=1024", self.scanlines));
        }
        if !(0.02..=2.0).contains(&self.cell_mm) {
            return Err(format!("beam.cell_mm is {}; it must be 0.02..=2", self.cell_mm));
        }
        if !(0.0..=1.0).contains(&self.detail_kept) {
            return Err(format!("beam.detail_kept is {}; it must be 0..=1", self.detail_kept));
        }
        Ok(())
    }

    /// Number of range cells that cover `depth_mm`.
    pub fn cells(&self, depth_mm: f64) -> u32 {
        (depth_mm / self.cell_mm - 1e-6).ceil().max(1.0) as u32
    }
}
