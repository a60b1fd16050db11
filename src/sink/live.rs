//! Live output: the interface of the sinks.
//!
//! A presenter hands each [`PresentedFrame`] to every sink, wrapped in an [`Arc`] that the presenter reuses once all
//! sinks have dropped it. While a sink holds the frame, the presenter fills another.

use std::sync::Arc;

use super::SinkError;

pub use crate::presented::{FrameInfo, FrameSource, FrameTimeline, NewMeasurements, PointText, PresentedFrame};

/// Function that returns whether a sink currently reads segmentation and attenuation.
pub type MapsWanted = Arc<dyn Fn() -> bool + Send + Sync>;

/// Consumer of frames, on its own thread. A slow sink drops frames, which are counted under its name, and delays no
/// other sink.
pub trait LiveSink: Send {
    /// Name under which the sink's drops and errors are counted.
    fn name(&self) -> &str;

    /// Function that returns whether the sink currently reads segmentation and attenuation; `None` if it never does.
    /// It is called once per frame, on another thread. Maps without readers are not rendered.
    fn maps_wanted(&self) -> Option<MapsWanted> {
        None
    }

    /// Shows or stores one frame.
    ///
    /// # Errors
    /// The frame could not be shown or stored. The session logs it and continues; a sink that fails repeatedly is
    /// closed.
    fn present(&mut self, frame: &PresentedFrame) -> Result<(), SinkError>;

    /// Ends the sink and flushes its buffers.
    ///
    /// # Errors
    /// Failure to finish the output.
    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        Ok(())
    }
}
