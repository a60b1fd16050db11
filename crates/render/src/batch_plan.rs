//! Split of a frame's paths into batches whose segments fit into one buffer.

use super::constants::SEGMENTS;
use super::params::Params;
use super::segment::Segment;

/// Least size of the segment buffer, bytes: within the 128 MiB that every device can bind.
pub(crate) const SEGMENT_BYTES_LEAST: u64 = 96 << 20;

/// Split of a frame's paths into batches of layers; a layer that is too large is split by scanlines. Every batch also
/// holds the axial paths of all scanlines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BatchPlan {
    layers_per_batch: u32,
    lines_per_batch: u32,
    /// Number of batches that share the same layers; more than 1 only if a layer is split.
    parts: u32,
    pub(crate) batches: u32,
}

/// Size of one path's segments, bytes.
pub(crate) const PATH_BYTES: u64 = SEGMENTS as u64 * size_of::<Segment>() as u64;

impl BatchPlan {
    /// Splits a frame into whole layers: as many per batch as fit into the least segment buffer, but at least one.
    pub(crate) fn by_layers(whole: &Params) -> Self {
        let of_layer = u64::from(whole.scanlines) * u64::from(whole.rays) * PATH_BYTES;
        let axial_bytes = u64::from(whole.scanlines) * PATH_BYTES;
        let fits = SEGMENT_BYTES_LEAST.saturating_sub(axial_bytes) / of_layer.max(1);
        let layers_per_batch = fits.clamp(1, u64::from(whole.layers.max(1))) as u32;
        let batches = whole.layers.div_ceil(layers_per_batch);
        Self { layers_per_batch, lines_per_batch: whole.scanlines, parts: 1, batches }
    }

    /// Splits a frame into batches whose segments take at most `bytes_max`. One scanline of one layer is never split.
    #[cfg_attr(not(feature = "gpu"), allow(dead_code, reason = "the host takes whole layers"))]
    pub(crate) fn within(bytes_max: u64, whole: &Params) -> Self {
        let of_line = u64::from(whole.rays) * PATH_BYTES;
        let axial_bytes = u64::from(whole.scanlines) * PATH_BYTES;
        let lines = bytes_max.saturating_sub(axial_bytes) / of_line.max(1);
        let layers = lines / u64::from(whole.scanlines.max(1));
        if layers >= 1 || whole.single() {
            let layers_per_batch = layers.clamp(1, u64::from(whole.layers.max(1))) as u32;
            let batches = whole.layers.div_ceil(layers_per_batch);
            return Self { layers_per_batch, lines_per_batch: whole.scanlines, parts: 1, batches };
        }
        let parts = whole.scanlines.div_ceil(lines.max(1) as u32);
        let lines_per_batch = whole.scanlines.div_ceil(parts);
        let parts = whole.scanlines.div_ceil(lines_per_batch);
        Self { layers_per_batch: 1, lines_per_batch, parts, batches: whole.layers * parts }
    }

    /// Uniforms of batch `batch`, from the whole frame's uniforms. Batch 0 has the most paths.
    pub(crate) fn params(&self, batch: u32, whole: &Params) -> Params {
        let (layer_first, line_first) =
            (batch / self.parts * self.layers_per_batch, batch % self.parts * self.lines_per_batch);
        Params {
            layer_first,
            layer_count: self.layers_per_batch.min(whole.layers - layer_first),
            line_first,
            line_count: self.lines_per_batch.min(whole.scanlines - line_first),
            ..*whole
        }
    }

    /// Whether a layer is spread over several batches.
    #[cfg_attr(not(feature = "gpu"), allow(dead_code, reason = "the host takes whole layers"))]
    pub(crate) fn splits_layers(&self) -> bool {
        self.parts > 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn whole(scanlines: u32, rays: u32, layers: u32) -> Params {
        let (layer_count, line_count) = (layers, scanlines);
        Params {
            scanlines,
            rays,
            layers,
            layer_count,
            line_count,
            axial_paths: scanlines,
            ..bytemuck::Zeroable::zeroed()
        }
    }

    /// Checks that the batches hold each scanline of each layer once, in order, within `bytes_max`. Returns the number
    /// of batches.
    fn checked(plan: BatchPlan, bytes_max: u64, whole: &Params) -> u32 {
        let mut taken = Vec::new();
        for batch in 0..plan.batches {
            let params = plan.params(batch, whole);
            assert!(u64::from(params.paths()) * PATH_BYTES <= bytes_max, "{plan:?}");
            assert!(params.paths() <= plan.params(0, whole).paths(), "{plan:?}");
            for layer in params.layer_first..params.layer_first + params.layer_count {
                let lines = params.line_first..params.line_first + params.line_count;
                taken.extend(lines.map(|line| (layer, line)));
            }
        }
        let all = (0..whole.layers).flat_map(|layer| (0..whole.scanlines).map(move |line| (layer, line)));
        assert!(taken.iter().copied().eq(all), "{plan:?}");
        plan.batches
    }

    #[test]
    fn batches_hold_every_scanline_of_every_layer_once() {
        let least = SEGMENT_BYTES_LEAST;
        for (lines, rays, layers, bytes_max, batches) in [
            (256, 32, 3, least, 1),
            (256, 128, 3, least, 3),
            (256, 128, 3, 1 << 30, 1),
            (1024, 256, 1, least, 6),
            (1024, 256, 3, least, 18),
            (1024, 256, 3, 1 << 30, 2),
            (33, 7, 3, 900 * PATH_BYTES, 1),
            (33, 7, 3, 100 * PATH_BYTES, 12),
            (33, 7, 3, 40 * PATH_BYTES, 99),
        ] {
            let whole = whole(lines, rays, layers);
            assert_eq!(checked(BatchPlan::within(bytes_max, &whole), bytes_max, &whole), batches, "{lines} {rays}");
        }
    }

    #[test]
    fn the_host_and_the_least_buffer_agree_where_layers_fit() {
        for (lines, rays, layers) in [(256, 1, 1), (256, 32, 3), (256, 128, 3), (33, 200, 10)] {
            let whole = whole(lines, rays, layers);
            let plan = BatchPlan::by_layers(&whole);
            assert_eq!(BatchPlan::within(SEGMENT_BYTES_LEAST, &whole), plan);
            checked(plan, SEGMENT_BYTES_LEAST, &whole);
        }
        // `by_layers` never splits a layer.
        assert_eq!(BatchPlan::by_layers(&whole(1024, 256, 2)).batches, 2);
    }
}
