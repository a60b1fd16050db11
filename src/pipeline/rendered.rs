//! A rendered frame between the stages.

use std::sync::{Arc, RwLock};
use std::time::Duration;

use super::parts::ImageShape;
use crate::presented::{FrameInfo, PointText};
use crate::render::Frame;

/// A frame between the stages: rendered, or black if there is no picture.
#[derive(Debug, Default)]
pub(super) struct Rendered {
    /// Number, pose, times up to `rendered`, and settings.
    pub(super) info: FrameInfo,
    /// Image and maps, all zero in a frame without a picture. The generator and the presenter read them concurrently.
    pub(super) frame: RwLock<Frame>,
    /// Size and scale.
    pub(super) shape: ImageShape,
    /// Latest presentation time, with or without a generated picture.
    pub(super) deadline: Duration,
    /// Whether the frame was rendered with segmentation and attenuation.
    pub(super) maps: bool,
    /// Index of the generator that translates the frame; none: the rendered image is shown.
    pub(super) generator: Option<usize>,
    /// Operating point, for viewers; none without a controller of operating points.
    pub(super) point: Option<Arc<PointText>>,
}

/// Makes `frame` a black frame of this size.
pub(super) fn blacken(frame: &mut Frame, shape: ImageShape) {
    let pixels = shape.width as usize * shape.height as usize;
    (frame.width, frame.height) = (shape.width, shape.height);
    for map in [&mut frame.bmode, &mut frame.segmentation] {
        map.clear();
        map.resize(pixels, 0);
    }
    frame.mask = std::iter::repeat_n(0, pixels).collect();
    frame.attenuation.clear();
    frame.attenuation.resize(pixels, 0.0);
    frame.lines.clear();
    frame.overflows = 0;
    frame.contact = None;
}
