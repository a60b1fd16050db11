//! Passes of a frame on the device, in order, each with its buffers.
//!
//! Read [`build_frame`] from top to bottom. A pass binds the frame's parameters, then its buffers in the order of the
//! shader's bindings. The shader declares which buffers it writes.

use std::mem;
use std::sync::Arc;

use insonify_core::settings::Effect;

use super::buffers::{Buffers, SceneBuffers};
use super::gpu::Gpu;
use super::passes::{Constants, Pass, Pipelines};
use super::shaders::Shader::{self, *};
use super::trace_dispatch::TraceDispatch;
use crate::batch_plan::BatchPlan;
use crate::configuration::{Configuration, FrameInputs};
use crate::constants::BEAM_CELLS_OF_A_GROUP;
use crate::error::BackendError;
use crate::frame::Contents;

/// A pass, to be dispatched with the uniforms of one batch.
#[derive(Debug)]
pub(super) struct Dispatch {
    pub(super) pass: Arc<Pass>,
    pub(super) batch: u32,
}

/// Dispatches for each kind of frame: with image and maps, with one of them, or with neither.
#[derive(Debug)]
pub(super) struct Frames {
    whole: Vec<Dispatch>,
    image: Vec<Dispatch>,
    maps: Vec<Dispatch>,
    /// Dispatches of a frame with neither image nor maps.
    empty: Vec<Dispatch>,
}

impl Frames {
    /// Makes all passes of a configuration.
    ///
    /// # Errors
    /// A pass that exceeds the device's limits, or that the device refuses.
    pub(super) fn new(
        gpu: &Gpu,
        pipelines: &mut Pipelines,
        scene: &SceneBuffers,
        buffers: &Buffers,
        batches: BatchPlan,
        inputs: FrameInputs<'_>,
    ) -> Result<Self, BackendError> {
        let (passes, dispatches) = (Vec::new(), Vec::new());
        let mut builder = FrameBuilder { gpu, pipelines, scene, buffers, batches, passes, dispatches };
        let mut frame = |image: bool, maps: bool| {
            build_frame(&mut builder, inputs, Contents { image, maps })?;
            Ok::<_, BackendError>(mem::take(&mut builder.dispatches))
        };
        Ok(Self {
            whole: frame(true, true)?,
            image: frame(true, false)?,
            maps: frame(false, true)?,
            empty: frame(false, false)?,
        })
    }

    /// Dispatches of a frame with these contents, in order.
    pub(super) fn of(&self, contents: Contents) -> &[Dispatch] {
        match (contents.image, contents.maps) {
            (true, true) => &self.whole,
            (true, false) => &self.image,
            (false, true) => &self.maps,
            (false, false) => &self.empty,
        }
    }
}

/// Collects the dispatches of a frame. Frames of a configuration share passes.
struct FrameBuilder<'a> {
    gpu: &'a Gpu,
    pipelines: &'a mut Pipelines,
    scene: &'a SceneBuffers,
    buffers: &'a Buffers,
    batches: BatchPlan,
    /// Passes created so far. Frames of this configuration share them.
    passes: Vec<Arc<Pass>>,
    dispatches: Vec<Dispatch>,
}

impl FrameBuilder<'_> {
    /// Appends a dispatch with the uniforms of batch `batch`.
    fn run(
        &mut self,
        shader: Shader,
        batch: u32,
        groups: [u32; 3],
        constants: Constants<'_>,
        bound: &[&wgpu::Buffer],
    ) -> Result<(), BackendError> {
        let pass = self.pass(shader, groups, constants, bound)?;
        self.dispatches.push(Dispatch { pass, batch });
        Ok(())
    }

    /// Inserts a dispatch at index `position`, or at the end if there are fewer dispatches.
    fn insert(
        &mut self,
        position: usize,
        shader: Shader,
        groups: [u32; 3],
        constants: Constants<'_>,
        bound: &[&wgpu::Buffer],
    ) -> Result<(), BackendError> {
        let pass = self.pass(shader, groups, constants, bound)?;
        self.dispatches.insert(position.min(self.dispatches.len()), Dispatch { pass, batch: 0 });
        Ok(())
    }

    /// The pass with these workgroups and overrides; it is made at the first call.
    fn pass(
        &mut self,
        shader: Shader,
        groups: [u32; 3],
        constants: Constants<'_>,
        bound: &[&wgpu::Buffer],
    ) -> Result<Arc<Pass>, BackendError> {
        if let Some(known) = self.passes.iter().find(|pass| pass.is(shader, groups, constants)) {
            return Ok(known.clone());
        }
        let pass = Pass::of_frame(self.gpu, self.pipelines, self.buffers, shader, groups, constants, bound)?;
        let pass = Arc::new(pass);
        self.passes.push(pass.clone());
        Ok(pass)
    }
}

