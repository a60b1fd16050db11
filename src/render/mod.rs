//! From a pose to a frame: passes on the GPU, each with an f64 twin on the CPU.

mod frame;
mod settings;

pub use frame::{Frame, FrameTimes, PassTime};
pub use settings::{ImageSettings, Quality, RenderSettings, SettingsError};
