//! From a pose to a frame: passes on the GPU, each with an f64 twin on the CPU.

mod buffers;
mod configuration;
mod frame;
mod gpu;
mod kernels;
mod ladder;
mod motion;
mod native;
mod params;
mod passes;
pub mod plan;
mod preset;
mod readback;
mod renderer;
mod settings;
mod shaders;
mod snapshot;
mod tables;
pub mod twin;

pub use frame::{Frame, FrameTimes, PassTime};
pub use gpu::{Gpu, GpuError, GpuOptions, ImageOn, TraceOn};
pub use kernels::{ClippedKernel, Kernel};
pub use ladder::{Climbed, LADDER, RUNGS, climb};
pub use native::{ImageConstants, TraceConstants};
pub use plan::{Choice, Decision, Effect, EffectChoices, EffectPlan};
pub use preset::{Preset, QualityPoint, UnknownPreset};
pub use renderer::{FRAMES_IN_FLIGHT, RenderError, Renderer};
pub use settings::{
    BEAM_TAPS_MAX, ImageSettings, PULSE_TAPS_MAX, Quality, REFLECTIONS_MAX, RenderSettings, SettingsError,
};
pub use shaders::ShaderSet;
pub use snapshot::Snapshot;
