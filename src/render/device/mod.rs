//! Every pass on a graphics device, by wgpu. No other module names a type of wgpu.

mod aperture_buffers;
mod attenuation;
mod buffers;
mod configuration;
mod gpu;
mod passes;
mod readback;
mod renderer;
mod shaders;
mod snapshot;

pub(super) use gpu::Gpu;
#[cfg_attr(not(feature = "test-hooks"), allow(unreachable_pub, reason = "public in tests"))]
pub use shaders::ShaderSet;
