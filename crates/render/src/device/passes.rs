//! Compiled passes, cached by shader and overrides, and their bindings.

use std::borrow::Cow;
use std::sync::Arc;

use super::buffers::{Buffers, PARAMS_STRIDE};
use super::gpu::Gpu;
use super::several::source_of_frames;
use super::shaders::{Shader, ShaderSet, declaration};
use crate::error::BackendError;
use crate::params::Params;

/// Names and values of the overrides that specialise a shader.
pub(crate) type Constants<'a> = &'a [(&'static str, f64)];

/// A shader with its specialisation.
#[derive(Debug, Clone)]
pub(super) struct Specialised<'a> {
    pub(super) shader: Shader,
    pub(super) constants: Constants<'a>,
    /// Number of frames that one dispatch makes.
    pub(super) frames: u32,
    /// Binding numbers of the buffers that have a part per frame.
    pub(super) parts: Vec<u32>,
}

/// A compiled pass, without bindings.
#[derive(Debug)]
struct Compiled {
    shader: Shader,
    constants: Vec<(&'static str, f64)>,
    frames: u32,
    layout: wgpu::BindGroupLayout,
    pipeline: wgpu::ComputePipeline,
}

/// All passes compiled so far. A compiled pass depends only on its shader, overrides, and number of frames.
#[derive(Debug)]
pub(crate) struct Pipelines {
    shaders: ShaderSet,
    compiled: Vec<Arc<Compiled>>,
    /// Number of compiled passes at the last call of `take_cold`.
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

    /// Whether passes are specialised for a software device.
    pub(crate) fn in_software(&self, gpu: &Gpu) -> bool {
        gpu.is_software() && !self.shaders.as_gpu
    }

    /// Largest segment buffer, bytes.
    pub(crate) fn segment_bytes_max(&self, gpu: &Gpu) -> u64 {
        self.shaders.segment_bytes_max.unwrap_or_else(|| gpu.segment_bytes_max())
    }

    /// Whether passes were compiled since the last call.
    pub(crate) fn take_cold(&mut self) -> bool {
        let cold = self.warm < self.compiled.len();
        self.warm = self.compiled.len();
        cold
    }

    /// The compiled pass of a specialised shader, which has `buffers` bindings after its parameters. Compiles it at the
    /// first call.
    fn get(&mut self, gpu: &Gpu, specialised: &Specialised<'_>, buffers: u32) -> Result<Arc<Compiled>, BackendError> {
        let Specialised { shader, constants, frames, .. } = *specialised;
        let is_it = |c: &&Arc<Compiled>| c.shader == shader && c.constants == constants && c.frames == frames;
        if let Some(known) = self.compiled.iter().find(is_it) {
            return Ok(known.clone());
        }
        let compiled = gpu.validated(shader.label(), || compile(&gpu.device, &self.shaders, specialised, buffers))?;
        let compiled = Arc::new(compiled);
        self.compiled.push(compiled.clone());
        Ok(compiled)
    }
}

fn compile(device: &wgpu::Device, shaders: &ShaderSet, specialised: &Specialised<'_>, buffers: u32) -> Compiled {
    let Specialised { shader, constants, frames, ref parts } = *specialised;
    let label = Some(shader.label());
    let source = shaders.source(shader);
    let entries: Vec<_> = (0..=buffers).map(|binding| layout_entry(source, binding)).collect();
    let source: Cow<'_, str> = if frames > 1 { source_of_frames(source, parts, frames).into() } else { source.into() };
    let descriptor = wgpu::ShaderModuleDescriptor { label, source: wgpu::ShaderSource::Wgsl(source) };
    let checks = wgpu::ShaderRuntimeChecks {
        bounds_checks: shaders.bounds_checks,
        force_loop_bounding: false,
        ..wgpu::ShaderRuntimeChecks::checked()
    };
    // SAFETY: Every index is bounded by the counts that sized the buffers (`Params`, `Tables`), every loop by such a
    // count or a constant; `check_scene` has checked every index of the scene. Checks cost time on every read.
    let module = unsafe { device.create_shader_module_trusted(descriptor, checks) };
    let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
    let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(&layout)],
        immediate_size: 0,
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label,
        layout: Some(&pipeline_layout),
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions { constants, zero_initialize_workgroup_memory: true },
        cache: None,
    });
    Compiled { shader, constants: constants.to_vec(), frames, layout, pipeline }
}

