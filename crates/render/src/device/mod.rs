//! All passes on a graphics device, by wgpu. No other module uses types of wgpu.
//!
//! Read `dispatches.rs` first: it lists the passes of a frame in order, each with its buffers. `shaders.rs` names the
//! passes, `passes.rs` compiles them, and `renderer.rs` submits frames.

mod aperture_buffers;
mod attenuation;
mod buffers;
mod configuration;
mod dispatches;
mod gpu;
#[cfg(feature = "test-hooks")]
mod hang;
mod motion;
mod needle_buffers;
mod passes;
mod readback;
mod renderer;
mod several;
mod shaders;
mod snapshot;
mod submitter;
mod trace_choice;
mod trace_dispatch;

pub(super) use gpu::Gpu;
#[cfg(feature = "test-hooks")]
pub use hang::InjectedHang;
#[cfg_attr(not(feature = "test-hooks"), allow(unreachable_pub, reason = "public in tests"))]
pub use shaders::ShaderSet;