/// Splits a number of workgroups into rows short enough for every device.
fn in_rows(groups: u32) -> [u32; 3] {
    const ROW: u32 = 1 << 15;
    [groups.min(ROW), groups.div_ceil(ROW), 1]
}

/// Lists the dispatches of a frame with these contents. `b` are the frame's buffers, `a` the aperture's.
#[rustfmt::skip]
fn build_frame(frame: &mut FrameBuilder<'_>, inputs: FrameInputs<'_>, contents: Contents) -> Result<(), BackendError> {
    let FrameBuilder { gpu, scene, buffers: b, batches: plan, .. } = *frame;
    let Configuration { settings, effects, params, tables, .. } = inputs.configuration;
    let (on, in_software) = (effects.effects(), frame.pipelines.in_software(gpu));
    let (a, needle) = (&b.aperture, &b.needle);
    let has_needle = on.has(Effect::Needle);
    let (largest, last, midway) = (plan.params(0, params), plan.batches - 1, params.levels_per_sample == 2);
    let samples_by = |run: u32| [params.row_samples.div_ceil(64 * run), params.scanlines, 1];
    let aperture = ("APERTURE", f64::from(on.has(Effect::Aperture)));

    // Paths of a batch: surfaces around their starts and coupling of the face, then the segments.
    let paths = largest.paths();
    let apart = gpu.lanes_apart(paths * b.frames);
    let trace = TraceDispatch::new(gpu, inputs, gpu.trace_by(paths * b.frames), paths, b.frames);
    let trace_batch = |frame: &mut FrameBuilder<'_>, batch: u32| {
        frame.run(Locate, batch, [(paths * apart).div_ceil(64), 1, 1], &[("LANES_APART", apart.into())],
            &[&scene.nodes, &scene.triangles, &scene.surface_tissue, &b.rays, &b.starts_inside, &b.overflows,
                &b.couplings])?;
        frame.run(trace.shader, batch, trace.groups, &trace.constants, &TraceDispatch::buffers(scene, b))
    };
    if contents.image {
        // Aperture gain and beam profile of each scanline, which depend on the paths of all batches.
        if let Some(t) = &tables.aperture {
            let (planes, cells, beams) = (t.planes as u32, t.sampling.cells as u32, t.sampling.beams as u32);
            // Transmission and delay of each cell of each depth plane, and the loss that a plane's cells share.
            let transmission =
                [&b.starts, &b.segments, &a.shape, &a.cell_rays, &a.mask, &a.row_np, &b.rays, &a.partial_sums];
            for batch in 0..plan.batches {
                trace_batch(frame, batch)?;
                frame.run(Transmission, batch, [planes, cells.div_ceil(64), 1], &[("ROWS", 0.0)], &transmission)?;
            }
            frame.run(Transmission, last, [planes, 1, 1], &[("ROWS", 1.0)], &transmission)?;
            if has_needle {
                frame.run(NeedleShadow, last, [(2 * cells).div_ceil(64), 1, 1], &[], &[&needle.shadows, &a.mask])?;
            }
            // Fields of the modes (waves along the face) in each depth plane, amplitudes of the beams that they sum to,
            // and the beams' profiles.
            frame.run(Propagate, last, [t.modes.len() as u32, 1, 1], &[],
                &[&a.shape, &a.modes, &a.face, &a.steps, &a.mask, &a.fields])?;
            frame.run(Beams, last, [cells * beams / BEAM_CELLS_OF_A_GROUP, planes, 1], &[],
                &[&a.shape, &a.modes, &a.beam_parts, &a.fields, &a.amplitudes])?;
            frame.run(Profiles, last, [cells.max(params.scanlines).div_ceil(64), planes, 1], &[],
                &[&a.shape, &a.line_cells, &a.reaches, &a.unobstructed, &b.lateral_kernels, &a.amplitudes,
                    &a.beam_powers, &a.profiles, &a.blends])?;
            // Gain along each scanline.
            frame.run(Visibility, last, [params.scanlines.div_ceil(16), 1, 1], &[],
                &[&b.starts, &b.segments, &a.shape, &a.line_cells, &a.beam_powers, &a.row_np, &a.line_gains,
                    &a.block_gains])?;
        }
        // Baseband of each scanline: scatterers and interface echoes, added up over the batches.
        for batch in 0..plan.batches {
            // After the aperture's passes, only the paths of the last batch are in memory.
            if tables.aperture.is_none() || plan.batches > 1 {
                trace_batch(frame, batch)?;
            }
            if on.has(Effect::Scatterers) {
                let elevational = ("ELEVATIONAL_SPECKLE", f64::from(on.has(Effect::ElevationalSpeckle)));
                let constants = [aperture, elevational, ("TEXTURE", f64::from(on.has(Effect::Texture)))];
                frame.run(March, batch, [samples_by(8)[0], largest.line_count, 1], &constants,
                    &[&b.starts, &b.segments, &b.hints, &b.scatterer_gain, &b.baseband, &b.kept_powers, &a.shape,
                        &a.line_gains, &b.sheet_reach, &b.textures, &a.reflected])?;
            }
            if on.has(Effect::InterfaceEchoes) {
                let lines = largest.line_count;
                let (shader, groups) = if in_software { (EchoByLine, lines.div_ceil(16)) } else { (Echo, lines) };
                frame.run(shader, batch, [groups, 1, 1], &[aperture, ("BETWEEN", f64::from(midway))],
                    &[&b.starts, &b.segments, &b.echoes, &b.segment_counts, &a.shape, &a.line_gains, &b.baseband,
                        &b.delays])?;
            }
        }
    }
    if contents.maps { insert_maps(frame, inputs)?; }
    // Image: lateral point-spread function, what is added to the lines, then pulse, envelope and log compression.
    if contents.image {
        let steered = tables.angles.iter().any(|angle| angle.steer_rad != 0.0);
        frame.run(Lateral, last, samples_by(4), &[aperture, ("STEERED", f64::from(steered))],
            &[&b.lateral_kernels, &b.baseband, &b.focused, &a.block_gains, &a.shape, &a.profiles, &a.blends,
                &b.kernel_spans, &a.reflected])?;
        if has_needle { add_needle_echo(frame, inputs, last, aperture)?; }
        if params.face_reflection > 0.0 {
            frame.run(Multiples, last, [params.scanlines, 1, 1], &[], &[&b.again, &b.focused])?;
        }
        if params.receives() {
            frame.run(Receive, last, samples_by(2), &[], &[&b.starts, &b.segments, &b.near_field, &b.focused])?;
        }
        // A thread makes eight grey levels.
        let constants = [("KEEP_LINES", f64::from(settings.lines)), ("MIDWAY", f64::from(midway))];
        frame.run(Detect, last, samples_by(if midway { 4 } else { 8 }), &constants,
            &[&b.pulse, &b.focused, &b.polar, &b.lines])?;
    }
    // From scanlines to pixels.
    frame.run(ScanConvert, last, [params.sector_words.div_ceil(128), 1, 1], &[("MAPS", f64::from(contents.maps))],
        &[&b.pixels, &b.polar, &b.raster, &b.percentile, &b.tissues, &b.bmode, &b.segmentation, &b.attenuation,
            &b.sector_words])?;
    if has_needle && contents.maps {
        frame.run(NeedleMap, last, [params.image.height.div_ceil(64), 1, 1], &[],
            &[&needle.outline, &b.segmentation])?;
    }
    Ok(())
}

