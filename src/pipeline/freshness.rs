//! Counts the tracker measurements that each presented frame is the first to show.

use std::time::Duration;

use super::clock::Clock;
use crate::pose::{Estimate, TrackingState};
use crate::presented::{FrameInfo, NewMeasurements};

/// The newest measurement that the presented frames have shown so far.
#[derive(Debug, Default)]
pub(super) struct Freshness {
    /// Time at which the last presented frame was sampled.
    sampled: Duration,
    /// Arrival time of the first byte of the newest measurement in that frame; none without a measurement.
    first_byte: Option<Duration>,
    measurements: u64,
    jumps: u64,
}

impl Freshness {
    /// Measurements that the next presented frame is the first to show, including those of frames dropped before it.
    pub(super) fn next(&mut self, info: &FrameInfo, clock: &dyn Clock) -> NewMeasurements {
        let Estimate { measurements, jump, state, .. } = info.estimate;
        // Without a renderer the frame is black. Its measurements count for the next frame that has a picture.
        if info.pose().is_none() && state != TrackingState::Lost {
            return NewMeasurements::default();
        }
        let first_byte = info.timeline.first_byte;
        let is_new = first_byte.is_some() && first_byte != self.first_byte;
        let count = if is_new { measurements.saturating_sub(self.measurements).max(1) } else { 0 };
        let jump = jump.filter(|jump| jump.number > self.jumps);
        let new = NewMeasurements {
            count,
            after: self.sampled,
            before: self.first_byte,
            jump: jump.map(|jump| clock.since_start(jump.first_byte_ns)),
        };
        self.jumps = jump.map_or(self.jumps, |jump| jump.number);
        (self.sampled, self.first_byte, self.measurements) = (info.timeline.sampled, first_byte, measurements);
        new
    }
}
