//! Buffers, passes and read-back slots of one configuration on the device.

use std::sync::Arc;

use insonify_core::settings::Effect;

use super::buffers::{Buffers, SceneBuffers};
use super::gpu::Gpu;
use super::passes::{Constants, Pass, Pipelines};
use super::readback::{Shape, Slot, takes};
use super::shaders::{ECHO, ECHO_BY_LINE};
use super::trace_dispatch::TraceDispatch;
use crate::batch_plan::{BatchPlan, SEGMENT_BYTES_LEAST};
use crate::configuration::{Configuration, FrameInputs};
use crate::constants::BEAM_CELLS_OF_A_GROUP;
use crate::error::BackendError;
use crate::frame::{Contents, FRAMES_IN_FLIGHT};
use crate::params::Params;

/// Buffers and passes of one configuration.
#[derive(Debug)]
pub(super) struct DeviceConfiguration {
    pub(super) batches: BatchPlan,
    pub(super) buffers: Buffers,
    passes: Vec<Pass>,
    /// Index in `passes`, and batch, of each dispatch of a frame with maps.
    order: Vec<(usize, u32)>,
    /// The last of `passes` for frames without maps.
    scan_convert_image: Pass,
    pub(super) slots: Vec<Arc<Slot>>,
}

impl DeviceConfiguration {
    /// A configuration whose dispatches make `frames` frames. Makes whatever differs from `previous`, and shares the rest with it. `previous` is unchanged until
    /// [`Buffers::fill`].
    ///
    /// # Errors
    /// Sizes beyond the device's limits or memory, or a pass that it refuses.
    pub(super) fn new(
        gpu: &Gpu,
        scene: &SceneBuffers,
        pipelines: &mut Pipelines,
        inputs: FrameInputs<'_>,
        previous: Option<&Self>,
        frames: u32,
    ) -> Result<Self, BackendError> {
        let Configuration { settings, effects, params, tables, .. } = inputs.configuration;
        let on = effects.effects();
        let (batches, buffers) =
            planned(gpu, pipelines.segment_bytes_max(gpu), inputs.configuration, previous, frames)?;
        let largest = batches.params(0, params);

        let in_software = pipelines.in_software(gpu);
        let mut pass = |name, groups, constants: Constants<'_>| {
            Pass::new(gpu, pipelines, (scene, &buffers), name, groups, constants)
        };
        let paths = largest.paths();
        let samples_by = |run: u32| [params.row_samples.div_ceil(64 * run), params.scanlines, 1];
        let pixels = [params.sector_words.div_ceil(128), 1, 1];
        let flag = |on: bool| f64::from(u8::from(on));
        let keep = [("KEEP_LINES", flag(settings.lines))];
        let apart = gpu.lanes_apart(paths * frames);
        let traced_groups = [(paths * apart).div_ceil(64), 1, 1];
        let locate = [("LANES_APART", f64::from(apart))];
        let trace = TraceDispatch::new(gpu, inputs, gpu.trace_by(paths * frames), paths, frames);
        let aperture = [("APERTURE", flag(on.has(Effect::Aperture)))];
        let steered = tables.angles.iter().any(|angle| angle.steer_rad != 0.0);
        let lateral = [aperture[0], ("STEERED", flag(steered))];
        let lines = [params.scanlines.div_ceil(16), 1, 1];
        let cells = tables.aperture.as_ref().map_or(0, |tables| tables.sampling.cells as u32);
        let traced = vec![pass("locate", traced_groups, &locate)?, pass(trace.source, trace.groups, &trace.constants)?];
        let seen = match &tables.aperture {
            Some(tables) => vec![
                pass("transmission", [tables.planes as u32, cells.div_ceil(64), 1], &[("ROWS", 0.0)])?,
                pass("transmission", [tables.planes as u32, 1, 1], &[("ROWS", 1.0)])?,
                pass("propagate", [tables.modes.len() as u32, 1, 1], &[])?,
                pass(
                    "beams",
                    [cells * tables.sampling.beams as u32 / BEAM_CELLS_OF_A_GROUP, tables.planes as u32, 1],
                    &[],
                )?,
                pass("profiles", [cells.max(params.scanlines).div_ceil(64), tables.planes as u32, 1], &[])?,
                pass("visibility", lines, &[])?,
            ],
            None => Vec::new(),
        };
        let mut returned = Vec::new();
        if on.has(Effect::Scatterers) {
            let march = [
                aperture[0],
                ("ELEVATIONAL_SPECKLE", flag(on.has(Effect::ElevationalSpeckle))),
                ("TEXTURE", flag(on.has(Effect::Texture))),
            ];
            returned.push(pass("march", [samples_by(8)[0], largest.line_count, 1], &march)?);
        }
        if on.has(Effect::InterfaceEchoes) {
            let (echo, groups) = match in_software {
                true => (ECHO_BY_LINE, largest.line_count.div_ceil(16)),
                false => (ECHO, largest.line_count),
            };
            returned.push(pass(echo, [groups, 1, 1], &aperture)?);
        }
        let mut order = path_order([traced.len(), seen.len(), returned.len()], batches.batches);
        let mut passes: Vec<Pass> = traced.into_iter().chain(seen).chain(returned).collect();
        // Maps need no paths: each of their passes runs beside one that leaves most of a GPU idle.
        let [cut, raster] = section_passes((gpu, in_software), params, &mut pass)?;
        let map_passes = [cut, raster, pass("percentile", [1, 1, 1], &[])?];
        for (map_pass, place) in map_passes.into_iter().zip([2, 4, 5]) {
            order.insert(place.min(order.len()), (passes.len(), 0));
            passes.push(map_pass);
        }
        // The paths of the last batch are in memory.
        let last_batch = batches.batches - 1;
        let mut image_passes = vec![pass("lateral", samples_by(4), &lateral)?];
        if params.receives() {
            image_passes.push(pass("receive", samples_by(2), &[])?);
        }
        image_passes.push(pass("detect", samples_by(8), &keep)?);
        image_passes.push(pass("scan_convert", pixels, &[("MAPS", 1.0)])?);
        order.extend((passes.len()..passes.len() + image_passes.len()).map(|pass| (pass, last_batch)));
        passes.extend(image_passes);
        let scan_convert_image = pass("scan_convert", pixels, &[("MAPS", 0.0)])?;

