//! Buffers and pipelines of a renderer: made once, used for every frame.

use super::gpu::{Gpu, GpuError};
use super::params::Params;
use super::shaders::ShaderSet;
use super::tables::{BLOCK_QUADS, ENTRIES, LAYERS_MAX, PULSE_QUADS, SEGMENTS, STARTS, TISSUES_MAX, Tables};
use crate::anatomy::{Bvh, Scene};

/// Stride of one batch's uniforms; every device aligns to 256 at the most.
pub(crate) const PARAMS_STRIDE: u64 = 256;
/// Largest buffer of segments: within the 128 MiB that every device binds.
const SEGMENT_BYTES_MAX: u64 = 96 << 20;

/// Every buffer that passes read or write on the device.
#[derive(Debug)]
pub(crate) struct Buffers {
    pub(crate) params: wgpu::Buffer,
    pub(super) nodes: wgpu::Buffer,
    pub(super) triangles: wgpu::Buffer,
    surface_tissue: wgpu::Buffer,
    rays: wgpu::Buffer,
    map_rays: wgpu::Buffer,
    layers: wgpu::Buffer,
    tissues: wgpu::Buffer,
    lateral_kernels: wgpu::Buffer,
    pulse: wgpu::Buffer,
    scatterer_gain: wgpu::Buffer,
    pixels: wgpu::Buffer,
    sector_words: wgpu::Buffer,
    pub(crate) starts_inside: wgpu::Buffer,
    pub(crate) overflows: wgpu::Buffer,
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
    pub(crate) entries: wgpu::Buffer,
    pub(crate) entry_counts: wgpu::Buffer,
    pub(crate) percentile: wgpu::Buffer,
    pub(crate) bmode: wgpu::Buffer,
    pub(crate) segmentation: wgpu::Buffer,
    pub(crate) attenuation: wgpu::Buffer,
}

