//! Values of a model's tensors: float32, or bytes if the model's graph contains the manifest's mappings.

use super::manifest::Affine;

/// Input tensor [channels × padded height × padded width], for the caller to fill.
#[cfg_attr(not(feature = "generator"), allow(dead_code, reason = "sessions make them"))]
#[derive(Debug)]
pub(super) enum Planes<'a> {
    /// Values to which the manifest's mappings have been applied.
    Floats(&'a mut [f32]),
    /// Values of 8 bits, to which the model applies the mappings.
    Bytes(&'a mut [u8]),
}

/// Output tensor [padded height × padded width].
#[cfg_attr(not(feature = "generator"), allow(dead_code, reason = "sessions make them"))]
#[derive(Debug, Clone, Copy)]
pub(super) enum Values<'a> {
    /// Values to which the manifest's mapping to grey levels is yet to be applied.
    Floats(&'a [f32]),
    /// Grey levels.
    Bytes(&'a [u8]),
}

/// Type of a tensor's values, with the conversion from the maps' values.
pub(super) trait Element: Copy + Send + Sync {
    /// Tensor value of a grey level.
    fn of_level(level: u8, affine: Affine) -> Self;
    /// Tensor value of a mask pixel, inside or outside the sector.
    fn of_mask(inside: bool, affine: Affine) -> Self;
    /// Tensor value of a class index, or of 0 or 1 in the channel of one class.
    fn of_class(class: u8, affine: Affine) -> Self;
    /// Tensor value of a relative attenuation `part`, 0..=1, to which the mapping's power has been applied.
    fn of_attenuation(part: f32, affine: Affine) -> Self;
}

impl Element for f32 {
    fn of_level(level: u8, affine: Affine) -> Self {
        Self::from(level) * (affine.scale / 255.0) + affine.offset
    }

    fn of_mask(inside: bool, affine: Affine) -> Self {
        if inside { affine.scale + affine.offset } else { affine.offset }
    }

    fn of_class(class: u8, affine: Affine) -> Self {
        Self::from(class) * affine.scale + affine.offset
    }

    fn of_attenuation(part: f32, affine: Affine) -> Self {
        part * affine.scale + affine.offset
    }
}

impl Element for u8 {
    fn of_level(level: u8, _: Affine) -> Self {
        level
    }

    fn of_mask(inside: bool, _: Affine) -> Self {
        if inside { 255 } else { 0 }
    }

    fn of_class(class: u8, _: Affine) -> Self {
        class
    }

    fn of_attenuation(part: f32, _: Affine) -> Self {
        (part * 255.0).round() as Self
    }
}
