//! Split of a frame's layers into batches whose segments fit into one buffer.

use super::constants::SEGMENTS;
use super::params::Params;

/// Largest buffer of segments, bytes: within the 128 MiB that every device binds.
const SEGMENT_BYTES_MAX: u64 = 96 << 20;

/// Split of a frame's layers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BatchPlan {
    pub(crate) layers_per_batch: u32,
    pub(crate) batches: u32,
}

impl BatchPlan {
    /// Plan of a frame of `scanlines` × `rays` × `layers` paths.
    pub(crate) fn new(scanlines: u32, rays: u32, layers: u32) -> Self {
        let bytes = |paths: u32| u64::from(scanlines) * u64::from(paths) * u64::from(SEGMENTS) * 48;
        // Every batch also holds the guides.
        let fits = ((SEGMENT_BYTES_MAX - bytes(1)) / bytes(rays)).clamp(1, u64::from(layers)) as u32;
        Self { layers_per_batch: fits, batches: layers.div_ceil(fits) }
    }

    /// Uniforms of one batch; `whole` are the frame's.
    pub(crate) fn params(&self, batch: u32, whole: &Params) -> Params {
        let layer_first = batch * self.layers_per_batch;
        Params { layer_first, layer_count: self.layers_per_batch.min(whole.layer_count - layer_first), ..*whole }
    }
}
