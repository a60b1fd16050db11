//! Frame maker of a device: records the passes, keeps frames in flight, and reads them back.

use std::collections::VecDeque;
use std::mem;
use std::sync::{Arc, mpsc};
use std::time::Instant;

use insonify_core::anatomy::Bvh;
use insonify_core::settings::Effect;

use super::buffers::{PARAMS_STRIDE, SceneBuffers};
use super::configuration::DeviceConfiguration;
use super::dispatches::Dispatch;
use super::gpu::{FRAMES_AT_ONCE_MAX, Gpu};
use super::motion::Motion;
use super::passes::Pipelines;
use super::readback::{Recorded, Slot};
use super::shaders::ShaderSet;
use super::snapshot;
use crate::configuration::FrameInputs;
use crate::error::{BackendError, RenderError};
use crate::frame::{Contents, DeviceTimes, FRAMES_IN_FLIGHT, Frame};
use crate::kept::Kept;
use crate::maker::FrameMaker;
use crate::params::Params;
use crate::snapshot::PassBuffers;

/// Most read-back slots of a configuration. It is a multiple of each configuration's number of slots, so that frames
/// take the slots in turn.
const SLOTS_MAX: usize = FRAMES_IN_FLIGHT * FRAMES_AT_ONCE_MAX as usize;

/// A frame that was submitted and not yet received.
#[derive(Debug)]
struct InFlight {
    slot: Arc<Slot>,
    recorded: Recorded,
    submission: wgpu::SubmissionIndex,
    times: DeviceTimes,
    /// Number of passes that were compiled when the frame was submitted.
    compiled: usize,
}

/// Makes frames on a device.
#[derive(Debug)]
struct DeviceRenderer {
    gpu: Gpu,
    scene: SceneBuffers,
    /// Passes that move the scene; `None` if no part of it moves.
    motion: Option<Motion>,
    pipelines: Pipelines,
    active: DeviceConfiguration,
    /// Buffers and passes of the active configuration for several frames per dispatch; `None` until needed.
    several: Option<DeviceConfiguration>,
    /// Whether every dispatch makes one frame, since one frame keeps the device busy or memory is short.
    alone: bool,
    /// The configurations that are not active.
    kept: Kept<DeviceConfiguration>,
    in_flight: VecDeque<InFlight>,
    next_slot: usize,
    mapped: mpsc::Receiver<Result<(), wgpu::BufferAsyncError>>,
    map_done: mpsc::SyncSender<Result<(), wgpu::BufferAsyncError>>,
    /// Reused memory for the uniforms of all batches.
    uniforms: Vec<u8>,
    /// Number of passes that had been compiled when the last received frame was submitted.
    warm: usize,
}

impl Gpu {
    /// Makes the frame maker for a scene and a configuration.
    ///
    /// # Errors
    /// As [`DeviceRenderer::new`].
    pub(crate) fn maker(
        &self,
        inputs: FrameInputs<'_>,
        shaders: &ShaderSet,
    ) -> Result<Box<dyn FrameMaker>, BackendError> {
        Ok(Box::new(DeviceRenderer::new(self, inputs, shaders)?))
    }
}

impl DeviceRenderer {
    /// Makes a renderer of a scene and a configuration.
    ///
    /// # Errors
    /// A device that fails, is too small or has no memory left.
    fn new(gpu: &Gpu, inputs: FrameInputs<'_>, shaders: &ShaderSet) -> Result<Self, BackendError> {
        let scene = SceneBuffers::new(gpu, &inputs.media.surface_words, inputs.bvh)?;
        let mut pipelines = Pipelines::new(shaders);
        let tables = inputs.bvh.motion_tables();
        let motion = tables.map(|tables| Motion::new(gpu, &scene, &mut pipelines, &tables)).transpose()?;
        gpu.choose_trace(&scene, &mut pipelines, inputs);
        let active = DeviceConfiguration::new(gpu, &scene, &mut pipelines, inputs, None, 1)?;
        let bends = inputs.configuration.effects.effects().has(Effect::Refraction);
        active.buffers.fill(gpu, &inputs.configuration.tables, bends, None);
        let (map_done, mapped) = mpsc::sync_channel(SLOTS_MAX);
        Ok(Self {
            gpu: gpu.clone(),
            scene,
            motion,
            pipelines,
            active,
            several: None,
            alone: false,
            kept: Kept::default(),
            in_flight: VecDeque::with_capacity(SLOTS_MAX),
            next_slot: 0,
            mapped,
            map_done,
            uniforms: Vec::new(),
            warm: 0,
        })
    }

