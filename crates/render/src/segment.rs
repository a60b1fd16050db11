//! A straight segment of a path in the buffers of host and device: `shaders/shared/segment.wgsl`, field by field.

use bytemuck::{Pod, Zeroable};

use crate::constants::{HAS_REFLECTED, TAG_DENSITY, TEXTURE_MASK, TEXTURE_SHIFT};

/// A straight stretch of a path in one medium. Position and ln amplitude are linear in the range ρ, mm.
///
/// The fields are those of [`twin::Segment`](crate::twin::Segment), except the start range and the echo, which have
/// buffers of their own.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Segment {
    /// Position at which scatterers are looked up at ρ = 0, scene at rest, mm.
    pub(crate) origin_mm: [f32; 3],
    /// ln of the two-way amplitude at ρ = 0.
    pub(crate) ln_amplitude_at_zero: f32,
    /// Change of the lookup position per mm of range.
    pub(crate) step: [f32; 3],
    /// Decrease of the ln amplitude, nepers per mm of range.
    pub(crate) fall_np_mm: f32,
    /// Mean amplitude of the medium's scatterers.
    pub(crate) scatterer_mean: f32,
    /// Standard deviation of the scatterers' amplitude.
    pub(crate) scatterer_deviation: f32,
    /// Scatterer density, texture number, [`HAS_REFLECTED`] and [`TAG`](crate::constants::TAG) in one word.
    pub(crate) scatterers: u32,
    /// ln of the two-way amplitude at ρ = 0 of a wave that passes every interface. From the first reflection on, it
    /// keeps its value just beyond the reflecting interface.
    pub(crate) ln_passed_at_zero: f32,
}

impl Segment {
    /// Fraction of the lattice's cells that contain a scatterer, in 1/131072.
    #[inline(always)]
    pub(crate) const fn scatterer_density(&self) -> u32 {
        self.scatterers & TAG_DENSITY
    }

    /// Number of the medium's texture; 0 if it is uniform.
    #[inline(always)]
    pub(crate) const fn texture(&self) -> usize {
        (self.scatterers >> TEXTURE_SHIFT & TEXTURE_MASK) as usize
    }

    /// Whether the path has reflected before this segment.
    #[inline(always)]
    pub(crate) const fn has_reflected(&self) -> bool {
        self.scatterers & HAS_REFLECTED != 0
    }

    /// Loss from the face to a range, one-way nepers. Only valid on segments before the first reflection.
    #[inline(always)]
    pub(crate) fn loss_np(&self, range_mm: f32) -> f32 {
        0.5 * (self.fall_np_mm * range_mm - self.ln_passed_at_zero)
    }
}
