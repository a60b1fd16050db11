//! The pass `trace` in both ways: source, workgroups and overrides.

use insonify_core::settings::Effect;

use super::gpu::Gpu;
use super::shaders::{TRACE, TRACE_BY_LANES};
use crate::configuration::FrameInputs;
use crate::constants::PATH_LANES;
use crate::trace_by::TraceBy;

/// Threads of a workgroup.
const GROUP: u32 = 64;

/// A dispatch of `trace`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TraceDispatch {
    pub(super) source: &'static str,
    pub(super) groups: [u32; 3],
    pub(super) constants: [(&'static str, f64); 7],
}

impl TraceDispatch {
    /// The dispatch of the first `paths`, `copies` times over: the same ones, or those of as many frames.
    pub(super) fn new(gpu: &Gpu, inputs: FrameInputs<'_>, by: TraceBy, paths: u32, copies: u32) -> Self {
        let all = paths.saturating_mul(copies);
        // Lanes of very many paths are more than a dispatch takes.
        let offered = u64::from(gpu.device.limits().max_compute_workgroups_per_dimension) * u64::from(GROUP);
        let fits = u64::from(paths) * u64::from(PATH_LANES * gpu.paths_apart(all)) <= offered;
        let by = if fits { by } else { TraceBy::Path };
        let (source, lanes, apart) = match by {
            TraceBy::Path => (TRACE, 1, gpu.lanes_apart(all)),
            TraceBy::Lanes => (TRACE_BY_LANES, PATH_LANES, gpu.paths_apart(all)),
        };
        let on = inputs.configuration.effects.effects();
        let flag = |on: bool| f64::from(u8::from(on));
        let constants = [
            ("LANES_APART", f64::from(apart)),
            ("MOVING", flag(inputs.media.moving && on.has(Effect::Motion))),
            ("REFRACTION", flag(on.has(Effect::Refraction))),
            ("INTERFACE_ECHOES", flag(on.has(Effect::InterfaceEchoes))),
            ("ROUGHNESS", flag(on.has(Effect::Roughness))),
            ("REFLECTIONS", flag(on.has(Effect::Reflections))),
            ("APERTURE", flag(on.has(Effect::Aperture))),
        ];
        Self { source, groups: [(paths * lanes * apart).div_ceil(GROUP), 1, copies], constants }
    }
}
