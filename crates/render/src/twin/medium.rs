//! Acoustic properties of tissues, as the passes read them.

use crate::constants::{TAG_DENSITY, TEXTURE_MASK, TEXTURE_SHIFT};
use crate::tables::PackedTissue;

/// Acoustic properties of a tissue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Medium {
    /// Characteristic impedance, MRayl.
    pub impedance_mrayl: f64,
    /// c/c₀: mm of path per mm of range.
    pub speed_ratio: f64,
    /// c/c₀ in Snell's and Fresnel's laws; 1 without refraction.
    pub bending: f64,
    /// c/c₀ for sound that reaches the aperture past hard media: 1 in hard media, else `speed_ratio`.
    pub aperture_speed_ratio: f64,
    /// Two-way attenuation of the amplitude, nepers per mm of path.
    pub attenuation_np_mm: f64,
    /// RMS slope of the microfacets of its surfaces.
    pub roughness: f64,
    /// Fraction of the lattice's cells that contain a scatterer, in 1/131072.
    pub scatterer_density: u32,
    /// Number of its texture: index in the list of textures + 1; 0 if it is uniform.
    pub texture: usize,
    /// Mean amplitude of a scatterer.
    pub scatterer_mean: f64,
    /// Standard deviation of a scatterer's amplitude.
    pub scatterer_deviation: f64,
    /// Thickness of the transition at its surfaces, mm.
    pub thickness_mm: f64,
    /// Part of an interface's echo that stays in phase over its thickness, 0..=1.
    pub coherence: f64,
}

impl From<&PackedTissue> for Medium {
    fn from(tissue: &PackedTissue) -> Self {
        Self {
            impedance_mrayl: tissue.impedance_mrayl.into(),
            speed_ratio: tissue.speed_ratio.into(),
            bending: tissue.bending.into(),
            aperture_speed_ratio: tissue.aperture_speed_ratio.into(),
            attenuation_np_mm: tissue.attenuation_np_mm.into(),
            roughness: tissue.roughness.into(),
            scatterer_density: tissue.scatterers & TAG_DENSITY,
            texture: (tissue.scatterers >> TEXTURE_SHIFT & TEXTURE_MASK) as usize,
            scatterer_mean: tissue.scatterer_mean.into(),
            scatterer_deviation: tissue.scatterer_deviation.into(),
            thickness_mm: tissue.thickness_mm.into(),
            coherence: tissue.coherence.into(),
        }
    }
}
