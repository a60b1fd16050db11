//! Frames on their way to viewers: what the stages of a session fill and the sinks show.

mod frame;
mod info;
#[cfg(feature = "live")]
mod pool;

pub use frame::{FrameSource, PointText, PresentedFrame};
pub use info::{FrameInfo, FrameTimeline, NewMeasurements};
#[cfg(feature = "live")]
pub(crate) use pool::Pool;
