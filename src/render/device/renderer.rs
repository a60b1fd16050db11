//! Frames by a device: records the passes, keeps up to two frames in flight, reads them back.

use std::collections::VecDeque;
use std::sync::{Arc, mpsc};
use std::time::Instant;

use super::buffers::{PARAMS_STRIDE, SceneBuffers};
use super::configuration::DeviceConfiguration;
use super::gpu::Gpu;
use super::passes::{Pass, Pipelines};
use super::readback::Slot;
use super::shaders::ShaderSet;
use super::snapshot;
use crate::anatomy::Bvh;
use crate::anatomy::bvh::{Changed, PackedTriangle};
use crate::render::configuration::FrameInputs;
use crate::render::error::{BackendError, RenderError};
use crate::render::frame::{Contents, DeviceTimes, FRAMES_IN_FLIGHT, Frame};
use crate::render::kept::Kept;
use crate::render::maker::FrameMaker;
use crate::render::snapshot::PassBuffers;
use crate::settings::Effect;

/// Unit of memory for uploads, bytes.
const UPLOAD_CHUNK: u64 = 8 << 20;

/// A frame that was submitted and not received.
#[derive(Debug)]
struct InFlight {
    slot: Arc<Slot>,
    contents: Contents,
    submission: wgpu::SubmissionIndex,
    times: DeviceTimes,
    /// Passes compiled at its submission.
    compiled: usize,
}

/// Makes frames by the shaders of a device.
#[derive(Debug)]
struct DeviceRenderer {
    gpu: Gpu,
    scene: SceneBuffers,
    pipelines: Pipelines,
    active: DeviceConfiguration,
    /// The other configurations.
    kept: Kept<DeviceConfiguration>,
    in_flight: VecDeque<InFlight>,
    next_slot: usize,
    mapped: mpsc::Receiver<Result<(), wgpu::BufferAsyncError>>,
    map_done: mpsc::SyncSender<Result<(), wgpu::BufferAsyncError>>,
    /// Mapped memory through which what moved is uploaded, used again and again: fresh memory takes longer than the copy.
    uploads: wgpu::util::StagingBelt,
    /// Memory of the uniforms of all batches.
    uniforms: Vec<u8>,
    /// Passes compiled at the submission of the last frame that was received.
    warm: usize,
}

impl Gpu {
    /// Frame maker of a scene and a configuration.
    ///
    /// # Errors
    /// As [`DeviceRenderer::new`].
    pub(in crate::render) fn maker(
        &self,
        inputs: FrameInputs<'_>,
        shaders: &ShaderSet,
    ) -> Result<Box<dyn FrameMaker>, BackendError> {
        Ok(Box::new(DeviceRenderer::new(self, inputs, shaders)?))
    }
}

impl DeviceRenderer {
    /// A renderer of a scene and a configuration.
    ///
    /// # Errors
    /// A device that fails, is too small or has no memory left.
    fn new(gpu: &Gpu, inputs: FrameInputs<'_>, shaders: &ShaderSet) -> Result<Self, BackendError> {
        let scene = SceneBuffers::new(gpu, &inputs.media.surface_words, inputs.bvh)?;
        let mut pipelines = Pipelines::new(shaders);
        let active = DeviceConfiguration::new(gpu, &scene, &mut pipelines, inputs, None)?;
        let bends = inputs.configuration.effects.effects().has(Effect::Refraction);
        active.buffers.fill(gpu, &scene, &inputs.configuration.tables, bends, None);
        let (map_done, mapped) = mpsc::sync_channel(FRAMES_IN_FLIGHT);
        Ok(Self {
            gpu: gpu.clone(),
            scene,
            pipelines,
            active,
            kept: Kept::default(),
            in_flight: VecDeque::with_capacity(FRAMES_IN_FLIGHT),
            next_slot: 0,
            mapped,
            map_done,
            uploads: wgpu::util::StagingBelt::new(gpu.device.clone(), UPLOAD_CHUNK),
            uniforms: Vec::new(),
            warm: 0,
        })
    }

    /// Uploads the uniforms of every batch.
    fn upload_uniforms(&mut self, inputs: FrameInputs<'_>) {
        let batches = &inputs.configuration.batches;
        self.uniforms.clear();
        for batch in 0..batches.batches {
            let params = batches.params(batch, &inputs.configuration.params);
            self.uniforms.resize((u64::from(batch) * PARAMS_STRIDE) as usize, 0);
            self.uniforms.extend_from_slice(bytemuck::bytes_of(&params));
        }
        self.gpu.queue.write_buffer(&self.active.buffers.params, 0, &self.uniforms);
    }

    /// Begins the commands of a frame: uploads uniforms, clears the counters, and the baseband if no `march` writes it.
    fn begin(&mut self, inputs: FrameInputs<'_>) -> wgpu::CommandEncoder {
        self.upload_uniforms(inputs);
        let label = wgpu::CommandEncoderDescriptor { label: Some("frame") };
        let mut encoder = self.gpu.device.create_command_encoder(&label);
        encoder.clear_buffer(&self.active.buffers.overflows, 0, None);
        encoder.clear_buffer(&self.active.buffers.map_overflows, 0, None);
        if !inputs.configuration.effects.has(Effect::Scatterers) {
            encoder.clear_buffer(&self.active.buffers.baseband, 0, None);
        }
        encoder
    }

