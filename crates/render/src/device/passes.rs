//! Compiled passes, cached by their specialisation, and their bindings.

use std::borrow::Cow;
use std::sync::Arc;

use super::buffers::{Binding, Buffers, PARAMS_STRIDE, SceneBuffers};
use super::gpu::Gpu;
use super::several::source_of_frames;
use super::shaders::{ShaderSet, pass_of};
use crate::error::BackendError;
use crate::params::Params;

/// Overrides that specialise a shader, and their values.
pub(crate) type Constants<'a> = &'a [(&'static str, f64)];

/// A shader, and what specialises it.
#[derive(Debug, Clone)]
pub(super) struct Shader<'a> {
    pub(super) name: &'static str,
    pub(super) constants: Constants<'a>,
    /// Frames that a dispatch makes.
    pub(super) frames: u32,
    /// Bindings of buffers that frames have parts of.
    pub(super) parts: Vec<u32>,
}

/// A compiled pass.
#[derive(Debug)]
struct Compiled {
    name: &'static str,
    constants: Vec<(&'static str, f64)>,
    frames: u32,
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

/// Every pass compiled so far. A compiled pass depends only on the shader and its overrides.
#[derive(Debug)]
pub(crate) struct Pipelines {
    shaders: ShaderSet,
    compiled: Vec<Arc<Compiled>>,
    /// Length of `compiled` at the last call of `take_cold`.
    warm: usize,
}

impl Pipelines {
    pub(crate) fn new(shaders: &ShaderSet) -> Self {
        Self { shaders: shaders.clone(), compiled: Vec::new(), warm: 0 }
    }

    /// Number of passes compiled so far.
    pub(crate) fn count(&self) -> usize {
        self.compiled.len()
    }

    /// Whether passes are made for software.
    pub(crate) fn in_software(&self, gpu: &Gpu) -> bool {
        gpu.is_software() && !self.shaders.as_gpu
    }

    /// Largest buffer of segments, bytes.
    pub(crate) fn segment_bytes_max(&self, gpu: &Gpu) -> u64 {
        self.shaders.segment_bytes_max.unwrap_or_else(|| gpu.segment_bytes_max())
    }

    /// Whether some were compiled since the last call.
    pub(crate) fn take_cold(&mut self) -> bool {
        let cold = self.warm < self.compiled.len();
        self.warm = self.compiled.len();
        cold
    }

    /// The pass of a shader, compiled if it wasn't yet; `bound` lists its buffers after the parameters.
    fn get(
        &mut self,
        gpu: &Gpu,
        shader: &Shader<'_>,
        bound: &[(&wgpu::Buffer, Binding)],
    ) -> Result<Arc<Compiled>, BackendError> {
        let Shader { name, constants, frames, .. } = *shader;
        let is_it = |c: &&Arc<Compiled>| c.name == name && c.constants == constants && c.frames == frames;
        if let Some(known) = self.compiled.iter().find(is_it) {
            return Ok(known.clone());
        }
        let compiled = gpu.validated(name, || compile(&gpu.device, &self.shaders, shader, bound))?;
        let compiled = Arc::new(compiled);
        self.compiled.push(compiled.clone());
        Ok(compiled)
    }
}

fn compile(
    device: &wgpu::Device,
    shaders: &ShaderSet,
    shader: &Shader<'_>,
    bound: &[(&wgpu::Buffer, Binding)],
) -> Compiled {
    let Shader { name, constants, frames, .. } = *shader;
    let source: Cow<'_, str> = match shaders.source(name) {
        source if frames > 1 => source_of_frames(source, &shader.parts, frames).into(),
        source => source.into(),
    };
    let descriptor = wgpu::ShaderModuleDescriptor { label: Some(name), source: wgpu::ShaderSource::Wgsl(source) };
    let checks = wgpu::ShaderRuntimeChecks {
        bounds_checks: shaders.bounds_checks,
        force_loop_bounding: false,
        ..wgpu::ShaderRuntimeChecks::checked()
    };
    // SAFETY: every index is bounded by the counts that the buffers were sized from (`Params`, `Tables`), every loop by
    // such a count or a constant; `check_scene` has checked every index of the scene. Checks cost time on every read.
    let module = unsafe { device.create_shader_module_trusted(descriptor, checks) };
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
    Compiled { name, constants: constants.to_vec(), frames, layout, pipeline }
}

/// A compiled pass with its bindings in one configuration.
#[derive(Debug)]
pub(crate) struct Pass {
    pub(crate) name: &'static str,
    compiled: Arc<Compiled>,
    bindings: wgpu::BindGroup,
    groups: [u32; 3],
    frames: u32,
}

impl Pass {
    pub(crate) fn new(
        gpu: &Gpu,
        pipelines: &mut Pipelines,
        buffers: (&SceneBuffers, &Buffers),
        name: &'static str,
        groups: [u32; 3],
        constants: Constants<'_>,
    ) -> Result<Self, BackendError> {
        let (scene, buffers) = buffers;
        let bound = buffers.of_pass(scene, name);
        let frames = buffers.frames;
        let parts = if frames > 1 { buffers.parts_of_pass(scene, name) } else { Vec::new() };
        let shader = Shader { name, constants, frames, parts };
        let size = size_of::<Params>() * frames as usize;
        Self::bound(gpu, pipelines, (&buffers.params, size), &shader, groups, &bound)
    }

    /// A pass with the buffers `bound` to it after its parameters, a part of a buffer of this size in bytes.
    ///
    /// # Errors
    /// More workgroups than the device takes, or a shader that it refuses.
    pub(super) fn bound(
        gpu: &Gpu,
        pipelines: &mut Pipelines,
        (params, size): (&wgpu::Buffer, usize),
        shader: &Shader<'_>,
        groups: [u32; 3],
        bound: &[(&wgpu::Buffer, Binding)],
    ) -> Result<Self, BackendError> {
        let name = shader.name;
        let offered = gpu.device.limits().max_compute_workgroups_per_dimension;
        for needed in groups {
            gpu.check_limit(name, needed.into(), "workgroups a dispatch", offered.into())?;
        }
        let compiled = pipelines.get(gpu, shader, bound)?;
        let params = wgpu::BufferBinding { buffer: params, offset: 0, size: wgpu::BufferSize::new(size as u64) };
        let bound = bound.iter().map(|(buffer, _)| buffer.as_entire_binding());
        let entries: Vec<_> = std::iter::once(wgpu::BindingResource::Buffer(params))
            .chain(bound)
            .zip(0u32..)
            .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        let layout = &compiled.layout;
        let descriptor = wgpu::BindGroupDescriptor { label: Some(name), layout, entries: &entries };
        let bindings = gpu.validated(name, || gpu.device.create_bind_group(&descriptor))?;
        Ok(Self { name: pass_of(name), compiled, bindings, groups, frames: shader.frames })
    }

    /// Records the pass with the uniforms of `batch`.
    pub(crate) fn record(&self, encoder: &mut wgpu::ComputePass<'_>, batch: u32) {
        self.record_at(encoder, batch * self.frames * PARAMS_STRIDE as u32);
    }

    /// Records the pass for the first `frames` of the frames that it makes at once.
    pub(super) fn record_frames(&self, encoder: &mut wgpu::ComputePass<'_>, frames: u32) {
        let [x, y, _] = self.groups;
        self.dispatch(encoder, 0, [x, y, frames]);
    }

    /// Records the pass with the parameters at an offset, bytes.
    pub(super) fn record_at(&self, encoder: &mut wgpu::ComputePass<'_>, offset: u32) {
        self.dispatch(encoder, offset, self.groups);
    }

    fn dispatch(&self, encoder: &mut wgpu::ComputePass<'_>, offset: u32, [x, y, z]: [u32; 3]) {
        encoder.set_pipeline(&self.compiled.pipeline);
        encoder.set_bind_group(0, &self.bindings, &[offset]);
        encoder.dispatch_workgroups(x, y, z);
    }
}
