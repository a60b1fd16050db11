//! From a pose to a frame: passes on the GPU, each with an f64 twin on the CPU.

mod configuration;
mod device;
mod frame;
mod host;
mod kernels;
mod ladder;
mod motion;
mod params;
pub mod plan;
mod preset;
mod renderer;
mod settings;
mod snapshot;
mod tables;
pub mod twin;

pub use device::gpu::{Gpu, GpuError, GpuOptions, ImageOn, TraceOn};
pub use device::shaders::ShaderSet;
pub use frame::{Frame, FrameTimes, PassTime};
pub use host::{ImageConstants, TraceConstants};
pub use kernels::{ClippedKernel, Kernel};
pub use ladder::{Climbed, LADDER, RUNGS, climb};
pub use plan::{Choice, Decision, Effect, EffectChoices, EffectPlan};
pub use preset::{Preset, QualityPoint, UnknownPreset};
pub use renderer::{FRAMES_IN_FLIGHT, RenderError, Renderer};
pub use settings::{
    BEAM_TAPS_MAX, ImageSettings, PULSE_TAPS_MAX, Quality, REFLECTIONS_MAX, RenderSettings, SettingsError,
};
pub use snapshot::Snapshot;