    /// Waits for a submission and copies its frame out of its slot.
    fn read_back(&mut self, in_flight: &InFlight, frame: &mut Frame) -> Result<(), BackendError> {
        let lost = |reason: String| BackendError::Lost { reason };
        let started = Instant::now();
        let result = loop {
            match self.mapped.try_recv() {
                Ok(result) => break result,
                Err(_) => {
                    // Waits for this frame only: the next one may still run.
                    self.gpu.wait(in_flight.submission.clone(), in_flight.compiled > self.warm)?;
                }
            };
        };
        result.map_err(|e| lost(e.to_string()))?;
        self.gpu.check()?;
        self.warm = in_flight.compiled.max(self.warm);
        let wait_ms = ms_since(started);
        let started = Instant::now();
        in_flight.slot.read(frame, in_flight.contents)?;
        frame.times.device = Some(DeviceTimes { wait_ms, copy_ms: ms_since(started), ..in_flight.times });
        Ok(())
    }
}

/// Time since an instant, ms.
fn ms_since(started: Instant) -> f64 {
    started.elapsed().as_secs_f64() * 1e3
}

impl FrameMaker for DeviceRenderer {
    fn configure(&mut self, inputs: FrameInputs<'_>) -> Result<(), RenderError> {
        let previous = Some(&self.active);
        let next = DeviceConfiguration::new(&self.gpu, &self.scene, &mut self.pipelines, inputs, previous)?;
        let bends = inputs.configuration.effects.effects().has(Effect::Refraction);
        let tables = &inputs.configuration.tables;
        next.buffers.fill(&self.gpu, &self.scene, tables, bends, previous.map(|p| &p.buffers));
        self.active = next;
        Ok(())
    }

    fn select(&mut self, number: usize, inputs: FrameInputs<'_>) -> Result<(), RenderError> {
        let Self { gpu, scene, pipelines, kept, active, .. } = self;
        let mut new = || {
            // Buffers are not shared: tables of one configuration may change without the other's.
            let new = DeviceConfiguration::new(gpu, scene, pipelines, inputs, None)?;
            let bends = inputs.configuration.effects.effects().has(Effect::Refraction);
            new.buffers.fill(gpu, scene, &inputs.configuration.tables, bends, None);
            Ok::<_, RenderError>(new)
        };
        let new = if kept.has(number) { None } else { Some(new()?) };
        kept.swap(number, active, new);
        Ok(())
    }

    fn beside(&self, _: FrameInputs<'_>) -> Result<Option<Box<dyn FrameMaker>>, RenderError> {
        Ok(None)
    }

    fn take_cold(&mut self) -> bool {
        self.pipelines.take_cold()
    }

    fn move_scene(&mut self, bvh: &Bvh, changed: &Changed) {
        // Copies are in order with submissions: a frame in flight keeps the data that it was submitted with.
        let label = wgpu::CommandEncoderDescriptor { label: Some("motion") };
        let mut encoder = self.gpu.device.create_command_encoder(&label);
        let mut write = |buffer: &wgpu::Buffer, first: usize, size: usize, bytes: &[u8]| {
            if let Some(length) = wgpu::BufferSize::new(bytes.len() as u64) {
                let mut staged = self.uploads.write_buffer(&mut encoder, buffer, (first * size) as u64, length);
                staged.slice(..).copy_from_slice(bytes);
            }
        };
        let (nodes, triangles) = (changed.nodes.clone(), changed.triangles.clone());
        let moved = bytemuck::cast_slice(&bvh.nodes[nodes.clone()]);
        write(&self.scene.nodes, nodes.start, size_of::<[u32; 20]>(), moved);
        if !triangles.is_empty() {
            let (first, moved) = (triangles.start, bytemuck::cast_slice(&bvh.triangles[triangles.clone()]));
            write(&self.scene.triangles, first, size_of::<PackedTriangle>(), moved);
            let moved = bytemuck::cast_slice(&bvh.displacements()[triangles]);
            write(&self.scene.displacements, first, size_of::<[f32; 4]>(), moved);
        }
        self.uploads.finish();
        // A device that does not take it is found lost by the frame that follows, and none of its buffers may be touched.
        if self.gpu.submit(encoder.finish(), false, || ()).is_ok() {
            self.uploads.recall();
        }
    }

    fn submit(&mut self, inputs: FrameInputs<'_>, contents: Contents) -> Result<(), BackendError> {
        self.gpu.check()?;
        let started = Instant::now();
        let mut encoder = self.begin(inputs);
        let slot = self.active.slots[self.next_slot].clone();
        let mut index = 0;
        let mut record = |pass: &Pass, batch: u32| {
            let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(pass.name),
                timestamp_writes: slot.timestamps(index),
            });
            pass.record(&mut compute, batch);
            index += 1;
        };
        self.active.passes(contents).for_each(|(pass, batch)| record(pass, batch));
        slot.record(&mut encoder, &self.active.buffers, contents);
        let commands = encoder.finish();
        let record_ms = ms_since(started);
        let started = Instant::now();
        let compiled = self.pipelines.count();
        let (mapped_slot, map_done) = (slot.clone(), self.map_done.clone());
        let submission = self.gpu.submit(commands, compiled > self.warm, move || mapped_slot.map(&map_done))?;
        let times = DeviceTimes { record_ms, submit_ms: ms_since(started), ..DeviceTimes::default() };
        self.in_flight.push_back(InFlight { slot, contents, submission, times, compiled });
        self.next_slot = (self.next_slot + 1) % FRAMES_IN_FLIGHT;
        Ok(())
    }

    fn receive(&mut self, frame: &mut Frame) -> Result<(), BackendError> {
        match self.in_flight.pop_front() {
            Some(in_flight) => self.read_back(&in_flight, frame),
            None => Ok(()),
        }
    }

    fn pass_buffers(&mut self, inputs: FrameInputs<'_>) -> Result<PassBuffers, BackendError> {
        let encoder = self.begin(inputs);
        snapshot::pass_buffers(&self.gpu, encoder, &self.active, &inputs.configuration.params)
    }
}
