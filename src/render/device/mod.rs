//! The passes on a graphics device, by wgpu.

pub(super) mod buffers;
pub(super) mod gpu;
pub(super) mod passes;
pub(super) mod readback;
pub(super) mod shaders;
