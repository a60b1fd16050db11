//! All passes on the host's processors, in single precision and in the shaders' buffer layouts.
//!
//! Read `twin/trace.rs` first: it follows one path in plain code. This module takes the same steps for 32 paths
//! together. Its other passes follow their twins.
//!
//! | step of `twin/trace.rs` | function here |
//! |---|---|
//! | start of a path | `Scene::begin`, `trace/path_start.rs` |
//! | surfaces around the start, coupling | `Scene::locate`, `trace/path.rs`; `trace/membership.rs` |
//! | order of the steps | `PathPacket::go_on`, `trace/path_packet.rs` |
//! | closest hit up to the first reflection | `Candidates::nearest`, `trace/candidates.rs` |
//! | closest hit behind a reflection | `Stream::search`, `trace/stream.rs` |
//! | loss and range along the path, next change of medium | `Scene::advance`, `trace/path.rs` |
//! | choice of reflection or transmission, new direction | `transmit_or_reflect`, `trace/interface_response.rs` |
//! | echo of the interface | `return_echoes`, `trace/interface_response.rs` |
//! | physics of an interface | `trace/interface.rs` |
//! | record of a segment | `Scene::segment`, `trace/path.rs`; [`Segment`](crate::segment::Segment) |
//!
//! With the effect `aperture`, the aperture's gain replaces the loss of a path up to its first reflection:
//!
//! | step | function here |
//! |---|---|
//! | which loss the gain replaces | `Scene::by_aperture`, `trace/path.rs` |
//! | the gain along a scanline | pass `visibility`: `aperture/visibility.rs` |
//! | the gain at a range, at an interface | `ApertureGain::at`, `InterfaceGains::at`, `aperture/gain.rs` |
//! | gain instead of loss, scatterers | `Powers::total`, `scatter/power.rs` |
//! | gain instead of loss, interfaces | `Interfaces::list`, `scatter/echo.rs` |
//!
//! `renderer.rs` runs the passes in order:
//!
//! | folder | passes |
//! |---|---|
//! | `trace/` | `locate` and `trace` as one |
//! | `aperture/` | `transmission`, `propagate`, `beams`, `profiles`, `visibility` |
//! | `scatter/` | `march`, `echo` |
//! | `needle/` | `needle_shadow`, `needle_echo`, `needle_map` |
//! | `image/` | `lateral`, `receive`, `detect`, `section`, `percentile`, `scan_convert` |
//!
//! Multiplications and additions are not fused, and sums have a fixed order. So frames depend neither on the
//! processor's instructions nor on the number of threads.

mod aperture;
mod buffers;
mod constants;
mod effects;
mod image;
mod lanes;
mod needle;
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
