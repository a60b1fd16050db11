//! Memory of the host's passes for one configuration.

use super::detect::DepthGain;
use super::path_outputs::PathOutputs;
use super::scan_convert::Layout;
use crate::render::configuration::Configuration;
use crate::render::constants::{ENTRIES, SEGMENTS, STARTS, TISSUES_MAX};
use crate::render::error::BackendError;
use crate::render::snapshot::PassBuffers;

/// Outputs of the passes, and their inputs beside the tables.
#[derive(Debug)]
pub(super) struct Buffers {
    /// All outputs except images, which go into the frame. `lines` are empty unless the settings ask for them.
    pub(super) passes: PassBuffers,
    pub(super) gain: DepthGain,
    pub(super) layout: Layout,
    /// One-way attenuation of each tissue, nepers/mm.
    pub(super) rates_np_mm: [f32; TISSUES_MAX as usize + 1],
}

/// `count` zeros, or an error if memory is short.
fn zeros<T: bytemuck::Zeroable>(what: &'static str, count: u64) -> Result<Vec<T>, BackendError> {
    let zeroed = usize::try_from(count).ok().and_then(|count| bytemuck::allocation::try_zeroed_vec(count).ok());
    zeroed.ok_or_else(|| BackendError::Memory {
        what,
        bytes: count.saturating_mul(size_of::<T>() as u64),
        reason: "the allocation failed".to_owned(),
        adapter: "the host".to_owned(),
    })
}

impl Buffers {
    /// Buffers of a configuration.
    ///
    /// # Errors
    /// Too little memory.
    pub(super) fn new(configuration: &Configuration) -> Result<Self, BackendError> {
        let Configuration { params, tables, batches, settings, .. } = configuration;
        let paths = u64::from(params.paths(batches.layers_per_batch));
        let samples = u64::from(params.scanlines) * u64::from(params.row_samples);
        let map_rays = u64::from(params.map_rays);
        let passes = PassBuffers {
            segments: zeros("segments", paths * u64::from(SEGMENTS))?,
            starts_inside: zeros("start membership", paths)?,
            starts: zeros("segment starts", paths * u64::from(STARTS))?,
            echoes: zeros("interface echoes", paths * u64::from(SEGMENTS))?,
            hints: zeros("segment hints", paths * u64::from(params.hint_words))?,
            segment_counts: zeros("segment counts", paths)?,
            baseband: zeros("baseband", samples)?,
            focused: zeros("focused baseband", samples)?,
            polar: zeros("polar image", samples)?,
            lines: zeros("lines", if settings.lines { samples } else { 0 })?,
            entries: zeros("section", map_rays * u64::from(ENTRIES))?,
            entry_counts: zeros("section counts", map_rays)?,
            raster: zeros("map raster", map_rays * u64::from(params.map_depths))?,
            ..PassBuffers::default()
        };
        Ok(Self {
            passes,
            gain: DepthGain::default(),
            layout: Layout::new(params.image.width, params.image.height, &tables.pixels, &tables.sector_words),
            rates_np_mm: [0.0; TISSUES_MAX as usize + 1],
        })
    }
}

/// Outputs of the first `paths` paths.
pub(super) fn path_outputs(passes: &mut PassBuffers, paths: usize) -> PathOutputs<'_> {
    let all = PathOutputs {
        segments: &mut passes.segments,
        starts: &mut passes.starts,
        echoes: &mut passes.echoes,
        starts_inside: &mut passes.starts_inside,
        hints: &mut passes.hints,
        segment_counts: &mut passes.segment_counts,
    };
    all.split_at(paths).0
}