/// Layout of a binding, as the source declares it. Binding 0, the parameters, has a dynamic offset.
fn layout_entry(source: &str, binding: u32) -> wgpu::BindGroupLayoutEntry {
    let space = declaration(source, binding).map_or("", |(space, _)| space);
    let ty = match space {
        "uniform" => wgpu::BufferBindingType::Uniform,
        space => wgpu::BufferBindingType::Storage { read_only: space != "storage, read_write" },
    };
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: binding == 0, min_binding_size: None },
        count: None,
    }
}

/// A compiled pass with the bindings and workgroups of one configuration.
#[derive(Debug)]
pub(crate) struct Pass {
    compiled: Arc<Compiled>,
    bindings: wgpu::BindGroup,
    groups: [u32; 3],
}

impl Pass {
    /// Makes a pass that binds a frame's parameters, then the buffers `bound`.
    ///
    /// # Errors
    /// As [`Pass::bound`].
    pub(super) fn of_frame(
        gpu: &Gpu,
        pipelines: &mut Pipelines,
        buffers: &Buffers,
        shader: Shader,
        groups: [u32; 3],
        constants: Constants<'_>,
        bound: &[&wgpu::Buffer],
    ) -> Result<Self, BackendError> {
        let frames = buffers.frames;
        let parts = bound.iter().zip(1..).filter(|(buffer, _)| buffers.is_written(buffer)).map(|(_, binding)| binding);
        let specialised = Specialised { shader, constants, frames, parts: parts.collect() };
        let size = size_of::<Params>() * frames as usize;
        Self::bound(gpu, pipelines, (&buffers.params, size), &specialised, groups, bound)
    }

    /// Makes a pass that binds `size` bytes of the buffer `params`, then the buffers `bound`.
    ///
    /// # Errors
    /// More workgroups than the device can dispatch, or a shader that it refuses.
    pub(super) fn bound(
        gpu: &Gpu,
        pipelines: &mut Pipelines,
        (params, size): (&wgpu::Buffer, usize),
        specialised: &Specialised<'_>,
        groups: [u32; 3],
        bound: &[&wgpu::Buffer],
    ) -> Result<Self, BackendError> {
        let name = specialised.shader.label();
        let offered = gpu.device.limits().max_compute_workgroups_per_dimension;
        for needed in groups {
            gpu.check_limit(name, needed.into(), "workgroups a dispatch", offered.into())?;
        }
        let compiled = pipelines.get(gpu, specialised, bound.len() as u32)?;
        let params = wgpu::BufferBinding { buffer: params, offset: 0, size: wgpu::BufferSize::new(size as u64) };
        let bound = bound.iter().map(|buffer| buffer.as_entire_binding());
        let entries: Vec<_> = std::iter::once(wgpu::BindingResource::Buffer(params))
            .chain(bound)
            .zip(0u32..)
            .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        let layout = &compiled.layout;
        let descriptor = wgpu::BindGroupDescriptor { label: Some(name), layout, entries: &entries };
        let bindings = gpu.validated(name, || gpu.device.create_bind_group(&descriptor))?;
        Ok(Self { compiled, bindings, groups })
    }

    /// Shader of the pass.
    pub(super) fn shader(&self) -> Shader {
        self.compiled.shader
    }

    /// Whether the pass has this shader, these workgroups and these overrides.
    pub(super) fn is(&self, shader: Shader, groups: [u32; 3], constants: Constants<'_>) -> bool {
        self.compiled.shader == shader && self.groups == groups && self.compiled.constants == constants
    }

    /// Records the pass with the uniforms of batch `batch`.
    pub(crate) fn record(&self, encoder: &mut wgpu::ComputePass<'_>, batch: u32) {
        self.record_at(encoder, batch * self.compiled.frames * PARAMS_STRIDE as u32);
    }

    /// Records the pass for the first `frames` of the frames that it can make at once.
    pub(super) fn record_frames(&self, encoder: &mut wgpu::ComputePass<'_>, frames: u32) {
        let [x, y, _] = self.groups;
        self.dispatch(encoder, 0, [x, y, frames]);
    }

    /// Records the pass with the parameters at `offset`, bytes.
    pub(super) fn record_at(&self, encoder: &mut wgpu::ComputePass<'_>, offset: u32) {
        self.dispatch(encoder, offset, self.groups);
    }

    fn dispatch(&self, encoder: &mut wgpu::ComputePass<'_>, offset: u32, [x, y, z]: [u32; 3]) {
        encoder.set_pipeline(&self.compiled.pipeline);
        encoder.set_bind_group(0, &self.bindings, &[offset]);
        encoder.dispatch_workgroups(x, y, z);
    }
}
