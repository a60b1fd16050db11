//! A frame as viewers see it.

use std::sync::Arc;

use super::info::FrameInfo;

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
    /// Grey levels that are shown [height × width].
    pub image: Vec<u8>,
    /// Tissue numbers [height × width]; 0 outside the sector. Empty if neither the generator nor a sink reads them.
    pub segmentation: Vec<u8>,
    /// One-way attenuation divided by its 98th percentile [height × width]. Empty if `segmentation` is.
    pub attenuation: Vec<f32>,
    /// 255 inside the sector [height × width].
    pub mask: Arc<[u8]>,
    /// Name of the generator that made the picture; none on raw frames.
    pub generator: Option<String>,
    /// Operating point; none without a controller of operating points.
    pub point: Option<Arc<PointText>>,
    /// Latest events of the needle's tip, a line each, oldest first; empty without a needle.
    pub tip_events: Arc<[String]>,
    /// Recent fault, to be shown to viewers; none if there was none.
    pub notice: Option<String>,
}

/// Operating point of a frame, for viewers.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PointText {
    /// Rays × layers, angles and generator.
    pub name: String,
    /// Reason for choosing it.
    pub reason: String,
}

impl PresentedFrame {
    /// Row of the centre of the probe's face, pixels from the upper edge: depth 0 of the depth scale. Returns 0 if the
    /// mask's middle column is empty.
    pub fn face_row(&self) -> f64 {
        let width = (self.width as usize).max(1);
        let column = self.mask.iter().skip(width / 2).step_by(width);
        column.zip(0_u32..).find(|(mask, _)| **mask > 0).map_or(0.0, |(_, row)| row.into())
    }
}
