//! Errors of renderers.

use insonify_core::anatomy::BvhError;
use insonify_core::instructions::WrongInstructions;
use insonify_core::settings::SettingsError;
use thiserror::Error;

use super::frame::FRAMES_IN_FLIGHT;
use super::trace_by::UnknownTrace;

/// Failure to open or run a backend.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum BackendError {
    /// The build lacks the feature `gpu`.
    #[error(
        "insonify was built without the feature `gpu`, which devices need; build it with that feature, or render on the processors with `--backend host`"
    )]
    NotBuilt,
    /// No driver was found.
    #[error(
        "no GPU driver was found ({reason}). Render on the processors with `--backend host`, install the driver of your GPU, or Mesa's software Vulkan: `sudo apt-get install mesa-vulkan-drivers libvulkan1`"
    )]
    NoAdapter {
        /// Message of wgpu.
        reason: String,
    },
    /// The driver refused a device.
    #[error(
        "the driver of {adapter} refused a device: {reason}; update the driver, or render on the processors with `--backend host`"
    )]
    NoDevice {
        /// Name of the adapter.
        adapter: String,
        /// Message of wgpu.
        reason: String,
    },
    /// An unknown value of `INSONIFY_TRACE`.
    #[error(transparent)]
    Trace(UnknownTrace),
    /// A value of `INSONIFY_SIMD` that the processor can't follow.
    #[error(transparent)]
    Instructions(WrongInstructions),
    /// Tracing by lanes was asked for, but the device can't do it.
    #[error("{adapter} can't trace by lanes: {reason}; unset INSONIFY_TRACE, or set it to `path`")]
    NoLanes {
        /// Name of the adapter.
        adapter: String,
        /// Capability that the device lacks.
        reason: String,
    },
    /// The settings need more than a limit of the device.
    #[error(
        "{what} needs {needed} of {limit_name}, {adapter} offers {offered}: lower the rays, scanlines, samples or image size"
    )]
    Limit {
        /// Name of the buffer or pass.
        what: &'static str,
        /// Amount needed.
        needed: u64,
        /// Name of the limit.
        limit_name: &'static str,
        /// Amount offered.
        offered: u64,
        /// Name of the adapter.
        adapter: String,
    },
    /// Too little memory for a buffer.
    #[error(
        "{adapter} has no memory left for {what} ({bytes} bytes): {reason}. Close what else uses it, or lower the rays, scanlines, samples or image size"
    )]
    Memory {
        /// Name of the buffer.
        what: &'static str,
        /// Size, bytes.
        bytes: u64,
        /// Message of wgpu or of the allocator.
        reason: String,
        /// Name of the adapter, or the host.
        adapter: String,
    },
    /// The device refused a shader or a pipeline.
    #[error("the device refused the pass `{pass}`: {reason}")]
    Pipeline {
        /// Name of the pass.
        pass: &'static str,
        /// Message of wgpu.
        reason: String,
    },
    /// A frame took longer than the time limit.
    #[error(
        "{adapter} did not answer within {wait_s} s and counts as lost; if its frames take that long, raise `pipeline.device_hang_ms` or lower the rays and layers"
    )]
    Hung {
        /// Name of the adapter.
        adapter: String,
        /// Time limit, s.
        wait_s: f64,
    },
    /// The device was lost, or the mapping of a buffer failed.
    #[error("the GPU stopped answering: {reason}")]
    Lost {
        /// Message of wgpu.
        reason: String,
    },
}

/// Failure to render a frame.
#[derive(Debug, Error)]
pub enum RenderError {
    /// The backend failed.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The scene can't be traced.
    #[error(transparent)]
    Bvh(#[from] BvhError),
    /// A setting is outside its range.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The scene has invalid indices, or more surfaces or tissues than passes can handle.
    #[error("the scene can't be rendered: {what}")]
    Scene {
        /// The fault, in words.
        what: String,
    },
    /// `submit` while [`FRAMES_IN_FLIGHT`] frames are in flight.
    #[error("{FRAMES_IN_FLIGHT} frames are in flight; receive one before the next is submitted")]
    RingFull,
    /// `receive` while no frame is in flight.
    #[error("no frame is in flight; submit a pose before receiving")]
    RingEmpty,
    /// Failure of one frame of [`Renderer::render_many`](super::Renderer::render_many).
    #[error("frame {number}: {source}")]
    Job {
        /// Index of the frame's job, from 0.
        number: usize,
        /// Cause.
        source: Box<Self>,
    },
    /// A snapshot was asked for, but its paths need several batches.
    #[error("a snapshot holds one batch of paths, these settings need {batches}: lower the rays or layers")]
    Batches {
        /// Number of batches needed.
        batches: u32,
    },
}