    /// The active configuration for several frames per dispatch, made at the first call. `None` if one frame keeps the
    /// device busy, or memory is short.
    fn several(&mut self, inputs: FrameInputs<'_>) -> Option<&DeviceConfiguration> {
        let batches = self.active.batches;
        if self.several.is_none() && !self.alone && batches.batches == 1 {
            let (gpu, scene, pipelines) = (&self.gpu, &self.scene, &mut self.pipelines);
            let paths = batches.params(0, &inputs.configuration.params).paths();
            let mut frames = gpu.frames_at_once(paths, self.active.buffers.written_bytes());
            while frames > 1 && self.several.is_none() {
                // Tables are shared with the active configuration.
                match DeviceConfiguration::new(gpu, scene, pipelines, inputs, Some(&self.active), frames) {
                    Ok(several) => self.several = Some(several).filter(|several| several.batches.batches == 1),
                    Err(error @ (BackendError::Memory { .. } | BackendError::Limit { .. })) => {
                        tracing::debug!("{frames} frames at once: {error}");
                    }
                    Err(error) => tracing::warn!("frames are made one at a time: {error}"),
                }
                frames /= 2;
            }
            self.alone = self.several.is_none();
        }
        self.several.as_ref()
    }

    /// Starts a frame for each of `params`. `several` chooses the configuration for several frames per dispatch.
    fn submit_to(
        &mut self,
        several: bool,
        inputs: FrameInputs<'_>,
        params: &[Params],
        contents: Contents,
    ) -> Result<(), BackendError> {
        self.gpu.check()?;
        let started = Instant::now();
        let device = if several { self.several.as_ref().unwrap_or(&self.active) } else { &self.active };
        upload_uniforms(&self.gpu, &mut self.uniforms, device, params);
        if let Some(needle) = &inputs.configuration.needle {
            device.buffers.needle.upload(&self.gpu, needle, &mut self.uniforms);
        }
        let mut encoder = begin(&self.gpu, device, inputs);
        let slot = |frame: usize| &device.slots[(self.next_slot + frame) % device.slots.len()];
        let mut timed = Vec::new();
        let mut run = |name, record: &dyn Fn(&mut wgpu::ComputePass<'_>)| {
            let timestamp_writes = slot(0).timestamps(timed.len());
            let descriptor = wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes };
            record(&mut encoder.begin_compute_pass(&descriptor));
            timed.push(name);
        };
        if let Some(motion) = &mut self.motion {
            motion.run(&self.gpu, &mut run);
        }
        let frames = params.len() as u32;
        for Dispatch { pass, batch } in device.frames.of(contents) {
            run(pass.shader().pass(), &|compute| {
                if several { pass.record_frames(compute, frames) } else { pass.record(compute, *batch) }
            });
        }
        // Frames of one dispatch have common times, which the first frame reports.
        let recorded: Vec<_> = (0..frames).map(|_| Recorded { contents, timed: mem::take(&mut timed) }).collect();
        for (recorded, at) in recorded.iter().zip(0u32..) {
            slot(at as usize).record(&mut encoder, &device.buffers, at, recorded);
        }
        let commands = encoder.finish();
        let record_ms = ms_since(started);
        let started = Instant::now();
        let compiled = self.pipelines.count();
        let slots: Vec<Arc<Slot>> = (0..params.len()).map(|frame| slot(frame).clone()).collect();
        let (mapped, map_done) = (slots.clone(), self.map_done.clone());
        let map = move || mapped.iter().for_each(|slot| slot.map(&map_done));
        let submission = self.gpu.submit(commands, compiled > self.warm, map)?;
        let submit_ms = ms_since(started);
        let mut times = DeviceTimes { record_ms, submit_ms, ..DeviceTimes::default() };
        for (slot, recorded) in slots.into_iter().zip(recorded) {
            let (submission, times) = (submission.clone(), mem::take(&mut times));
            self.in_flight.push_back(InFlight { slot, recorded, submission, times, compiled });
        }
        self.next_slot = (self.next_slot + params.len()) % SLOTS_MAX;
        Ok(())
    }

    /// Waits for a frame and copies it out of its slot.
    fn read_back(&mut self, in_flight: &InFlight, frame: &mut Frame) -> Result<(), BackendError> {
        let lost = |reason: String| BackendError::Lost { reason };
        let started = Instant::now();
        let result = loop {
            match self.mapped.try_recv() {
                Ok(result) => break result,
                Err(_) => {
                    // Waits for this frame only; the next one may still run.
                    self.gpu.wait(in_flight.submission.clone(), in_flight.compiled > self.warm)?;
                }
            };
        };
        result.map_err(|e| lost(e.to_string()))?;
        self.gpu.check()?;
        self.warm = in_flight.compiled.max(self.warm);
        let wait_ms = ms_since(started);
        let started = Instant::now();
        in_flight.slot.read(frame, &in_flight.recorded)?;
        frame.times.device = Some(DeviceTimes { wait_ms, copy_ms: ms_since(started), ..in_flight.times });
        Ok(())
    }
}

/// Uploads the uniforms of all frames, batch by batch.
fn upload_uniforms(gpu: &Gpu, memory: &mut Vec<u8>, device: &DeviceConfiguration, params: &[Params]) {
    let batches = device.batches;
    let stride = PARAMS_STRIDE as usize * device.buffers.frames as usize;
    memory.clear();
    for batch in 0..batches.batches {
        memory.resize(batch as usize * stride, 0);
        for params in params {
            memory.extend_from_slice(bytemuck::bytes_of(&batches.params(batch, params)));
        }
    }
    gpu.queue.write_buffer(&device.buffers.params, 0, memory);
}

