//! Memory of the host's passes for one configuration.

use std::sync::Arc;

use rayon::prelude::*;

use super::detect::DepthGain;
use super::fourier::{Roots, Wide};
use super::path_outputs::PathOutputs;
use super::propagate::Propagation;
use super::scan_convert::Layout;
use super::transmission::CellMeans;
use crate::render::aperture::{ApertureTables, MODE_LANES};
use crate::render::configuration::Configuration;
use crate::render::constants::{DEPTH_BLOCK, ENTRIES, SEGMENTS, STARTS, TISSUES_MAX};
use crate::render::error::BackendError;
use crate::render::snapshot::PassBuffers;
use crate::settings::EffectSet;

/// Outputs of the passes, and their inputs beside the tables.
#[derive(Debug)]
pub(super) struct Buffers {
    /// All outputs except images, which go into the frame. `lines` are empty unless the settings ask for them.
    pub(super) passes: PassBuffers,
    pub(super) aperture: Option<ApertureBuffers>,
    /// Amplitudes that `lateral` compares [blocks × 2 × scanlines]; empty without the aperture.
    pub(super) loudness: Vec<f32>,
    /// Powers of the scatterers between batches; empty if there is one.
    pub(super) kept_powers: Vec<[f32; 3]>,
    pub(super) gain: DepthGain,
    pub(super) layout: PlacedLayout,
    /// Layouts of the angles; none of an angle without steering.
    pub(super) steered: Vec<Option<PlacedLayout>>,
    /// One-way attenuation of each tissue, nepers/mm.
    pub(super) rates_np_mm: [f32; TISSUES_MAX as usize + 1],
    effects: EffectSet,
}

/// A layout with the places of the pixels that it was made of.
#[derive(Debug, Clone)]
pub(super) struct PlacedLayout {
    pixels: Arc<[u32]>,
    pub(super) layout: Arc<Layout>,
}

/// Memory of the aperture's passes beside their outputs.
#[derive(Debug)]
pub(super) struct ApertureBuffers {
    pub(super) propagation: Propagation,
    pub(super) beam_roots: Roots,
    /// [cells × planes]
    pub(super) cell_means: Vec<CellMeans>,
    /// [groups of modes × cells]
    pub(super) mode_work: Vec<Wide>,
    /// [planes × 2 × beams]
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
    /// Buffers of a configuration. Layouts of `known` buffers of the same pixels are taken over.
    ///
    /// # Errors
    /// Too little memory.
    pub(super) fn new(configuration: &Configuration, known: &[&Self]) -> Result<Self, BackendError> {
        let Configuration { params, tables, batches, settings, effects, .. } = configuration;
        let paths = u64::from(params.paths(batches.layers_per_batch));
        let samples = u64::from(params.scanlines) * u64::from(params.row_samples);
        let map_rays = u64::from(params.map_rays);
        let passes = PassBuffers {
            segments: zeros("segments", paths * u64::from(SEGMENTS))?,
            starts_inside: zeros("start membership", paths)?,
            couplings: zeros("couplings", paths)?,
            starts: zeros("segment starts", paths * u64::from(STARTS))?,
            echoes: zeros("interface echoes", paths * u64::from(SEGMENTS))?,
            hints: zeros("segment hints", paths * u64::from(params.hint_words))?,
            segment_counts: zeros("segment counts", paths)?,
            baseband: zeros("baseband", samples)?,
            reflected: zeros("reflected amplitudes", samples / u64::from(DEPTH_BLOCK))?,
            focused: zeros("focused baseband", samples)?,
            polar: zeros("polar image", samples)?,
            lines: zeros("lines", if settings.lines { samples } else { 0 })?,
            entries: zeros("section", map_rays * u64::from(ENTRIES))?,
            entry_counts: zeros("section counts", map_rays)?,
            raster: zeros("map raster", map_rays * u64::from(params.map_depths))?,
            ..PassBuffers::default()
        };
        let planes = tables.aperture.as_ref().map_or(0, |aperture| aperture.planes as u64);
        let lines_planes = u64::from(params.scanlines) * planes;
        let passes = match &tables.aperture {
            Some(aperture) => PassBuffers {
                mask: zeros("transmission", (aperture.planes * aperture.sampling.cells) as u64)?,
                row_np: zeros("row losses", aperture.planes as u64)?,
                fields: zeros(
                    "mode fields",
                    (aperture.modes.len() * aperture.planes * 2 * aperture.sampling.cells) as u64,
                )?,
                amplitudes: zeros(
                    "beam amplitudes",
                    (aperture.planes * aperture.sampling.beams * aperture.sampling.cells) as u64,
                )?,
                beam_powers: zeros("beam powers", (aperture.planes * aperture.sampling.cells) as u64)?,
                profiles: zeros("profiles", lines_planes * u64::from(2 * params.lateral_half + 1))?,
                blends: zeros("profile blends", lines_planes)?,
                line_gains: zeros("line gains", u64::from(params.scanlines) * (aperture.planes as u64 + 1))?,
                block_gains: zeros("block gains", samples / u64::from(DEPTH_BLOCK))?,
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
            loudness: zeros("loudness", if planes > 0 { 2 * samples / u64::from(DEPTH_BLOCK) } else { 0 })?,
            kept_powers: zeros("scatterer powers", if batches.batches > 1 { samples } else { 0 })?,
            gain: DepthGain::default(),
            layout: layout(&tables.pixels),
            steered: tables.angles.par_iter().map(|l| (!l.pixels.is_empty()).then(|| layout(&l.pixels))).collect(),
            rates_np_mm: [0.0; TISSUES_MAX as usize + 1],
            effects: effects.effects(),
        })
    }

    /// Takes over memory of `previous` buffers of the same sizes and effects: pages that were written before are ready.
    pub(super) fn take_over(&mut self, previous: &mut Self) {
        fn swap<T>(new: &mut Vec<T>, old: &mut Vec<T>) {
            if new.len() == old.len() {
                std::mem::swap(new, old);
            }
        }
        if self.effects != previous.effects {
            return;
        }
        let (new, old) = (&mut self.passes, &mut previous.passes);
        swap(&mut new.segments, &mut old.segments);
        swap(&mut new.starts_inside, &mut old.starts_inside);
        swap(&mut new.couplings, &mut old.couplings);
        swap(&mut new.starts, &mut old.starts);
        swap(&mut new.echoes, &mut old.echoes);
        swap(&mut new.hints, &mut old.hints);
        swap(&mut new.segment_counts, &mut old.segment_counts);
        swap(&mut new.baseband, &mut old.baseband);
        swap(&mut new.reflected, &mut old.reflected);
        swap(&mut new.focused, &mut old.focused);
        swap(&mut new.polar, &mut old.polar);
        swap(&mut new.lines, &mut old.lines);
        swap(&mut new.entries, &mut old.entries);
        swap(&mut new.entry_counts, &mut old.entry_counts);
        swap(&mut new.raster, &mut old.raster);
        swap(&mut new.fields, &mut old.fields);
        swap(&mut new.amplitudes, &mut old.amplitudes);
        swap(&mut new.profiles, &mut old.profiles);
        swap(&mut self.kept_powers, &mut previous.kept_powers);
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
