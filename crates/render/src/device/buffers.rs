//! Buffers on the device: buffers of the scene, made once, and buffers of a configuration.

use insonify_core::anatomy::Bvh;

use super::aperture_buffers::ApertureBuffers;
use super::gpu::{Gpu, UNIFORM};
use super::needle_buffers::NeedleBuffers;
use crate::batch_plan::{BatchPlan, PATH_BYTES};
use crate::constants::{BLOCK_QUADS, DELAY_STEPS, ENTRIES, PULSE_QUADS, SEGMENTS, STARTS, TISSUES_MAX};
use crate::error::BackendError;
use crate::params::Params;
use crate::tables::Tables;
use crate::texture::PackedTexture;

/// Bytes reserved for the uniforms of one batch of one frame: a multiple of 256, the largest alignment of any device.
pub(crate) const PARAMS_STRIDE: u64 = 512;
const _: () = assert!(size_of::<Params>() <= PARAMS_STRIDE as usize);

/// Buffers that hold the scene. They are independent of probe and settings.
#[derive(Debug)]
pub(crate) struct SceneBuffers {
    pub(super) nodes: wgpu::Buffer,
    pub(super) triangles: wgpu::Buffer,
    pub(super) surface_tissue: wgpu::Buffer,
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

/// Buffers of one configuration. Clones share the memory.
#[derive(Debug, Clone)]
pub(crate) struct Buffers {
    /// Number of frames that one dispatch makes.
    pub(super) frames: u32,
    pub(super) params: wgpu::Buffer,
    pub(super) rays: wgpu::Buffer,
    pub(super) map_rays: wgpu::Buffer,
    pub(super) tissues: wgpu::Buffer,
    pub(super) textures: wgpu::Buffer,
    pub(super) lateral_kernels: wgpu::Buffer,
    pub(super) kernel_spans: wgpu::Buffer,
    pub(super) pulse: wgpu::Buffer,
    pub(super) delays: wgpu::Buffer,
    pub(super) scatterer_gain: wgpu::Buffer,
    pub(super) sheet_reach: wgpu::Buffer,
    pub(super) pixels: wgpu::Buffer,
    pub(super) sector_words: wgpu::Buffer,
    pub(super) starts_inside: wgpu::Buffer,
    pub(super) couplings: wgpu::Buffer,
    pub(super) near_field: wgpu::Buffer,
    pub(super) overflows: wgpu::Buffer,
    /// Overflow counter of `section`. It is separate, so that `section` doesn't wait for passes of the paths.
    pub(super) map_overflows: wgpu::Buffer,
    pub(super) starts: wgpu::Buffer,
    pub(super) segments: wgpu::Buffer,
    pub(super) echoes: wgpu::Buffer,
    pub(super) hints: wgpu::Buffer,
    pub(super) raster: wgpu::Buffer,
    pub(super) segment_counts: wgpu::Buffer,
    pub(super) baseband: wgpu::Buffer,
    pub(super) focused: wgpu::Buffer,
    /// Working memory of `multiples`.
    pub(super) again: wgpu::Buffer,
    pub(super) polar: wgpu::Buffer,
    pub(super) lines: wgpu::Buffer,
    pub(super) aperture: ApertureBuffers,
    pub(super) needle: NeedleBuffers,
    pub(super) kept_powers: wgpu::Buffer,
    pub(super) entries: wgpu::Buffer,
    pub(super) entry_counts: wgpu::Buffer,
    pub(super) percentile: wgpu::Buffer,
    pub(super) bmode: wgpu::Buffer,
    pub(super) segmentation: wgpu::Buffer,
    pub(super) attenuation: wgpu::Buffer,
    /// The buffers above that passes write, in a fixed order.
    written: Vec<wgpu::Buffer>,
}

impl Buffers {
    /// Makes buffers for dispatches of `frames` frames. Buffers of `previous` that have the right size are reused. They
    /// keep their contents until [`Buffers::fill`], so `previous` stays intact if this fails.
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
        // Buffers that passes write have one part per frame.
        let mut written = Vec::new();
        let mut part = |label: &'static str, size: u64, of: Of| {
            let buffer = work(label, size.max(16) * u64::from(frames), of)?;
            written.push(buffer.clone());
            Ok::<_, BackendError>(buffer)
        };
        let filled = |label, bytes: &[[f32; 4]], of: Of| work(label, size_of_val(bytes) as u64, of);
        // Small tables are uniforms, which software devices read several times faster than storage.
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
            // The shader's array needs at least one texture.
            textures: work(
                "textures",
                size_of_val(&tables.textures[..]).max(size_of::<PackedTexture>()) as u64,
                |b| &b.textures,
            )?,
            kernel_spans: work("kernel spans", 8 * tables.kernels.power.len() as u64, |b| &b.kernel_spans)?,
            lateral_kernels: work("lateral kernels", 4 * tables.kernels.lateral.len() as u64, |b| &b.lateral_kernels)?,
            pulse: uniform("pulse", 2 * 16 * u64::from(PULSE_QUADS), |b| &b.pulse)?,
            delays: uniform("fractional delays", 16 * u64::from(DELAY_STEPS + 1), |b| &b.delays)?,
            scatterer_gain: uniform("scatterer gain", 16 * u64::from(BLOCK_QUADS), |b| &b.scatterer_gain)?,
            sheet_reach: uniform("reach of the sheets", 16 * u64::from(BLOCK_QUADS), |b| &b.sheet_reach)?,
            // One table per steering angle; the straight angle's table is `tables.pixels`.
            pixels: work("pixels", sector_pixels * tables.angles.len() as u64, |b| &b.pixels)?,
            sector_words: work("sector words", sector_pixels / 4, |b| &b.sector_words)?,
            starts_inside: part("start membership", paths * 32, |b| &b.starts_inside)?,
            couplings: part("couplings", paths * 4, |b| &b.couplings)?,
            near_field: filled("near field", near_field, |b| &b.near_field)?,
            overflows: part("overflows", 16, |b| &b.overflows)?,
            map_overflows: part("overflows of maps", 16, |b| &b.map_overflows)?,
            starts: part("segment starts", paths * u64::from(STARTS) * 4, |b| &b.starts)?,
            segments: part("segments", paths * PATH_BYTES, |b| &b.segments)?,
            echoes: part("interface echoes", paths * u64::from(SEGMENTS) * 8, |b| &b.echoes)?,
            hints: part("segment hints", paths * u64::from(params.hint_words) * 4, |b| &b.hints)?,
            raster: part("map raster", u64::from(params.map_rays) * u64::from(params.map_depths) * 4, |b| &b.raster)?,
            segment_counts: part("segment counts", paths * 4, |b| &b.segment_counts)?,
            baseband: part("baseband", samples * 8, |b| &b.baseband)?,
            focused: part("focused baseband", samples * 8, |b| &b.focused)?,
            again: part("multiples", if params.face_reflection > 0.0 { samples * 8 } else { 16 }, |b| &b.again)?,
            polar: part("polar image", u64::from(params.levels_per_sample) * samples * 4, |b| &b.polar)?,
            lines: part("lines", if keep_lines { samples * 8 } else { 16 }, |b| &b.lines)?,
            aperture: ApertureBuffers::new(gpu, tables, params, plan, previous.map(|b| &b.aperture), frames)?,
            needle: NeedleBuffers::new(gpu, tables, params.scanlines)?,
            kept_powers: part("scatterer powers", if plan.batches > 1 { samples * 16 } else { 16 }, |b| {
                &b.kept_powers
            })?,
            entries: part("section", u64::from(params.map_rays) * u64::from(ENTRIES) * 16, |b| &b.entries)?,
            entry_counts: part("section counts", u64::from(params.map_rays) * 4, |b| &b.entry_counts)?,
            percentile: part("percentile", 16, |b| &b.percentile)?,
            bmode: part("B-mode", pixels, |b| &b.bmode)?,
            segmentation: part("segmentation", pixels, |b| &b.segmentation)?,
            attenuation: part("attenuation", pixels * 2, |b| &b.attenuation)?,
            written,
        })
    }

    /// Uploads the tables and clears the buffers that passes write. No pass writes image words outside the sector, and
    /// none may read results of another configuration.
    pub(crate) fn fill(&self, gpu: &Gpu, tables: &Tables, refraction: bool, previous: Option<&Self>) {
        let in_sector = |pixels: &[u32]| -> Vec<u32> {
            tables.sector_words.iter().flat_map(|&word| pixels[4 * word as usize..][..4].iter().copied()).collect()
        };
        let steered = tables.angles.iter().map(|angle| &angle.pixels[..]).filter(|pixels| !pixels.is_empty());
        let sector_pixels: Vec<u32> = std::iter::once(&tables.pixels[..]).chain(steered).flat_map(in_sector).collect();
        let write = |buffer: &wgpu::Buffer, bytes: &[u8]| gpu.queue.write_buffer(buffer, 0, bytes);
        // Pads a table with zeros to the size of its uniform buffer.
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
        let mut pulse = tables.kernels.pulse.clone();
        pulse.resize(4 * PULSE_QUADS as usize, 0.0);
        pulse.extend_from_slice(&tables.kernels.midway);
        padded(&self.pulse, bytemuck::cast_slice(&pulse));
        padded(&self.delays, bytemuck::cast_slice(&tables.kernels.delays));
        padded(&self.scatterer_gain, bytemuck::cast_slice(&tables.kernels.scatterer_gain));
        let reach = tables.sheets.as_ref().map_or(&[][..], |sheets| &sheets.per_reach_mm);
        padded(&self.sheet_reach, bytemuck::cast_slice(reach));
        write(&self.near_field, bytemuck::cast_slice(tables.near_field.as_ref().map_or(&[][..], |near| &near.values)));
        write(&self.pixels, bytemuck::cast_slice(&sector_pixels));
        write(&self.sector_words, bytemuck::cast_slice(&tables.sector_words));
        self.aperture.fill(gpu, tables, refraction);
        // New buffers are zero already.
        let Some(previous) = previous else { return };
        let label = wgpu::CommandEncoderDescriptor { label: Some("clear") };
        let mut encoder = gpu.device.create_command_encoder(&label);
        for (buffer, _) in self.written().zip(previous.written()).filter(|(new, old)| new == old) {
            encoder.clear_buffer(buffer, 0, None);
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// All buffers that passes write, with one part per frame each.
    fn written(&self) -> impl Iterator<Item = &wgpu::Buffer> {
        self.written.iter().chain(&self.aperture.written)
    }

    /// Whether passes write this buffer.
    pub(super) fn is_written(&self, buffer: &wgpu::Buffer) -> bool {
        self.written().any(|written| written == buffer)
    }

    /// Size of all buffers that passes write, bytes.
    pub(super) fn written_bytes(&self) -> u64 {
        self.written().map(wgpu::Buffer::size).sum()
    }
}
