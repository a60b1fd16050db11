//! A live sink that shows nothing.

use super::SinkError;
use super::live::LiveSink;
use crate::presented::PresentedFrame;

/// Takes every frame and shows none: for measurements, and for stations that only record.
#[derive(Debug, Clone, Copy, Default)]
pub struct NullSink;

impl LiveSink for NullSink {
    fn name(&self) -> &str {
        "null"
    }

    fn present(&mut self, _: &PresentedFrame) -> Result<(), SinkError> {
        Ok(())
    }
}
