//! Rendered frames and their times.

use serde::Serialize;

use crate::transducer::{Contact, ScanGeometry};

/// Greatest number of frames in flight.
pub const FRAMES_IN_FLIGHT: usize = 2;

/// Parts of a frame beside its mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Contents {
    /// The B-mode image.
    pub(super) image: bool,
    /// Segmentation and attenuation.
    pub(super) maps: bool,
}

/// Time of one pass.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PassTime {
    /// Name of the pass, that of its shader.
    pub name: &'static str,
    /// Duration, ms. On the host, `trace` includes `locate`.
    pub ms: f64,
}

/// Times of one frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct FrameTimes {
    /// Duration from submission until the frame is in memory, ms.
    pub total_ms: f64,
    /// Duration of the scene's motion before the submission, ms, which `total_ms` does not include; 0 at rest.
    pub motion_ms: f64,
    /// Total duration of each pass's runs, in the order of first runs; empty on a device without timestamps.
    pub passes: Vec<PassTime>,
}

impl FrameTimes {
    /// Adds the times of another frame.
    pub(super) fn add_frame(&mut self, frame: &Self) {
        self.total_ms += frame.total_ms;
        self.motion_ms += frame.motion_ms;
        for pass in &frame.passes {
            self.add(pass.name, pass.ms);
        }
    }

    /// Adds a run of a pass.
    pub fn add(&mut self, name: &'static str, ms: f64) {
        match self.passes.iter_mut().find(|pass| pass.name == name) {
            Some(pass) => pass.ms += ms,
            None => self.passes.push(PassTime { name, ms }),
        }
    }
}

/// One rendered frame. All maps are row-major, the first row nearest to the probe.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Frame {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// B-mode grey levels [height × width], 0 outside the sector. Empty without
    /// [`Renderer::set_image`](super::Renderer::set_image).
    pub bmode: Vec<u8>,
    /// Tissue numbers [height × width]: index in the scene's table + 1; 0 outside the sector. Empty without
    /// [`RenderSettings::maps`](super::RenderSettings::maps).
    pub segmentation: Vec<u8>,
    /// One-way attenuation e^(−Σμ) over its 98th percentile, clipped to 0..=1 [height × width]; 0 outside the sector.
    /// Empty without [`RenderSettings::maps`](super::RenderSettings::maps).
    pub attenuation: Vec<f32>,
    /// The 98th percentile that `attenuation` was divided by; 0 without maps.
    pub attenuation_p98: f32,
    /// 255 inside the sector, 0 outside [height × width].
    pub mask: Vec<u8>,
    /// Place of the scanlines in the picture; none in a frame that no renderer made.
    pub scan: Option<ScanGeometry>,
    /// Complex baseband (re, im) after the point-spread function, before TGC and compression [scanlines × samples];
    /// empty unless the settings ask for it.
    pub lines: Vec<[f32; 2]>,
    /// Contact of the face with the skin; none if everything is coupled, without the effect `contact`.
    pub contact: Option<Contact>,
    /// Crossings of map rays or interactions of paths beyond the capacity of buffers; 0 in a sound frame.
    pub overflows: u32,
    /// Times.
    pub times: FrameTimes,
}

/// Copies rows of `width` out of rows of `stride`.
pub(super) fn unpad<T: Copy>(into: &mut Vec<T>, from: &[T], width: usize, stride: usize) {
    into.clear();
    for row in from.chunks_exact(stride) {
        into.extend_from_slice(&row[..width]);
    }
}

/// Logs a warning of frames in which crossings did not fit the buffers.
pub fn warn_of_overflows(frames: usize) {
    if frames > 0 {
        tracing::warn!(
            "in {frames} frames a few paths met more interfaces than are kept, and go on in the last medium"
        );
    }
}
