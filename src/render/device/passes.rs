//! Compiled passes, cached by their specialisation, and their bindings.

use std::sync::Arc;

use super::buffers::{Binding, Buffers, PARAMS_STRIDE, SceneBuffers};
use super::gpu::Gpu;
use super::shaders::ShaderSet;
use crate::render::error::BackendError;
use crate::render::params::Params;

/// Overrides that specialise a shader, and their values.
pub(crate) type Constants<'a> = &'a [(&'static str, f64)];

/// A compiled pass.
#[derive(Debug)]
struct Compiled {
    name: &'static str,
    constants: Vec<(&'static str, f64)>,
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

    /// The pass `name`, compiled if it wasn't yet; `bound` lists its buffers after the parameters.
    fn get(
        &mut self,
        gpu: &Gpu,
        name: &'static str,
        constants: Constants<'_>,
        bound: &[(&wgpu::Buffer, Binding)],
    ) -> Result<Arc<Compiled>, BackendError> {
        if let Some(known) = self.compiled.iter().find(|c| c.name == name && c.constants == constants) {
            return Ok(known.clone());
        }
        let compiled = gpu.validated(name, || compile(&gpu.device, &self.shaders, name, constants, bound))?;
        let compiled = Arc::new(compiled);
        self.compiled.push(compiled.clone());
        Ok(compiled)
    }
}

fn compile(
    device: &wgpu::Device,
    shaders: &ShaderSet,
    name: &'static str,
    constants: Constants<'_>,
    bound: &[(&wgpu::Buffer, Binding)],
) -> Compiled {
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
    Compiled { name, constants: constants.to_vec(), layout, pipeline }
}

/// A compiled pass with its bindings in one configuration.
#[derive(Debug)]
pub(crate) struct Pass {
    pub(crate) name: &'static str,
    compiled: Arc<Compiled>,
    bindings: wgpu::BindGroup,
    groups: [u32; 3],
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
        let offered = gpu.device.limits().max_compute_workgroups_per_dimension;
        for needed in groups {
            gpu.check_limit(name, needed.into(), "workgroups a dispatch", offered.into())?;
        }
        let (scene, buffers) = buffers;
        let bound = buffers.of_pass(scene, name);
        let compiled = pipelines.get(gpu, name, constants, &bound)?;
        let params = wgpu::BufferBinding {
            buffer: &buffers.params,
            offset: 0,
            size: wgpu::BufferSize::new(size_of::<Params>() as u64),
        };
        let bound = bound.iter().map(|(buffer, _)| buffer.as_entire_binding());
        let entries: Vec<_> = std::iter::once(wgpu::BindingResource::Buffer(params))
            .chain(bound)
            .zip(0u32..)
            .map(|(resource, binding)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        let layout = &compiled.layout;
        let descriptor = wgpu::BindGroupDescriptor { label: Some(name), layout, entries: &entries };
        let bindings = gpu.validated(name, || gpu.device.create_bind_group(&descriptor))?;
        Ok(Self { name, compiled, bindings, groups })
    }

    /// Records the pass with the uniforms of `batch`.
    pub(crate) fn record(&self, encoder: &mut wgpu::ComputePass<'_>, batch: u32) {
        encoder.set_pipeline(&self.compiled.pipeline);
        encoder.set_bind_group(0, &self.bindings, &[batch * PARAMS_STRIDE as u32]);
        encoder.dispatch_workgroups(self.groups[0], self.groups[1], self.groups[2]);
    }
}
