//! From a pose to a frame: passes on the GPU, each with an f64 twin on the CPU.

mod frame;
mod gpu;
mod motion;
mod params;
mod readback;
mod renderer;
mod resources;
mod settings;
mod shaders;
mod snapshot;
mod tables;
pub mod twin;

pub use frame::{Frame, FrameTimes, PassTime};
pub use gpu::{Gpu, GpuError, GpuOptions};
pub use renderer::{FRAMES_IN_FLIGHT, RenderError, Renderer};
pub use settings::{ImageSettings, Quality, RenderSettings, SettingsError};
pub use shaders::ShaderSet;
pub use snapshot::Snapshot;
