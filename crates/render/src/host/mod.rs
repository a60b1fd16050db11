//! Every pass on the host's processors: its shader's function in the same single precision, over slices in the shaders'
//! layouts.
//!
//! Rays go through the scene in packets, their boxes eight at a time. Multiplications and additions are not fused, so
//! that frames don't depend on the processor's instructions, nor on the number of threads.

mod aperture;
mod buffers;
mod constants;
mod effects;
mod image;
mod lanes;
mod paths;
mod processor;
mod renderer;
mod scatter;
mod trace;

#[cfg(feature = "test-hooks")]
pub use constants::{ImageConstants, TraceConstants};
#[cfg(not(feature = "test-hooks"))]
pub(super) use constants::{ImageConstants, TraceConstants};
pub(super) use processor::description;
pub use processor::processor_name;
pub(super) use renderer::HostRenderer;
