//! The aperture's gain along a scanline, as `visibility` stores it for `march` and `echo` on host and device.

use bytemuck::{Pod, Zeroable};

/// State of a scanline at a boundary between two depth intervals of the aperture's grid: the fields of
/// [`twin::Boundary`](crate::twin::Boundary). In the middle of each interval lies a depth plane.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Boundary {
    /// Position among the depth planes; a whole number is the plane with that index.
    pub(crate) position: f32,
    /// Loss of the axial path from the face, one-way nepers.
    pub(crate) loss_np: f32,
    /// ln of the aperture's gain, two-way, at the depth plane before the boundary.
    pub(crate) ln_gain: f32,
    /// Loss that all scanlines share, from the face, one-way nepers.
    pub(crate) shared_np: f32,
}
