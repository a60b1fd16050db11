//! A rendered frame between the stages.

use std::sync::RwLock;
use std::time::Duration;

use super::parts::ImageShape;
use crate::render::Frame;
use crate::sink::live::FrameInfo;

/// A frame that was begun: rendered, or without a picture.
#[derive(Debug, Default)]
pub(super) struct Rendered {
    /// Number, pose, times up to `rendered`, and settings.
    pub(super) info: FrameInfo,
    /// Maps, all black in a frame without a picture. The generator reads them while the presenter does.
    pub(super) frame: RwLock<Frame>,
    /// Size and scale.
    pub(super) shape: ImageShape,
    /// Latest time of its presentation, whatever the generator does.
    pub(super) deadline: Duration,
    /// Whether it was rendered with its maps.
    pub(super) maps: bool,
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
