//! Compiled passes, cached by their specialisation, and their bindings.

use std::borrow::Cow;
use std::sync::Arc;

use super::buffers::{Buffers, PARAMS_STRIDE};
use super::gpu::Gpu;
use super::several::source_of_frames;
use super::shaders::{Shader, ShaderSet, declaration};
use crate::error::BackendError;
use crate::params::Params;

/// Overrides that specialise a shader, and their values.
pub(crate) type Constants<'a> = &'a [(&'static str, f64)];

/// A shader, and what specialises it.
#[derive(Debug, Clone)]
pub(super) struct Specialised<'a> {
    pub(super) shader: Shader,
    pub(super) constants: Constants<'a>,
    /// Frames that a dispatch makes.
    pub(super) frames: u32,
    /// Bindings of buffers with a part for each frame.
    pub(super) parts: Vec<u32>,
}

/// A compiled pass.
#[derive(Debug)]
struct Compiled {
    shader: Shader,
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

    /// The compiled pass of a specialised shader with this number of `buffers` after its parameters. Compiles it once.
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
    // SAFETY: every index is bounded by the counts that the buffers were sized from (`Params`, `Tables`), every loop by
    // such a count or a constant; `check_scene` has checked every index of the scene. Checks cost time on every read.
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

/// Layout of a binding as the source declares it. The parameters, which are the first, have an offset.
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

/// A compiled pass with its bindings in one configuration.
#[derive(Debug)]
pub(crate) struct Pass {
    compiled: Arc<Compiled>,
    bindings: wgpu::BindGroup,
    groups: [u32; 3],
}

impl Pass {
    /// A pass of a frame. It binds the frame's parameters, then `bound`.
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

    /// A pass that binds its parameters, which take `size` bytes of a buffer, then `bound`.
    ///
    /// # Errors
    /// More workgroups than the device takes, or a shader that it refuses.
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

    /// Whether the pass dispatches these workgroups of a shader with these overrides.
    pub(super) fn is(&self, shader: Shader, groups: [u32; 3], constants: Constants<'_>) -> bool {
        self.compiled.shader == shader && self.groups == groups && self.compiled.constants == constants
    }

    /// Records the pass with the uniforms of `batch`.
    pub(crate) fn record(&self, encoder: &mut wgpu::ComputePass<'_>, batch: u32) {
        self.record_at(encoder, batch * self.compiled.frames * PARAMS_STRIDE as u32);
    }

    /// Records the pass for the first `frames` of those that it makes at once.
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
