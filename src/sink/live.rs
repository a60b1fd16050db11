//! Live output: frames for the sinks, and input from their viewers.
//!
//! A presenter hands each [`PresentedFrame`] to every sink, wrapped in an [`Arc`] that the presenter reuses once all
//! sinks have dropped it. If a sink still holds it, the presenter takes another one.

use std::sync::Arc;
use std::time::Duration;

use crate::pose::{Estimate, Pose, TrackingState};
use crate::settings::LiveSettings;
use crate::transducer::{Contact, Misplacement};

use super::SinkError;

/// Source of the picture in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FrameSource {
    /// The generator's image of this frame.
    Generated,
    /// The generator's image of an earlier frame with nearly the same pose.
    HeldGenerated,
    /// The raw frame, which no generator has touched.
    #[default]
    Raw,
}

crate::names::named!(FrameSource {
    Generated = "generated",
    HeldGenerated = "held_generated",
    Raw = "raw",
});

/// Times at which a frame passed each stage, since the start of the session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FrameTimeline {
    /// First byte of the tracker's record that the pose comes from; none without a tracker.
    pub first_byte: Option<Duration>,
    /// The pose was sampled.
    pub sampled: Duration,
    /// The render was submitted.
    pub submitted: Duration,
    /// The rendered frame was in memory.
    pub rendered: Duration,
    /// Start and end of the generator's run; none if none ran on this frame.
    pub inference: Option<(Duration, Duration)>,
    /// Handed to the sinks.
    pub presented: Duration,
}

/// Measurements that a presented frame is the first to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct NewMeasurements {
    /// Their number; 0 without a tracker.
    pub count: u64,
    /// Time at which the previous presented frame was sampled; all these measurements arrived later.
    pub after: Duration,
    /// First byte of the newest measurement before them; none if no frame showed one.
    pub before: Option<Duration>,
    /// First byte of the measurement that was held back until a second one confirmed a jump; none without a new jump.
    pub jump: Option<Duration>,
}

/// Data of a frame besides its pixels; each stage completes its part.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FrameInfo {
    /// Number among all frames that were begun, from 0.
    pub number: u64,
    /// Pose estimate of the picture; its pose is `None` without a picture.
    pub estimate: Estimate,
    /// Times at which it passed each stage so far.
    pub timeline: FrameTimeline,
    /// Measurements that no earlier frame showed; the presenter completes it.
    pub new: NewMeasurements,
    /// Settings that it is rendered with.
    pub settings: LiveSettings,
    /// Contact of the face with the skin; none if everything is coupled, and without a picture.
    pub contact: Option<Contact>,
    /// Impossible placement of the probe that has lasted for seconds.
    pub misplaced: Option<Misplacement>,
}

impl FrameInfo {
    /// `scene_from_probe` of the picture; none before the first pose.
    pub fn pose(&self) -> Option<Pose> {
        self.estimate.scene_from_probe
    }

    /// Time from the first byte of the newest measurement to the handover to the sinks; without a tracker, from the
    /// sampling of the pose. None without a new measurement, and for held, stuck, stale and frozen poses: their age is no
    /// latency.
    pub fn pose_to_present(&self) -> Option<Duration> {
        let FrameTimeline { first_byte, sampled, presented, .. } = self.timeline;
        let is_new = first_byte.is_none() || (self.new.count > 0 && self.estimate.state == TrackingState::Good);
        let from = first_byte.unwrap_or(sampled);
        (is_new && self.is_live()).then(|| presented.saturating_sub(from))
    }

    /// The same time of each measurement that the frame is the first to show: it includes the wait for the tick and, after
    /// a jump, for its confirmation. Measurements count as evenly spaced since the newest one of the last frame or, after a
    /// silence of the tracker, since that frame's sampling. Empty without a tracker.
    pub fn motion_to_present(&self) -> impl Iterator<Item = Duration> + use<> {
        let Self { new, timeline: FrameTimeline { presented, .. }, .. } = *self;
        let first_byte = self.timeline.first_byte.filter(|_| self.pose_to_present().is_some());
        let count = u32::try_from(new.count).unwrap_or(u32::MAX);
        let even = first_byte.into_iter().flat_map(move |newest| {
            // None arrived before the last frame's sampling, whatever gap was before it.
            let since_sampling = newest.saturating_sub(new.after);
            let step = match new.before {
                Some(before) => {
                    (newest.saturating_sub(before) / count.max(1)).min(since_sampling / count.saturating_sub(1).max(1))
                }
                None => since_sampling / count.max(1),
            };
            (0..count).map(move |nth| presented.saturating_sub(newest.saturating_sub(step * nth)))
        });
        even.chain(self.jump_to_present().filter(|_| first_byte.is_some()))
    }