        let names = order.iter().map(|&(pass, _)| passes[pass].name).collect();
        let slots = slots(gpu, &Shape::of(params, settings.lines, names), previous, frames)?;
        Ok(Self { batches, buffers, passes, order, scan_convert_image, slots })
    }

    /// The pass before `trace`.
    pub(super) fn locate(&self) -> &Pass {
        &self.passes[0]
    }

    /// Passes of a frame and their batches, in order.
    pub(super) fn passes(&self, contents: Contents) -> impl Iterator<Item = (&Pass, u32)> {
        let all = self.order.iter().map(|&(pass, batch)| (&self.passes[pass], batch));
        all.filter(move |(pass, _)| takes(contents, pass.name)).map(move |(pass, batch)| {
            let image_alone = !contents.maps && pass.name == self.scan_convert_image.name;
            (if image_alone { &self.scan_convert_image } else { pass }, batch)
        })
    }
}

/// Batches of a configuration and its buffers: few large batches, or more of the least size if memory is short.
fn planned(
    gpu: &Gpu,
    segment_bytes_max: u64,
    Configuration { settings, params, tables, .. }: &Configuration,
    previous: Option<&DeviceConfiguration>,
    frames: u32,
) -> Result<(BatchPlan, Buffers), BackendError> {
    let made = |bytes_max: u64| {
        let batches = BatchPlan::within(bytes_max, params);
        let previous = previous.map(|p| &p.buffers);
        let buffers = Buffers::new(gpu, tables, params, &batches, settings.lines, previous, frames)?;
        Ok((batches, buffers))
    };
    match made(segment_bytes_max) {
        Err(BackendError::Memory { .. }) if segment_bytes_max > SEGMENT_BYTES_LEAST => made(SEGMENT_BYTES_LEAST),
        made => made,
    }
}

/// Both dispatches of `section`: the runs of each map ray, and their raster.
fn section_passes(
    (gpu, in_software): (&Gpu, bool),
    params: &Params,
    pass: &mut impl FnMut(&'static str, [u32; 3], Constants<'_>) -> Result<Pass, BackendError>,
) -> Result<[Pass; 2], BackendError> {
    const THREADS: u32 = 32;
    /// Workgroups in a row that every device dispatches.
    const ROW: u32 = 1 << 15;
    let apart = gpu.lanes_apart(params.map_rays);
    // Neighbouring threads of a GPU write neighbouring words. Software searches long for each.
    let depths = if in_software { 64 } else { 1 };
    let groups = (params.map_rays * params.map_depths.div_ceil(depths)).div_ceil(THREADS);
    let rows = [groups.min(ROW), groups.div_ceil(ROW), 1];
    Ok([
        pass("section", [(params.map_rays * apart).div_ceil(THREADS), 1, 1], &[("LANES_APART", f64::from(apart))])?,
        pass("section", rows, &[("RASTER", 1.0), ("DEPTHS", f64::from(depths))])?,
    ])
}

/// Slots of a shape: those of `previous` if they have it.
fn slots(
    gpu: &Gpu,
    shape: &Shape,
    previous: Option<&DeviceConfiguration>,
    frames: u32,
) -> Result<Vec<Arc<Slot>>, BackendError> {
    let count = FRAMES_IN_FLIGHT * frames as usize;
    match previous {
        Some(previous) if previous.slots.len() == count && previous.slots[0].shape() == shape => {
            Ok(previous.slots.clone())
        }
        _ => (0..count).map(|_| Slot::new(gpu, shape).map(Arc::new)).collect(),
    }
}

/// Order of the passes that trace, see and return, numbered in this order, over the batches of a frame.
///
/// The aperture's gain needs the paths of all batches: several batches are traced again before they return. The first of
/// the passes that see is run for every batch, the others once.
fn path_order([traced, seen, returned]: [usize; 3], batches: u32) -> Vec<(usize, u32)> {
    let passes = |range: std::ops::Range<usize>, batch: u32| range.map(move |pass| (pass, batch));
    let (after_trace, after_sight) = (traced + seen, traced + seen + returned);
    let mut order = Vec::new();
    if seen > 0 {
        (0..batches).for_each(|batch| order.extend(passes(0..traced + 1, batch)));
        order.extend(passes(traced + 1..after_trace, batches - 1));
    }
    for batch in 0..batches {
        if seen == 0 || batches > 1 {
            order.extend(passes(0..traced, batch));
        }
        order.extend(passes(after_trace..after_sight, batch));
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batches_are_traced_again_if_the_aperture_sees_them_all_first() {
        let passes = |order: Vec<(usize, u32)>| order.into_iter().map(|(pass, _)| pass).collect::<Vec<_>>();
        assert_eq!(passes(path_order([2, 0, 2], 2)), [0, 1, 2, 3, 0, 1, 2, 3]);
        assert_eq!(passes(path_order([2, 4, 2], 1)), [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(passes(path_order([2, 4, 2], 2)), [0, 1, 2, 0, 1, 2, 3, 4, 5, 0, 1, 6, 7, 0, 1, 6, 7]);
        assert_eq!(path_order([2, 4, 2], 2)[6], (3, 1));
    }
}