impl Buffers {
    pub(crate) fn new(
        gpu: &Gpu,
        scene: &Scene,
        bvh: &Bvh,
        tables: &Tables,
        params: &Params,
        plan: &BatchPlan,
        keep_lines: bool,
    ) -> Result<Self, GpuError> {
        let limit = gpu.device.limits().max_storage_buffer_binding_size;
        let paths = u64::from(params.scanlines * params.rays * plan.layers_per_batch);
        let samples = u64::from(params.scanlines) * u64::from(params.row_samples);
        let pixels = u64::from(params.row_words * 4) * u64::from(params.height);
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let empty = |label: &'static str, size: u64| {
            if size > limit {
                return Err(GpuError::Limit {
                    what: label,
                    needed: size,
                    limit_name: "bytes a storage buffer",
                    offered: limit,
                    adapter: gpu.adapter_name(),
                });
            }
            Ok(gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size.max(16),
                usage,
                mapped_at_creation: false,
            }))
        };
        let filled = |label: &'static str, bytes: &[u8]| {
            let buffer = empty(label, bytes.len() as u64)?;
            gpu.queue.write_buffer(&buffer, 0, bytes);
            Ok(buffer)
        };
        // Small tables are uniforms: software devices read those several times faster.
        let uniform = |label: &'static str, bytes: &[u8], size: u32| {
            let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size.into(),
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            gpu.queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        let word_pixels = |&word: &u32| tables.pixels[4 * word as usize..][..4].iter().copied();
        let sector_pixels: Vec<u32> = tables.sector_words.iter().flat_map(word_pixels).collect();
        let surface_tissue: Vec<u32> = if scene.surfaces.is_empty() { vec![0] } else { tables.surface_tissue.clone() };
        Ok(Self {
            params: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("params"),
                size: PARAMS_STRIDE * u64::from(plan.batches),
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            nodes: filled("BVH nodes", bytemuck::cast_slice(&bvh.nodes))?,
            triangles: filled("triangles", bytemuck::cast_slice(&bvh.triangles))?,
            surface_tissue: filled("surface tissues", bytemuck::cast_slice(&surface_tissue))?,
            rays: filled("rays", bytemuck::cast_slice(&tables.rays))?,
            map_rays: filled("map rays", bytemuck::cast_slice(&tables.map_rays))?,
            layers: uniform("layers", bytemuck::cast_slice(&tables.layers), 16 * LAYERS_MAX),
            tissues: uniform("tissues", bytemuck::cast_slice(&tables.tissues), 48 * TISSUES_MAX),
            lateral_kernels: filled("lateral kernels", bytemuck::cast_slice(&tables.lateral_kernels))?,
            pulse: uniform("pulse", bytemuck::cast_slice(&tables.pulse), 16 * PULSE_QUADS),
            scatterer_gain: uniform("scatterer gain", bytemuck::cast_slice(&tables.scatterer_gain), 16 * BLOCK_QUADS),
            pixels: filled("pixels", bytemuck::cast_slice(&sector_pixels))?,
            sector_words: filled("sector words", bytemuck::cast_slice(&tables.sector_words))?,
            starts_inside: empty("start membership", paths * 32)?,
            overflows: empty("overflows", 16)?,
            starts: empty("segment starts", paths * u64::from(STARTS) * 4)?,
            segments: empty("segments", paths * u64::from(SEGMENTS) * 48)?,
            echoes: empty("interface echoes", paths * u64::from(SEGMENTS) * 8)?,
            hints: empty("segment hints", paths * u64::from(params.hint_words) * 4)?,
            raster: empty("map raster", u64::from(params.map_rays) * u64::from(params.map_depths) * 4)?,
            segment_counts: empty("segment counts", paths * 4)?,
            baseband: empty("baseband", samples * 8)?,
            focused: empty("focused baseband", samples * 8)?,
            polar: empty("polar image", samples * 4)?,
            lines: empty("lines", if keep_lines { samples * 8 } else { 16 })?,
            entries: empty("section", u64::from(params.map_rays) * u64::from(ENTRIES) * 16)?,
            entry_counts: empty("section counts", u64::from(params.map_rays) * 4)?,
            percentile: empty("percentile", 16)?,
            bmode: empty("B-mode", pixels)?,
            segmentation: empty("segmentation", pixels)?,
            attenuation: empty("attenuation", pixels * 4)?,
        })
    }

    /// Buffers that a pass binds after its parameters, in the order of its bindings.
    fn of_pass(&self, name: &str) -> Vec<(&wgpu::Buffer, Binding)> {
        let (read, write, uniform) = (Binding::Read, Binding::Write, Binding::Uniform);
        match name {
            "locate" => vec![
                (&self.nodes, read),
                (&self.triangles, read),
                (&self.surface_tissue, read),
                (&self.rays, read),
                (&self.layers, uniform),
                (&self.starts_inside, write),
                (&self.overflows, write),
            ],
            "trace" => vec![
                (&self.nodes, read),
                (&self.triangles, read),
                (&self.surface_tissue, read),
                (&self.rays, read),
                (&self.layers, uniform),
                (&self.starts_inside, read),
                (&self.overflows, write),
                (&self.tissues, uniform),
                (&self.starts, write),
                (&self.segments, write),
                (&self.echoes, write),
                (&self.segment_counts, write),
                (&self.hints, write),
            ],
            "march" => vec![
                (&self.starts, read),
                (&self.segments, read),
                (&self.hints, read),
                (&self.layers, uniform),
                (&self.scatterer_gain, uniform),
                (&self.baseband, write),
            ],
            "echo" => vec![(&self.echoes, read), (&self.segment_counts, read), (&self.baseband, write)],
            "lateral" => vec![(&self.lateral_kernels, read), (&self.baseband, read), (&self.focused, write)],
            "detect" => {
                vec![(&self.pulse, uniform), (&self.focused, read), (&self.polar, write), (&self.lines, write)]
            }
            "section" => vec![
                (&self.nodes, read),
                (&self.triangles, read),
                (&self.surface_tissue, read),
                (&self.map_rays, read),
                (&self.tissues, uniform),
                (&self.entries, write),
                (&self.entry_counts, write),
                (&self.overflows, write),
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

/// How a pass binds a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Binding {
    Read,
    Write,
    Uniform,
}

/// How the layers are split so that their segments fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct BatchPlan {
    pub(crate) layers_per_batch: u32,
    pub(crate) batches: u32,
}

impl BatchPlan {
    pub(crate) fn new(scanlines: u32, rays: u32, layers: u32) -> Self {
        let layer_bytes = u64::from(scanlines) * u64::from(rays) * u64::from(SEGMENTS) * 48;
        let fits = (SEGMENT_BYTES_MAX / layer_bytes).clamp(1, u64::from(layers)) as u32;
        Self { layers_per_batch: fits, batches: layers.div_ceil(fits) }
    }
}

/// A compiled pass and what it binds.
#[derive(Debug)]
pub(crate) struct Pass {
    pub(crate) name: &'static str,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    pub(crate) groups: [u32; 3],
}

impl Pass {
    pub(crate) fn new(
        gpu: &Gpu,
        shaders: &ShaderSet,
        buffers: &Buffers,
        name: &'static str,
        groups: [u32; 3],
        constants: &[(&str, f64)],
    ) -> Result<Self, GpuError> {
        let limit = gpu.device.limits().max_compute_workgroups_per_dimension;
        if let Some(&needed) = groups.iter().find(|&&g| g > limit) {
            return Err(GpuError::Limit {
                what: name,
                needed: needed.into(),
                limit_name: "workgroups a dispatch",
                offered: limit.into(),
                adapter: gpu.adapter_name(),
            });
        }
        let device = &gpu.device;
        let scope = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let descriptor = wgpu::ShaderModuleDescriptor {
            label: Some(name),
            source: wgpu::ShaderSource::Wgsl(shaders.source(name).into()),
        };
        let checks = wgpu::ShaderRuntimeChecks {
            bounds_checks: shaders.bounds_checks,
            force_loop_bounding: false,
            ..wgpu::ShaderRuntimeChecks::checked()
        };
        // SAFETY: every index is bounded by the counts that the buffers were sized from (`Params`, `Tables`), every loop by
        // such a count or a constant; `check_scene` has seen every index of the scene. Checks cost time on every read.
        let module = unsafe { device.create_shader_module_trusted(descriptor, checks) };
        let bound = buffers.of_pass(name);
        let uniform = wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: true,
                min_binding_size: None,
            },
            count: None,
        };
        let storage = bound.iter().zip(1u32..).map(|((_, kind), binding)| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: match kind {
                    Binding::Uniform => wgpu::BufferBindingType::Uniform,
                    Binding::Read => wgpu::BufferBindingType::Storage { read_only: true },
                    Binding::Write => wgpu::BufferBindingType::Storage { read_only: false },
                },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        });
        let entries: Vec<_> = std::iter::once(uniform).chain(storage).collect();
        let layout =
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(name), entries: &entries });
        let params = wgpu::BufferBinding {
            buffer: &buffers.params,
            offset: 0,
            size: wgpu::BufferSize::new(size_of::<Params>() as u64),
        };
        let resources: Vec<_> =
            std::iter::once(wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::Buffer(params) })
                .chain(bound.iter().zip(1u32..).map(|((buffer, _), binding)| wgpu::BindGroupEntry {
                    binding,
                    resource: buffer.as_entire_binding(),
                }))
                .collect();
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(name),
            layout: &layout,
            entries: &resources,
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(name),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions { constants, zero_initialize_workgroup_memory: true },
            cache: None,
        });
        match pollster::block_on(scope.pop()) {
            Some(error) => Err(GpuError::Pipeline { pass: name, reason: error.to_string() }),
            None => Ok(Self { name, pipeline, bindings, groups }),
        }
    }

    /// Records the pass with the uniforms of `batch`.
    pub(crate) fn record(&self, encoder: &mut wgpu::ComputePass<'_>, batch: u32) {
        encoder.set_pipeline(&self.pipeline);
        encoder.set_bind_group(0, &self.bindings, &[batch * PARAMS_STRIDE as u32]);
        encoder.dispatch_workgroups(self.groups[0], self.groups[1], self.groups[2]);
    }
}
