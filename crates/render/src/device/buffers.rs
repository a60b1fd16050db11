//! Buffers of the device: those of the scene, made once, and those of a configuration.

use insonify_core::anatomy::Bvh;

use super::aperture_buffers::ApertureBuffers;
use super::gpu::{Gpu, UNIFORM};
use super::shaders::{ECHO, ECHO_BY_LINE, PASSES, TRACE, TRACE_BY_LANES};
use crate::batch_plan::BatchPlan;
use crate::constants::{BLOCK_QUADS, ENTRIES, PULSE_QUADS, SEGMENTS, STARTS, TISSUES_MAX};
use crate::error::BackendError;
use crate::params::Params;
use crate::tables::Tables;
use crate::texture::PackedTexture;

/// Stride of one batch's uniforms, bytes: a multiple of 256, the largest alignment of any device.
pub(crate) const PARAMS_STRIDE: u64 = 512;
const _: () = assert!(size_of::<Params>() <= PARAMS_STRIDE as usize);

/// Buffers of the scene, which don't change with probe and settings.
#[derive(Debug)]
pub(crate) struct SceneBuffers {
    pub(super) nodes: wgpu::Buffer,
    pub(super) triangles: wgpu::Buffer,
    surface_tissue: wgpu::Buffer,
    /// Displacement of each triangle from its rest position; one entry for static scenes.
    pub(super) displacements: wgpu::Buffer,
}

impl SceneBuffers {
    pub(crate) fn new(gpu: &Gpu, surface_words: &[u32], bvh: &Bvh) -> Result<Self, BackendError> {
        let filled = |label: &'static str, bytes: &[u8]| {
            let buffer = gpu.storage(label, bytes.len() as u64)?;
            gpu.queue.write_buffer(&buffer, 0, bytes);
            Ok(buffer)
        };
        Ok(Self {
            nodes: filled("BVH nodes", bytemuck::cast_slice(&bvh.nodes))?,
            triangles: filled("triangles", bytemuck::cast_slice(&bvh.triangles))?,
            surface_tissue: filled("surface tissues", bytemuck::cast_slice(surface_words))?,
            displacements: filled("displacements", bytemuck::cast_slice(bvh.displacements()))?,
        })
    }
}

/// Buffers of a configuration. Cloning shares the memory.
#[derive(Debug, Clone)]
pub(crate) struct Buffers {
    /// Frames that a dispatch makes; what passes write has a part for each.
    pub(super) frames: u32,
    pub(crate) params: wgpu::Buffer,
    rays: wgpu::Buffer,
    map_rays: wgpu::Buffer,
    tissues: wgpu::Buffer,
    textures: wgpu::Buffer,
    lateral_kernels: wgpu::Buffer,
    kernel_spans: wgpu::Buffer,
    pulse: wgpu::Buffer,
    scatterer_gain: wgpu::Buffer,
    sheet_reach: wgpu::Buffer,
    pixels: wgpu::Buffer,
    sector_words: wgpu::Buffer,
    pub(crate) starts_inside: wgpu::Buffer,
    pub(crate) couplings: wgpu::Buffer,
    near_field: wgpu::Buffer,
    pub(crate) overflows: wgpu::Buffer,
    /// A counter of its own, so that `section` waits for no path.
    pub(crate) map_overflows: wgpu::Buffer,
    pub(crate) starts: wgpu::Buffer,
    pub(crate) segments: wgpu::Buffer,
    pub(crate) echoes: wgpu::Buffer,
    pub(crate) hints: wgpu::Buffer,
    pub(crate) raster: wgpu::Buffer,
    pub(crate) segment_counts: wgpu::Buffer,
    pub(crate) baseband: wgpu::Buffer,
    pub(crate) focused: wgpu::Buffer,
    pub(crate) polar: wgpu::Buffer,
    pub(crate) lines: wgpu::Buffer,
    pub(crate) aperture: ApertureBuffers,
    pub(crate) kept_powers: wgpu::Buffer,
    pub(crate) entries: wgpu::Buffer,
    pub(crate) entry_counts: wgpu::Buffer,
    pub(crate) percentile: wgpu::Buffer,
    pub(crate) bmode: wgpu::Buffer,
    pub(crate) segmentation: wgpu::Buffer,
    pub(crate) attenuation: wgpu::Buffer,
}

