//! Memory of the host's passes for one configuration.

use std::sync::Arc;

use insonify_core::settings::EffectSet;
use rayon::prelude::*;

use super::aperture::fourier::{Roots, Wide};
use super::aperture::propagate::Propagation;
use super::aperture::transmission::CellMeans;
use super::image::detect::DepthGain;
use super::image::multiples::working_samples;
use super::image::scan_convert::Layout;
use super::trace::path_outputs::PathOutputs;
use crate::aperture::{ApertureTables, MODE_LANES};
use crate::batch_plan::BatchPlan;
use crate::configuration::Configuration;
use crate::constants::{DEPTH_BLOCK, ENTRIES, SEGMENTS, STARTS, TISSUES_MAX};
use crate::error::BackendError;
use crate::snapshot::PassBuffers;

/// Outputs of the passes, and their inputs except the tables.
#[derive(Debug)]
pub(super) struct Buffers {
    /// All outputs except images, which go into the frame. `lines` are empty unless the settings ask for them.
    pub(super) passes: PassBuffers,
    pub(super) aperture: Option<ApertureBuffers>,
    /// Amplitude factors of the scanlines, which `lateral` compares [blocks × 2 × scanlines]; empty without the
    /// aperture.
    pub(super) amplitudes: Vec<f32>,
    /// Split of the paths into batches of whole layers.
    pub(super) batches: BatchPlan,
    /// Powers of the scatterers, summed over the batches so far; empty if there is one batch.
    pub(super) kept_powers: Vec<[f32; 3]>,
    /// Working memory of `multiples`; empty without the effect.
    pub(super) again: Vec<[f32; 2]>,
    pub(super) gain: DepthGain,
    pub(super) layout: PlacedLayout,
    /// Layout of each steering angle; `None` for an angle without steering.
    pub(super) steered: Vec<Option<PlacedLayout>>,
    /// One-way attenuation of each tissue, nepers/mm.
    pub(super) rates_np_mm: [f32; TISSUES_MAX as usize + 1],
    effects: EffectSet,
    /// Moves of memory that [`Buffers::take_over`] has still to make.
    kept: Vec<TakeOver>,
}

/// Moves one output's memory from the second buffers to the first.
type TakeOver = fn(&mut PassBuffers, &mut PassBuffers);

/// A layout for scan conversion, and the packed pixel positions that it was made from.
#[derive(Debug, Clone)]
pub(super) struct PlacedLayout {
    pixels: Arc<[u32]>,
    pub(super) layout: Arc<Layout>,
}

/// Memory of the aperture's passes, except their outputs.
#[derive(Debug)]
pub(super) struct ApertureBuffers {
    pub(super) propagation: Propagation,
    pub(super) beam_roots: Roots,
    /// Sums over the layers so far [cells × planes].
    pub(super) cell_means: Vec<CellMeans>,
    /// Work of `propagate` [groups of modes × cells].
    pub(super) mode_work: Vec<Wide>,
    /// Working memory of the pass `beams` [planes × 2 × beams].
    pub(super) beam_work: Vec<Wide>,
}

impl ApertureBuffers {
    fn new(tables: &ApertureTables) -> Self {
        Self {
            propagation: Propagation::new(tables),
            beam_roots: Roots::new(tables.sampling.beams),
            cell_means: vec![[0.0; 2]; tables.sampling.cells * tables.planes],
            mode_work: vec![Wide::ZERO; tables.modes.len() / MODE_LANES * tables.sampling.cells],
            beam_work: vec![Wide::ZERO; tables.planes * 2 * tables.sampling.beams],
        }
    }
}

