//! Every pass on the host's processors: its shader's function in the same single precision, over slices in the shaders'
//! layouts.
//!
//! Rays go through the scene in packets, their boxes eight at a time. Multiplications and additions are not fused, so
//! that frames don't depend on the processor's instructions, nor on the number of threads.

mod beams;
mod buffers;
mod bundle;
mod candidates;
mod constants;
mod depart;
mod detect;
mod echo;
mod effects;
mod fourier;
mod hull;
mod interface;
mod interface_batch;
mod lanes;
mod lateral;
mod line_gain;
mod march;
mod media;
mod meeting;
mod membership;
mod packet;
mod path;
mod path_outputs;
mod path_record;
mod path_start;
mod path_state;
mod paths;
mod percentile;
mod power;
mod processor;
mod profiles;
mod propagate;
mod receive;
mod renderer;
mod scan_convert;
mod search;
mod section;
mod speckle;
mod stream;
mod texture;
mod trace;
mod transmission;
mod traverse;
mod tree;
mod visibility;

#[cfg(feature = "test-hooks")]
pub use constants::{ImageConstants, TraceConstants};
#[cfg(not(feature = "test-hooks"))]
pub(super) use constants::{ImageConstants, TraceConstants};
pub(super) use processor::description;
pub use processor::processor_name;
pub(super) use renderer::HostRenderer;
