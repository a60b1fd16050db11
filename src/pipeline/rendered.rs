//! A rendered frame between the stages.

use std::sync::RwLock;
use std::time::Duration;

use super::parts::ImageShape;
use crate::pose::{Pose, TrackingState};
use crate::render::Frame;
use crate::sink::live::{FrameTimeline, LiveSettings};

/// A frame that was begun: rendered, or without a picture.
#[derive(Debug)]
pub(super) struct Rendered {
    /// Counts the begun frames from 0.
    pub(super) number: u64,
    /// Maps, all black in a frame without a picture. The generator reads them while the presenter does.
    pub(super) frame: RwLock<Frame>,
    /// Size and scale.
    pub(super) shape: ImageShape,
    /// Its pose; none without a picture.
    pub(super) pose: Option<Pose>,
    /// State of the pose.
    pub(super) tracking: TrackingState,
    /// Times up to `rendered`.
    pub(super) timeline: FrameTimeline,
    /// When it is presented at the latest, whatever the generator does.
    pub(super) deadline: Duration,
    /// Settings it was made with.
    pub(super) settings: LiveSettings,
    /// Whether it was rendered with its maps.
    pub(super) maps: bool,
}

impl Rendered {
    /// An empty one, to be filled.
    pub(super) fn empty(settings: LiveSettings) -> Self {
        Self {
            number: 0,
            frame: RwLock::default(),
            shape: ImageShape { width: 0, height: 0, pixel_mm: 0.0 },
            pose: None,
            tracking: TrackingState::Lost,
            timeline: FrameTimeline::default(),
            deadline: Duration::ZERO,
            settings,
            maps: false,
        }
    }
}

/// Makes `frame` a black one of this size.
pub(super) fn blacken(frame: &mut Frame, shape: ImageShape) {
    let pixels = shape.width as usize * shape.height as usize;
    (frame.width, frame.height) = (shape.width, shape.height);
    for map in [&mut frame.bmode, &mut frame.segmentation, &mut frame.mask] {
        map.clear();
        map.resize(pixels, 0);
    }
    frame.attenuation.clear();
    frame.attenuation.resize(pixels, 0.0);
    frame.lines.clear();
    frame.overflows = 0;
}