impl Buffers {
    /// Makes the buffers for `frames` frames, and reuses those of `previous` that have the right size. They keep their contents until
    /// [`Buffers::fill`], so a configuration that fails leaves `previous` intact.
    pub(crate) fn new(
        gpu: &Gpu,
        tables: &Tables,
        params: &Params,
        plan: &BatchPlan,
        keep_lines: bool,
        previous: Option<&Self>,
        frames: u32,
    ) -> Result<Self, BackendError> {
        let paths = u64::from(plan.params(0, params).paths());
        let samples = u64::from(params.scanlines) * u64::from(params.row_samples);
        let pixels = u64::from(params.row_words * 4) * u64::from(params.image.height);
        let sector_pixels = tables.sector_words.len() as u64 * 16;
        let near_field = tables.near_field.as_ref().map_or(&[][..], |near| &near.values);
        type Of = fn(&Buffers) -> &wgpu::Buffer;
        let taken = |of: Of, size: u64| previous.map(of).filter(|b| b.size() == size).cloned();
        let work = |label: &'static str, size: u64, of: Of| match taken(of, size.max(16)) {
            Some(buffer) => Ok(buffer),
            None => gpu.storage(label, size),
        };
        // What passes write: a part for each frame.
        let part = |label: &'static str, size: u64, of: Of| work(label, size.max(16) * u64::from(frames), of);
        let filled = |label, bytes: &[[f32; 4]], of: Of| work(label, size_of_val(bytes) as u64, of);
        // Small tables are uniforms: software devices read those several times faster.
        let uniform = |label: &'static str, size: u64, of: Of| match taken(of, size) {
            Some(buffer) => Ok(buffer),
            None => gpu.buffer(label, size, UNIFORM),
        };
        Ok(Self {
            frames,
            params: uniform("params", PARAMS_STRIDE * u64::from(plan.batches * frames), |b| &b.params)?,
            rays: work("rays", 16 * (tables.rays.len() + tables.elevations.len()) as u64, |b| &b.rays)?,
            map_rays: filled("map rays", &tables.map_rays, |b| &b.map_rays)?,
            tissues: uniform("tissues", 48 * u64::from(TISSUES_MAX), |b| &b.tissues)?,
            // The shader's array has one texture at least.
            textures: work(
                "textures",
                size_of_val(&tables.textures[..]).max(size_of::<PackedTexture>()) as u64,
                |b| &b.textures,
            )?,
            kernel_spans: work("kernel spans", 8 * tables.kernels.power.len() as u64, |b| &b.kernel_spans)?,
            lateral_kernels: work("lateral kernels", 4 * tables.kernels.lateral.len() as u64, |b| &b.lateral_kernels)?,
            pulse: uniform("pulse", 16 * u64::from(PULSE_QUADS), |b| &b.pulse)?,
            scatterer_gain: uniform("scatterer gain", 16 * u64::from(BLOCK_QUADS), |b| &b.scatterer_gain)?,
            sheet_reach: uniform("reach of the sheets", 16 * u64::from(BLOCK_QUADS), |b| &b.sheet_reach)?,
            // The straight angle has no places of its own.
            pixels: work("pixels", sector_pixels * tables.angles.len() as u64, |b| &b.pixels)?,
            sector_words: work("sector words", sector_pixels / 4, |b| &b.sector_words)?,
            starts_inside: part("start membership", paths * 32, |b| &b.starts_inside)?,
            couplings: part("couplings", paths * 4, |b| &b.couplings)?,
            near_field: filled("near field", near_field, |b| &b.near_field)?,
            overflows: part("overflows", 16, |b| &b.overflows)?,
            map_overflows: part("overflows of maps", 16, |b| &b.map_overflows)?,
            starts: part("segment starts", paths * u64::from(STARTS) * 4, |b| &b.starts)?,
            segments: part("segments", paths * u64::from(SEGMENTS) * 48, |b| &b.segments)?,
            echoes: part("interface echoes", paths * u64::from(SEGMENTS) * 8, |b| &b.echoes)?,
            hints: part("segment hints", paths * u64::from(params.hint_words) * 4, |b| &b.hints)?,
            raster: part("map raster", u64::from(params.map_rays) * u64::from(params.map_depths) * 4, |b| &b.raster)?,
            segment_counts: part("segment counts", paths * 4, |b| &b.segment_counts)?,
            baseband: part("baseband", samples * 8, |b| &b.baseband)?,
            focused: part("focused baseband", samples * 8, |b| &b.focused)?,
            polar: part("polar image", samples * 4, |b| &b.polar)?,
            lines: part("lines", if keep_lines { samples * 8 } else { 16 }, |b| &b.lines)?,
            aperture: ApertureBuffers::new(gpu, tables, params, plan, previous.map(|b| &b.aperture), frames)?,
            kept_powers: part("scatterer powers", if plan.batches > 1 { samples * 16 } else { 16 }, |b| {
                &b.kept_powers
            })?,
            entries: part("section", u64::from(params.map_rays) * u64::from(ENTRIES) * 16, |b| &b.entries)?,
            entry_counts: part("section counts", u64::from(params.map_rays) * 4, |b| &b.entry_counts)?,
            percentile: part("percentile", 16, |b| &b.percentile)?,
            bmode: part("B-mode", pixels, |b| &b.bmode)?,
            segmentation: part("segmentation", pixels, |b| &b.segmentation)?,
            attenuation: part("attenuation", pixels * 2, |b| &b.attenuation)?,
        })
    }

    /// Uploads the tables and clears the buffers that passes write. No pass writes image words outside the sector, and
    /// none may read data of another configuration.
    pub(crate) fn fill(
        &self,
        gpu: &Gpu,
        scene: &SceneBuffers,
        tables: &Tables,
        refraction: bool,
        previous: Option<&Self>,
    ) {
        let places = |pixels: &[u32]| -> Vec<u32> {
            tables.sector_words.iter().flat_map(|&word| pixels[4 * word as usize..][..4].iter().copied()).collect()
        };
        let steered = tables.angles.iter().map(|angle| &angle.pixels[..]).filter(|pixels| !pixels.is_empty());
        let sector_pixels: Vec<u32> = std::iter::once(&tables.pixels[..]).chain(steered).flat_map(places).collect();
        let write = |buffer: &wgpu::Buffer, bytes: &[u8]| gpu.queue.write_buffer(buffer, 0, bytes);
        // Pads a table that is shorter than its uniform with zeros.
        let padded = |buffer: &wgpu::Buffer, bytes: &[u8]| {
            let mut whole = bytes.to_vec();
            whole.resize(buffer.size() as usize, 0);
            write(buffer, &whole);
        };
        write(&self.rays, bytemuck::cast_slice(&[&tables.rays[..], &tables.elevations].concat()));
        write(&self.map_rays, bytemuck::cast_slice(&tables.map_rays));
        padded(&self.tissues, bytemuck::cast_slice(&tables.tissues));
        write(&self.textures, bytemuck::cast_slice(&tables.textures));
        write(&self.lateral_kernels, bytemuck::cast_slice(&tables.kernels.lateral));
        let spans = tables.kernels.reach.iter().zip(&tables.kernels.power);
        let spans: Vec<[f32; 2]> = spans.map(|(&reach, &power)| [reach as f32, power]).collect();
        write(&self.kernel_spans, bytemuck::cast_slice(&spans));
        padded(&self.pulse, bytemuck::cast_slice(&tables.kernels.pulse));
        padded(&self.scatterer_gain, bytemuck::cast_slice(&tables.kernels.scatterer_gain));
        let reach = tables.sheets.as_ref().map_or(&[][..], |sheets| &sheets.per_reach_mm);
        padded(&self.sheet_reach, bytemuck::cast_slice(reach));
        write(&self.near_field, bytemuck::cast_slice(tables.near_field.as_ref().map_or(&[][..], |near| &near.values)));
        write(&self.pixels, bytemuck::cast_slice(&sector_pixels));
        write(&self.sector_words, bytemuck::cast_slice(&tables.sector_words));
        self.aperture.fill(gpu, tables, refraction);
        // New memory is zero.
        let Some(previous) = previous else { return };
        let label = wgpu::CommandEncoderDescriptor { label: Some("clear") };
        let mut encoder = gpu.device.create_command_encoder(&label);
        for (buffer, _) in self.written(scene).zip(previous.written(scene)).filter(|(new, old)| new == old) {
            encoder.clear_buffer(buffer, 0, None);
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// Buffers that passes write.
    fn written<'a>(&'a self, scene: &'a SceneBuffers) -> impl Iterator<Item = &'a wgpu::Buffer> {
        let bound = PASSES.into_iter().flat_map(|(name, _)| self.of_pass(scene, name));
        bound.filter(|(_, binding)| *binding == Binding::Write).map(|(buffer, _)| buffer)
    }

    /// Size of all buffers that passes write, bytes.
    pub(super) fn written_bytes(&self, scene: &SceneBuffers) -> u64 {
        let mut known: Vec<&wgpu::Buffer> = Vec::new();
        for buffer in self.written(scene) {
            if !known.contains(&buffer) {
                known.push(buffer);
            }
        }
        known.iter().map(|buffer| buffer.size()).sum()
    }

    /// Numbers of a pass's bindings to buffers that frames have parts of.
    pub(super) fn parts_of_pass(&self, scene: &SceneBuffers, name: &str) -> Vec<u32> {
        let written: Vec<&wgpu::Buffer> = self.written(scene).collect();
        let bound = self.of_pass(scene, name);
        bound.iter().zip(1..).filter(|((buffer, _), _)| written.contains(buffer)).map(|(_, binding)| binding).collect()
    }

    /// Buffers that a pass binds after its parameters, in the order of its bindings.
    pub(crate) fn of_pass<'a>(&'a self, scene: &'a SceneBuffers, name: &str) -> Vec<(&'a wgpu::Buffer, Binding)> {
        let (read, write, uniform) = (Binding::Read, Binding::Write, Binding::Uniform);
        match name {
            "locate" => vec![
                (&scene.nodes, read),
                (&scene.triangles, read),
                (&scene.surface_tissue, read),
                (&self.rays, read),
                (&self.starts_inside, write),
                (&self.overflows, write),
                (&self.couplings, write),
            ],
            TRACE | TRACE_BY_LANES => vec![
                (&scene.nodes, read),
                (&scene.triangles, read),
                (&scene.surface_tissue, read),
                (&self.rays, read),
                (&self.starts_inside, read),
                (&self.overflows, write),
                (&self.tissues, uniform),
                (&self.starts, write),
                (&self.segments, write),
                (&self.echoes, write),
                (&self.segment_counts, write),
                (&self.hints, write),
                (&scene.displacements, read),
                (&self.couplings, read),
            ],
            "march" => vec![
                (&self.starts, read),
                (&self.segments, read),
                (&self.hints, read),
                (&self.scatterer_gain, uniform),
                (&self.baseband, write),
                (&self.kept_powers, write),
                (&self.aperture.shape, uniform),
                (&self.aperture.line_gains, read),
                (&self.sheet_reach, uniform),
                (&self.textures, read),
                (&self.aperture.reflected, write),
            ],
            ECHO | ECHO_BY_LINE => vec![
                (&self.starts, read),
                (&self.segments, read),
                (&self.echoes, read),
                (&self.segment_counts, read),
                (&self.aperture.shape, uniform),
                (&self.aperture.line_gains, read),
                (&self.baseband, write),
            ],
            "transmission" => vec![
                (&self.starts, read),
                (&self.segments, read),
                (&self.aperture.shape, uniform),
                (&self.aperture.cell_rays, read),
                (&self.aperture.mask, write),
                (&self.aperture.row_np, write),
                (&self.rays, read),
                (&self.aperture.partial_sums, write),
            ],
            "propagate" => vec![
                (&self.aperture.shape, uniform),
                (&self.aperture.modes, read),
                (&self.aperture.face, read),
                (&self.aperture.steps, read),
                (&self.aperture.mask, read),
                (&self.aperture.fields, write),
            ],
            "beams" => vec![
                (&self.aperture.shape, uniform),
                (&self.aperture.modes, read),
                (&self.aperture.beam_parts, read),
                (&self.aperture.fields, read),
                (&self.aperture.amplitudes, write),
            ],
            "profiles" => vec![
                (&self.aperture.shape, uniform),
                (&self.aperture.line_cells, read),
                (&self.aperture.reaches, read),
                (&self.aperture.unobstructed, read),
                (&self.lateral_kernels, read),
                (&self.aperture.amplitudes, read),
                (&self.aperture.beam_powers, write),
                (&self.aperture.profiles, write),
                (&self.aperture.blends, write),
            ],
            "visibility" => vec![
                (&self.starts, read),
                (&self.segments, read),
                (&self.aperture.shape, uniform),
                (&self.aperture.line_cells, read),
                (&self.aperture.beam_powers, read),
                (&self.aperture.row_np, read),
                (&self.aperture.line_gains, write),
                (&self.aperture.block_gains, write),
            ],
            "lateral" => vec![
                (&self.lateral_kernels, read),
                (&self.baseband, read),
                (&self.focused, write),
                (&self.aperture.block_gains, read),
                (&self.aperture.shape, uniform),
                (&self.aperture.profiles, read),
                (&self.aperture.blends, read),
                (&self.kernel_spans, read),
                (&self.aperture.reflected, read),
            ],
            "receive" => {
                vec![(&self.starts, read), (&self.segments, read), (&self.near_field, read), (&self.focused, write)]
            }
            "detect" => {
                vec![(&self.pulse, uniform), (&self.focused, read), (&self.polar, write), (&self.lines, write)]
            }
            "section" => vec![
                (&scene.nodes, read),
                (&scene.triangles, read),
                (&scene.surface_tissue, read),
                (&self.map_rays, read),
                (&self.tissues, uniform),
                (&self.entries, write),
                (&self.entry_counts, write),
                (&self.map_overflows, write),
                (&self.raster, write),
            ],
            "percentile" => vec![(&self.entries, read), (&self.entry_counts, read), (&self.percentile, write)],
            "scan_convert" => vec![
                (&self.pixels, read),
                (&self.polar, read),
                (&self.raster, read),
                (&self.percentile, read),
                (&self.tissues, uniform),
                (&self.bmode, write),
                (&self.segmentation, write),
                (&self.attenuation, write),
                (&self.sector_words, read),
            ],
            _ => Vec::new(),
        }
    }
}

/// Binding of a buffer by a pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Binding {
    Read,
    Write,
    Uniform,
}
