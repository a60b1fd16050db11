//! Sizes of the aperture's grid as the shaders read them.

use bytemuck::{Pod, Zeroable};

use super::{ApertureTables, Sampling};

/// Mode number that marks padding.
pub(crate) const MODE_NONE: i32 = 0x7fff;

/// `Aperture` of `shaders/shared/aperture.wgsl`.
#[derive(Debug, Clone, Copy, Pod, Zeroable, PartialEq)]
#[repr(C)]
pub(crate) struct ApertureShape {
    cells: u32,
    planes: u32,
    beams: u32,
    node_cells: u32,
    halves_at: u32,
    modes: u32,
    lasting_modes: u32,
    plane_mm: f32,
    offsets: u32,
    plane_samples: u32,
    turns_per_mm: f32,
    line_spacing_cells: f32,
}

impl ApertureShape {
    /// Sizes as the shaders read them. Without `refraction`, `turns_per_mm` is 0: delays turn no phase.
    pub(crate) fn new(tables: &ApertureTables, refraction: bool) -> Self {
        let Sampling { cells, beams, node_cells, halves_at, modes, lasting_modes } = tables.sampling;
        Self {
            cells: cells as u32,
            planes: tables.planes as u32,
            beams: beams as u32,
            node_cells: node_cells as u32,
            halves_at: halves_at as u32,
            modes: modes as u32,
            lasting_modes: lasting_modes as u32,
            plane_mm: tables.plane_mm,
            offsets: tables.sampling.offsets() as u32,
            plane_samples: tables.plane_samples,
            turns_per_mm: if refraction { tables.turns_per_mm() } else { 0.0 },
            line_spacing_cells: tables.line_spacing_cells,
        }
    }
}
