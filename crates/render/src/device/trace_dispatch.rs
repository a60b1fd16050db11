//! The pass `trace` by threads or by lanes: shader, workgroups, overrides and buffers.

use insonify_core::settings::Effect;

use super::buffers::{Buffers, SceneBuffers};
use super::gpu::Gpu;
use super::shaders::Shader;
use crate::configuration::FrameInputs;
use crate::constants::PATH_LANES;
use crate::trace_by::TraceBy;

/// Threads of a workgroup.
const GROUP: u32 = 64;

/// A dispatch of `trace`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TraceDispatch {
    pub(super) shader: Shader,
    pub(super) groups: [u32; 3],
    pub(super) constants: [(&'static str, f64); 7],
}

impl TraceDispatch {
    /// Dispatch for the first `paths` paths, `copies` times: one copy per frame, or repetitions to measure times.
    pub(super) fn new(gpu: &Gpu, inputs: FrameInputs<'_>, by: TraceBy, paths: u32, copies: u32) -> Self {
        let all = paths.saturating_mul(copies);
        // With very many paths, lanes would need more workgroups than a dispatch may have.
        let offered = u64::from(gpu.device.limits().max_compute_workgroups_per_dimension) * u64::from(GROUP);
        let fits = u64::from(paths) * u64::from(PATH_LANES * gpu.paths_apart(all)) <= offered;
        let by = if fits { by } else { TraceBy::Path };
        let (shader, lanes, apart) = match by {
            TraceBy::Path => (Shader::Trace, 1, gpu.lanes_apart(all)),
            TraceBy::Lanes => (Shader::TraceByLanes, PATH_LANES, gpu.paths_apart(all)),
        };
        let on = inputs.configuration.effects.effects();
        let constants = [
            ("LANES_APART", f64::from(apart)),
            ("MOVING", f64::from(inputs.media.moving && on.has(Effect::Motion))),
            ("REFRACTION", f64::from(on.has(Effect::Refraction))),
            ("INTERFACE_ECHOES", f64::from(on.has(Effect::InterfaceEchoes))),
            ("ROUGHNESS", f64::from(on.has(Effect::Roughness))),
            ("REFLECTIONS", f64::from(on.has(Effect::Reflections))),
            ("APERTURE", f64::from(on.has(Effect::Aperture))),
        ];
        Self { shader, groups: [(paths * lanes * apart).div_ceil(GROUP), 1, copies], constants }
    }

    /// Buffers that the pass binds after the frame's parameters, in order.
    pub(super) fn buffers<'a>(scene: &'a SceneBuffers, buffers: &'a Buffers) -> [&'a wgpu::Buffer; 14] {
        [
            &scene.nodes,
            &scene.triangles,
            &scene.surface_tissue,
            &buffers.rays,
            &buffers.starts_inside,
            &buffers.overflows,
            &buffers.tissues,
            &buffers.starts,
            &buffers.segments,
            &buffers.echoes,
            &buffers.segment_counts,
            &buffers.hints,
            &scene.displacements,
            &buffers.couplings,
        ]
    }
}