    /// Time from the first byte of the measurement that first showed a jump to the handover to the sinks: it includes the
    /// wait for the measurement that confirmed it, and for the tick. None in frames without a new jump.
    pub fn jump_to_present(&self) -> Option<Duration> {
        self.new.jump.filter(|_| self.is_live()).map(|from| self.timeline.presented.saturating_sub(from))
    }

    /// Whether the picture is of the sampled pose.
    fn is_live(&self) -> bool {
        !self.settings.frozen && self.estimate.scene_from_probe.is_some()
    }
}

/// One frame as it is shown. All maps are row-major, the first row nearest to the probe.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PresentedFrame {
    /// Number among the presented frames, from 0.
    pub number: u64,
    /// Pose, times and settings.
    pub info: FrameInfo,
    /// Source of `image`.
    pub source: FrameSource,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Side of a pixel, mm.
    pub pixel_mm: f64,
    /// Grey levels shown [height × width].
    pub image: Vec<u8>,
    /// Tissue numbers [height × width]; 0 outside the sector. Empty where neither the generator nor a sink reads it.
    pub segmentation: Vec<u8>,
    /// One-way attenuation over its 98th percentile [height × width]. Empty where `segmentation` is.
    pub attenuation: Vec<f32>,
    /// 255 inside the sector [height × width].
    pub mask: Arc<[u8]>,
    /// Name of the generator at work; none on raw frames.
    pub generator: Option<String>,
    /// Operating point; none without a controller of operating points.
    pub point: Option<Arc<PointText>>,
    /// Recent fault, to be shown to viewers.
    pub notice: Option<String>,
}

/// Operating point of a frame, for viewers.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PointText {
    /// Rays × layers, angles and generator.
    pub name: String,
    /// Why it was chosen.
    pub reason: String,
}

impl PresentedFrame {
    /// Row of the centre of the probe's face, pixels from the upper edge: depth 0 of the depth scale. 0 if the mask's
    /// middle column is empty.
    pub fn face_row(&self) -> f64 {
        let width = (self.width as usize).max(1);
        let column = self.mask.iter().skip(width / 2).step_by(width);
        column.zip(0_u32..).find(|(mask, _)| **mask > 0).map_or(0.0, |(_, row)| row.into())
    }
}

/// Query for whether a sink currently reads segmentation and attenuation.
pub type MapsWanted = Arc<dyn Fn() -> bool + Send + Sync>;

/// Consumer of frames, on its own thread. A slow sink drops frames, counted under its name, and delays no other.
pub trait LiveSink: Send {
    /// Name under which its drops and errors are counted.
    fn name(&self) -> &str;

    /// Query for whether the sink reads segmentation and attenuation; `None` if it never does. It is called once per
    /// frame, on another thread. Maps without readers are not rendered.
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

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// Times from each of `count` measurements to a frame presented at 1000 ms, ms.
    fn motion_ms(count: u64, after: Duration, before: Option<Duration>, newest: Duration) -> Vec<f64> {
        let estimate =
            Estimate { scene_from_probe: Some(Pose::IDENTITY), state: TrackingState::Good, ..Estimate::default() };
        let timeline = FrameTimeline { first_byte: Some(newest), presented: 1000 * MS, ..FrameTimeline::default() };
        let new = NewMeasurements { count, after, before, jump: None };
        let info = FrameInfo { estimate, timeline, new, ..FrameInfo::default() };
        info.motion_to_present().map(|time| (1e3 * time.as_secs_f64()).round()).collect()
    }

    #[test]
    fn measurements_are_spaced_since_the_one_before_them() {
        // Every 10 ms; the last frame was sampled just before the next one came.
        assert_eq!(motion_ms(3, 919 * MS, Some(910 * MS), 940 * MS), [60.0, 70.0, 80.0]);
        assert_eq!(motion_ms(3, 910 * MS, Some(910 * MS), 940 * MS), [60.0, 70.0, 80.0]);
        assert_eq!(motion_ms(1, 919 * MS, Some(910 * MS), 920 * MS), [80.0]);
        // After a silence, and in the first frame, only the sampling is known.
        assert_eq!(motion_ms(3, 920 * MS, Some(100 * MS), 940 * MS), [60.0, 70.0, 80.0]);
        assert_eq!(motion_ms(2, 920 * MS, None, 940 * MS), [60.0, 70.0]);
    }

    #[test]
    fn each_of_many_measurements_counts() {
        let times = motion_ms(400, 100 * MS, Some(100 * MS), 500 * MS);
        assert_eq!(times, (500_u32..900).map(f64::from).collect::<Vec<f64>>());
        assert!(motion_ms(0, 100 * MS, Some(100 * MS), 500 * MS).is_empty());
    }
}
