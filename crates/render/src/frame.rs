//! Rendered frames and their times.

use std::sync::Arc;

use serde::Serialize;

use insonify_core::transducer::{Contact, ScanGeometry};

/// Most frames in flight: submitted and not yet received.
pub const FRAMES_IN_FLIGHT: usize = 2;

/// Parts of a frame that are rendered in addition to its mask.
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
    /// Name of the pass and of its shader.
    pub name: &'static str,
    /// Duration, ms. On the host, `trace` includes `locate`.
    pub ms: f64,
}

/// Times of one frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct FrameTimes {
    /// Duration from submission to the finished frame in memory, ms.
    pub total_ms: f64,
    /// Duration of moving the scene before the submission, ms, not part of `total_ms`; 0 for a scene at rest.
    pub motion_ms: f64,
    /// Duration of each pass, summed over its dispatches, in the order of first dispatch; empty on a device without
    /// timestamps. On a GPU, passes of the maps overlap passes of the paths.
    pub passes: Vec<PassTime>,
    /// CPU time within `total_ms`; `None` for frames of the host renderer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device: Option<DeviceTimes>,
}

/// CPU time that a frame of a device takes, ms.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct DeviceTimes {
    /// Duration of uploading uniforms and recording the passes.
    pub record_ms: f64,
    /// Duration of submitting the commands to the driver.
    pub submit_ms: f64,
    /// Duration of waiting for the device in [`Renderer::receive`](super::Renderer::receive).
    pub wait_ms: f64,
    /// Duration of copying the finished frame out of mapped memory.
    pub copy_ms: f64,
}

impl FrameTimes {
    /// Adds the times of another frame to these.
    pub(super) fn add_frame(&mut self, frame: &Self) {
        self.total_ms += frame.total_ms;
        self.motion_ms += frame.motion_ms;
        for pass in &frame.passes {
            self.add(pass.name, pass.ms);
        }
        if let Some(one) = frame.device {
            let all = self.device.get_or_insert_default();
            all.record_ms += one.record_ms;
            all.submit_ms += one.submit_ms;
            all.wait_ms += one.wait_ms;
            all.copy_ms += one.copy_ms;
        }
    }

    /// Adds `ms` to the duration of the pass `name`.
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
    /// A device sends 16 bits of its square root: values are off by up to 1.6·10⁻⁵ × that root, 0 and 1 are exact.
    /// Empty without [`RenderSettings::maps`](super::RenderSettings::maps).
    pub attenuation: Vec<f32>,
    /// The 98th percentile that divides `attenuation`; 0 without maps.
    pub attenuation_p98: f32,
    /// 255 inside the sector, 0 outside [height × width]; shared by all frames of a configuration.
    pub mask: Arc<[u8]>,
    /// Position of the scanlines in the picture; `None` for a frame that no renderer made.
    pub scan: Option<ScanGeometry>,
    /// Complex baseband (re, im) after the point-spread function, before TGC and compression [scanlines × samples];
    /// empty unless the settings ask for it.
    pub lines: Vec<[f32; 2]>,
    /// Contact of the probe's face with the skin; `None` without the effect `contact`, when the whole face is coupled.
    pub contact: Option<Contact>,
    /// Number of crossings of map rays and interactions of paths that exceeded the buffers' capacity; 0 in a correct
    /// frame.
    pub overflows: u32,
    /// Times of the frame's passes.
    pub times: FrameTimes,
}

/// Copies the first `width` elements of each row of `stride` elements. One thread does it: waking others takes longer
/// than the copy.
pub(super) fn unpad<T: Copy>(into: &mut Vec<T>, from: &[T], width: usize, stride: usize) {
    into.clear();
    if width == stride {
        into.extend_from_slice(from);
        return;
    }
    for row in from.chunks_exact(stride) {
        into.extend_from_slice(&row[..width]);
    }
}

/// Logs a warning that in `frames` frames crossings did not fit the buffers; nothing if 0.
pub fn warn_of_overflows(frames: usize) {
    if frames > 0 {
        tracing::warn!(
            "in {frames} frames a few paths met more interfaces than are kept, and go on in the last medium"
        );
    }
}