/// `count` zeros, or an error that names `what` if memory is short.
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
    /// Buffers of a configuration. Pixel layouts are shared with those `known` buffers that have the same pixels. If
    /// `reused` has the same effects, outputs of its size are not allocated: [`Buffers::take_over`] moves them here.
    ///
    /// # Errors
    /// Too little memory.
    pub(super) fn new(
        configuration: &Configuration,
        known: &[&Self],
        reused: Option<&Self>,
    ) -> Result<Self, BackendError> {
        let Configuration { params, tables, settings, effects, .. } = configuration;
        let batches = BatchPlan::by_layers(params);
        let paths = u64::from(batches.params(0, params).paths());
        let samples = u64::from(params.scanlines) * u64::from(params.row_samples);
        let map_rays = u64::from(params.map_rays);
        // Memory of the same size and effects is taken over later, so it is not allocated now.
        let reused = reused.filter(|reused| reused.effects == effects.effects());
        let mut kept: Vec<TakeOver> = Vec::new();
        macro_rules! fresh {
            ($field:ident, $what:expr, $count:expr) => {
                if reused.is_some_and(|reused| reused.passes.$field.len() as u64 == $count) {
                    kept.push(|new, old| std::mem::swap(&mut new.$field, &mut old.$field));
                    Vec::new()
                } else {
                    zeros($what, $count)?
                }
            };
        }
        let passes = PassBuffers {
            segments: fresh!(segments, "segments", paths * u64::from(SEGMENTS)),
            starts_inside: fresh!(starts_inside, "start membership", paths),
            couplings: fresh!(couplings, "couplings", paths),
            starts: fresh!(starts, "segment starts", paths * u64::from(STARTS)),
            echoes: fresh!(echoes, "interface echoes", paths * u64::from(SEGMENTS)),
            hints: fresh!(hints, "segment hints", paths * u64::from(params.hint_words)),
            segment_counts: fresh!(segment_counts, "segment counts", paths),
            baseband: fresh!(baseband, "baseband", samples),
            reflected: fresh!(reflected, "reflected amplitudes", samples / u64::from(DEPTH_BLOCK)),
            focused: fresh!(focused, "focused baseband", samples),
            polar: fresh!(polar, "polar image", u64::from(params.levels_per_sample) * samples),
            lines: fresh!(lines, "lines", if settings.lines { samples } else { 0 }),
            entries: fresh!(entries, "section", map_rays * u64::from(ENTRIES)),
            entry_counts: fresh!(entry_counts, "section counts", map_rays),
            raster: fresh!(raster, "map raster", map_rays * u64::from(params.map_depths)),
            ..PassBuffers::default()
        };
        let planes = tables.aperture.as_ref().map_or(0, |aperture| aperture.planes as u64);
        let lines_planes = u64::from(params.scanlines) * planes;
        let passes = match &tables.aperture {
            Some(aperture) => PassBuffers {
                mask: fresh!(mask, "transmission", (aperture.planes * aperture.sampling.cells) as u64),
                row_np: fresh!(row_np, "row losses", aperture.planes as u64),
                fields: fresh!(
                    fields,
                    "mode fields",
                    (aperture.modes.len() * aperture.planes * 2 * aperture.sampling.cells) as u64
                ),
                amplitudes: fresh!(
                    amplitudes,
                    "beam amplitudes",
                    (aperture.planes * aperture.sampling.beams * aperture.sampling.cells) as u64
                ),
                beam_powers: fresh!(beam_powers, "beam powers", (aperture.planes * aperture.sampling.cells) as u64),
                profiles: fresh!(profiles, "profiles", lines_planes * u64::from(2 * params.lateral_half + 1)),
                blends: fresh!(blends, "profile blends", lines_planes),
                line_gains: fresh!(
                    line_gains,
                    "line gains",
                    u64::from(params.scanlines) * (aperture.planes as u64 + 1)
                ),
                block_gains: fresh!(block_gains, "block gains", samples / u64::from(DEPTH_BLOCK)),
                ..passes
            },
            None => passes,
        };
        let (width, height) = (params.image.width, params.image.height);
        let layouts = known.iter().flat_map(|known| known.steered.iter().flatten().chain([&known.layout]));
        let layout = |pixels: &Arc<[u32]>| {
            let same = |known: &&PlacedLayout| Arc::ptr_eq(&known.pixels, pixels);
            layouts.clone().find(same).cloned().unwrap_or_else(|| PlacedLayout {
                pixels: pixels.clone(),
                layout: Arc::new(Layout::new(width, height, pixels, &tables.sector_words)),
            })
        };
        Ok(Self {
            passes,
            aperture: tables.aperture.as_ref().map(ApertureBuffers::new),
            amplitudes: zeros(
                "amplitudes of scanlines",
                if planes > 0 { 2 * samples / u64::from(DEPTH_BLOCK) } else { 0 },
            )?,
            batches,
            kept_powers: zeros("scatterer powers", if batches.batches > 1 { samples } else { 0 })?,
            again: zeros("multiples", if params.face_reflection > 0.0 { working_samples(params) } else { 0 })?,
            gain: DepthGain::default(),
            layout: layout(&tables.pixels),
            steered: tables.angles.par_iter().map(|l| (!l.pixels.is_empty()).then(|| layout(&l.pixels))).collect(),
            rates_np_mm: [0.0; TISSUES_MAX as usize + 1],
            effects: effects.effects(),
            kept,
        })
    }

    /// Takes over the memory of `reused`, the buffers given to [`Buffers::new`]. It was written before, so its pages
    /// are mapped.
    pub(super) fn take_over(&mut self, reused: &mut Self) {
        for take_over in std::mem::take(&mut self.kept) {
            take_over(&mut self.passes, &mut reused.passes);
        }
    }
}

/// Outputs of the first `paths` paths.
pub(super) fn path_outputs(passes: &mut PassBuffers, paths: usize) -> PathOutputs<'_> {
    let all = PathOutputs {
        segments: &mut passes.segments,
        starts: &mut passes.starts,
        echoes: &mut passes.echoes,
        starts_inside: &mut passes.starts_inside,
        couplings: &mut passes.couplings,
        hints: &mut passes.hints,
        segment_counts: &mut passes.segment_counts,
    };
    all.split_at(paths).0
}
