//! Errors of renderers.

use insonify_core::anatomy::BvhError;
use insonify_core::settings::SettingsError;
use thiserror::Error;

use super::frame::FRAMES_IN_FLIGHT;
use super::trace_by::UnknownTrace;

/// Failure to open or run a backend.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum BackendError {
    /// The build has no devices.
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
        /// Adapter.
        adapter: String,
        /// Message of wgpu.
        reason: String,
    },
    /// An unknown way of `trace`.
    #[error(transparent)]
    Trace(UnknownTrace),
    /// The device can't trace by lanes, which was asked for.
    #[error("{adapter} can't trace by lanes: {reason}; unset INSONIFY_TRACE, or set it to `path`")]
    NoLanes {
        /// Adapter.
        adapter: String,
        /// What it lacks.
        reason: String,
    },
    /// The device can't hold what the settings need.
    #[error(
        "{what} needs {needed} of {limit_name}, {adapter} offers {offered}: lower the rays, scanlines, samples or image size"
    )]
    Limit {
        /// Buffer or pass.
        what: &'static str,
        /// Amount needed.
        needed: u64,
        /// Name of the limit.
        limit_name: &'static str,
        /// Amount offered.
        offered: u64,
        /// Adapter.
        adapter: String,
    },
    /// No memory is left for a buffer.
    #[error(
        "{adapter} has no memory left for {what} ({bytes} bytes): {reason}. Close what else uses it, or lower the rays, scanlines, samples or image size"
    )]
    Memory {
        /// Purpose of the buffer.
        what: &'static str,
        /// Size, bytes.
        bytes: u64,
        /// Message of wgpu or of the allocator.
        reason: String,
        /// Adapter, or the host.
        adapter: String,
    },
    /// A shader or a pipeline was refused.
    #[error("the device refused the pass `{pass}`: {reason}")]
    Pipeline {
        /// Pass.
        pass: &'static str,
        /// Message of wgpu.
        reason: String,
    },
    /// A frame was not done in time.
    #[error(
        "{adapter} did not answer within {wait_s} s and counts as lost; if its frames take that long, raise `pipeline.device_hang_ms` or lower the rays and layers"
    )]
    Hung {
        /// Adapter.
        adapter: String,
        /// Longest wait, s.
        wait_s: f64,
    },
    /// The device was lost or a map failed.
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
        /// The fault.
        what: String,
    },
    /// `submit` with the ring full.
    #[error("{FRAMES_IN_FLIGHT} frames are in flight; receive one before the next is submitted")]
    RingFull,
    /// `receive` with the ring empty.
    #[error("no frame is in flight; submit a pose before receiving")]
    RingEmpty,
    /// A frame of many.
    #[error("frame {number}: {source}")]
    Job {
        /// Number of the job, from 0.
        number: usize,
        /// Cause.
        source: Box<Self>,
    },
    /// A snapshot of a frame with several batches of paths.
    #[error("a snapshot holds one batch of paths, these settings need {batches}: lower the rays or layers")]
    Batches {
        /// Batches needed.
        batches: u32,
    },
}