/// Begins the commands of a frame: clears the overflow counters, and the baseband if no `march` writes it.
fn begin(gpu: &Gpu, device: &DeviceConfiguration, inputs: FrameInputs<'_>) -> wgpu::CommandEncoder {
    let label = wgpu::CommandEncoderDescriptor { label: Some("frame") };
    let mut encoder = gpu.device.create_command_encoder(&label);
    encoder.clear_buffer(&device.buffers.overflows, 0, None);
    encoder.clear_buffer(&device.buffers.map_overflows, 0, None);
    if !inputs.configuration.effects.has(Effect::Scatterers) {
        encoder.clear_buffer(&device.buffers.baseband, 0, None);
    }
    encoder
}

/// Time since `started`, ms.
fn ms_since(started: Instant) -> f64 {
    started.elapsed().as_secs_f64() * 1e3
}

impl FrameMaker for DeviceRenderer {
    fn configure(&mut self, inputs: FrameInputs<'_>) -> Result<(), RenderError> {
        let previous = Some(&self.active);
        let next = DeviceConfiguration::new(&self.gpu, &self.scene, &mut self.pipelines, inputs, previous, 1)?;
        let bends = inputs.configuration.effects.effects().has(Effect::Refraction);
        let tables = &inputs.configuration.tables;
        next.buffers.fill(&self.gpu, tables, bends, previous.map(|p| &p.buffers));
        self.active = next;
        (self.several, self.alone) = (None, false);
        Ok(())
    }

    fn select(&mut self, number: usize, inputs: FrameInputs<'_>) -> Result<(), RenderError> {
        let Self { gpu, scene, pipelines, kept, active, .. } = self;
        let mut new = || {
            // Nothing is shared with the active configuration: either may change its tables without the other.
            let new = DeviceConfiguration::new(gpu, scene, pipelines, inputs, None, 1)?;
            let bends = inputs.configuration.effects.effects().has(Effect::Refraction);
            new.buffers.fill(gpu, &inputs.configuration.tables, bends, None);
            Ok::<_, RenderError>(new)
        };
        let new = if kept.has(number) { None } else { Some(new()?) };
        kept.swap(number, active, new);
        (self.several, self.alone) = (None, false);
        Ok(())
    }

    fn beside(&self, _: FrameInputs<'_>) -> Result<Option<Box<dyn FrameMaker>>, RenderError> {
        Ok(None)
    }

    fn take_cold(&mut self) -> bool {
        self.pipelines.take_cold()
    }

    fn move_scene(&mut self, bvh: &mut Bvh, time_s: f64) {
        bvh.set_drift(time_s);
        if let Some(motion) = &mut self.motion {
            motion.set_amounts(bvh.amounts_at(time_s));
        }
    }

    fn at_once(&mut self, inputs: FrameInputs<'_>) -> usize {
        self.several(inputs).map_or(1, |several| several.buffers.frames as usize)
    }

    fn submit(&mut self, inputs: FrameInputs<'_>, contents: Contents) -> Result<(), BackendError> {
        self.submit_to(false, inputs, &[inputs.configuration.params], contents)
    }

    fn submit_several(
        &mut self,
        inputs: FrameInputs<'_>,
        params: &[Params],
        contents: Contents,
    ) -> Result<(), BackendError> {
        self.submit_to(true, inputs, params, contents)
    }

    fn receive(&mut self, frame: &mut Frame) -> Result<(), BackendError> {
        match self.in_flight.pop_front() {
            Some(in_flight) => self.read_back(&in_flight, frame),
            None => Ok(()),
        }
    }

    fn pass_buffers(&mut self, inputs: FrameInputs<'_>) -> Result<PassBuffers, RenderError> {
        if let batches @ 2.. = self.active.batches.batches {
            return Err(RenderError::Batches { batches });
        }
        upload_uniforms(&self.gpu, &mut self.uniforms, &self.active, &[inputs.configuration.params]);
        if let Some(needle) = &inputs.configuration.needle {
            self.active.buffers.needle.upload(&self.gpu, needle, &mut self.uniforms);
        }
        let mut encoder = begin(&self.gpu, &self.active, inputs);
        if let Some(motion) = &mut self.motion {
            motion.run(&self.gpu, |name, record| {
                let descriptor = wgpu::ComputePassDescriptor { label: Some(name), timestamp_writes: None };
                record(&mut encoder.begin_compute_pass(&descriptor));
            });
        }
        let mut buffers = snapshot::pass_buffers(&self.gpu, encoder, &self.active, &inputs.configuration.params)?;
        if let Some(motion) = &self.motion {
            buffers.moved = Some(snapshot::moved(&self.gpu, &self.scene, motion)?);
        }
        Ok(buffers)
    }
}
