//! The aperture's gain along a scanline, as `visibility` stores it for `march` and `echo` on host and device.

use bytemuck::{Pod, Zeroable};

/// Numbers of a scanline at a boundary of the intervals between planes: the fields of
/// [`twin::Boundary`](crate::twin::Boundary).
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Boundary {
    /// Position among the planes.
    pub(crate) position: f32,
    /// Loss of the axial path, one-way nepers.
    pub(crate) loss_np: f32,
    /// ln of the aperture's gain at the plane before, two-way.
    pub(crate) ln_gain: f32,
    /// Loss that all scanlines share, one-way nepers.
    pub(crate) shared_np: f32,
}
