//! One rendered frame on the CPU.

/// Time of one pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PassTime {
    /// Name of the pass, that of its shader.
    pub name: &'static str,
    /// Time on the device, ms; of `trace` on the host where the host follows the paths, `locate` with it.
    pub ms: f64,
}

/// Times of one frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrameTimes {
    /// From the call until the frame lay in memory, ms.
    pub total_ms: f64,
    /// Time of each pass, in order; none of the device's where it has no timestamps.
    pub passes: Vec<PassTime>,
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
    /// Complex baseband (re, im) after the point-spread function, before TGC and compression [scanlines × samples];
    /// empty unless the settings ask for it.
    pub lines: Vec<[f32; 2]>,
    /// Crossings of map rays or interactions of paths beyond what the buffers hold; 0 in a sound frame.
    pub overflows: u32,
    /// Times.
    pub times: FrameTimes,
}
