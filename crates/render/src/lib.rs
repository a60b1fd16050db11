//! From a pose to a frame. `host` and `device` make frames, each with the same passes; `twin` is their f64 reference.
//!
//! Host and device do not know each other. Both use the files directly in this module: tables, uniforms, effect plan,
//! constants. [`Renderer`] is their one interface.

mod angle_order;
mod aperture;
mod backend;
mod batch_plan;
mod compounding;
mod configuration;
mod constants;
#[cfg(feature = "gpu")]
mod device;
#[cfg(not(feature = "gpu"))]
#[path = "no_device.rs"]
mod device;
mod elevation;
mod error;
mod frame;
mod frame_quality;
mod hooks;
mod host;
mod kept;
mod kernels;
mod lateral_beam;
pub mod look;
mod maker;
mod params;
mod place;
pub mod plan;
mod preset;
mod receiver;
mod renderer;
mod shared_tables;
mod sheet_cells;
mod sheets;
mod snapshot;
mod tables;
mod texture;
mod trace_by;
#[cfg(feature = "gpu")]
mod trace_cache;
#[cfg(feature = "gpu")]
mod trace_times;
pub mod twin;

pub use backend::{Backend, BackendChoice, UnknownBackend, UnknownBackendVariable};
#[cfg(all(feature = "test-hooks", feature = "gpu"))]
pub use device::InjectedHang;
#[cfg(feature = "test-hooks")]
pub use device::ShaderSet;
pub use error::{BackendError, RenderError};
pub use frame::{DeviceTimes, FRAMES_IN_FLIGHT, Frame, FrameTimes, PassTime, warn_of_overflows};
pub use frame_quality::FrameQuality;
#[cfg(feature = "test-hooks")]
pub use hooks::TestHooks;
pub use host::processor_name;
#[cfg(feature = "test-hooks")]
pub use host::{ImageConstants, TraceConstants};
pub use place::NVIDIA;
pub use place::{PciAddress, Place};
pub use plan::{Decision, EffectPlan};
pub use preset::{NoQuality, Preset, UnknownPreset};
pub use renderer::{Job, Renderer};
pub use shared_tables::{SharedTables, TableMaker};
pub use snapshot::Snapshot;
pub use trace_by::{TraceBy, UnknownTrace};

pub use insonify_core::settings::{Choice, Effect, EffectChoices, EffectSet, ImageSettings, Quality, RenderSettings};