/// Inserts the passes of the maps: the media along each map ray, their raster, and the percentile of the attenuation. Maps
/// don't depend on paths. Each pass is inserted after a pass that leaves most of a GPU idle.
#[rustfmt::skip]
fn insert_maps(frame: &mut FrameBuilder<'_>, inputs: FrameInputs<'_>) -> Result<(), BackendError> {
    let FrameBuilder { gpu, scene, buffers: b, .. } = *frame;
    let (in_software, params) = (frame.pipelines.in_software(gpu), &inputs.configuration.params);
    let apart = gpu.lanes_apart(params.map_rays);
    // On a GPU, neighbouring threads write neighbouring words. In software, a thread writes many words, since each
    // thread first has to search.
    let depths = if in_software { 64 } else { 1 };
    let section = [&scene.nodes, &scene.triangles, &scene.surface_tissue, &b.map_rays, &b.tissues, &b.entries,
        &b.entry_counts, &b.map_overflows, &b.raster];
    let raster = in_rows((params.map_rays * params.map_depths.div_ceil(depths)).div_ceil(32));
    frame.insert(2, Section, [(params.map_rays * apart).div_ceil(32), 1, 1], &[("LANES_APART", apart.into())],
        &section)?;
    frame.insert(4, Section, raster, &[("RASTER", 1.0), ("DEPTHS", depths.into())], &section)?;
    frame.insert(5, Percentile, [1, 1, 1], &[], &[&b.entries, &b.entry_counts, &b.percentile])?;
    Ok(())
}

/// Adds the pass that adds the needle's echoes to the focused lines.
#[rustfmt::skip]
fn add_needle_echo(
    frame: &mut FrameBuilder<'_>,
    inputs: FrameInputs<'_>,
    last: u32,
    aperture: (&'static str, f64),
) -> Result<(), BackendError> {
    let (b, params) = (frame.buffers, &inputs.configuration.params);
    let constants = [aperture, ("BETWEEN", f64::from(params.levels_per_sample == 2))];
    frame.run(NeedleEcho, last, [params.scanlines.div_ceil(16), 1, 1], &constants,
        &[&b.starts, &b.segments, &b.needle.starts, &b.needle.echoes, &b.aperture.shape, &b.aperture.line_gains,
            &b.focused, &b.delays])
}
