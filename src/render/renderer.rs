//! Frames from poses: records the passes, keeps up to two frames in flight, reads them back.

use std::collections::VecDeque;
use std::sync::mpsc;
use std::time::Instant;

use thiserror::Error;

use super::gpu::{Gpu, GpuError};
use super::params::Params;
use super::readback::Slot;
use super::resources::{BatchPlan, Buffers, PARAMS_STRIDE, Pass};
use super::settings::SettingsError;
use super::shaders::ShaderSet;
use super::tables::{TISSUES_MAX, Tables};
use super::{Frame, RenderSettings};
use crate::anatomy::scene::SURFACES_MAX;
use crate::anatomy::{Bvh, BvhError, Scene};
use crate::pose::Pose;
use crate::transducer::{Probe, ProbeError, Sector};

/// Frames that may be in flight.
pub const FRAMES_IN_FLIGHT: usize = 2;

/// Why a frame could not be rendered.
#[derive(Debug, Error)]
pub enum RenderError {
    /// The device failed.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The scene can't be traced.
    #[error(transparent)]
    Bvh(#[from] BvhError),
    /// A probe value is outside its range.
    #[error(transparent)]
    Probe(#[from] ProbeError),
    /// A setting is outside its range.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// Indices that the shaders can't follow.
    #[error("the scene can't be rendered: {what}")]
    Scene {
        /// What is wrong.
        what: String,
    },
    /// `submit` with the ring full.
    #[error("{FRAMES_IN_FLIGHT} frames are in flight; receive one before the next is submitted")]
    RingFull,
    /// `receive` with the ring empty.
    #[error("no frame is in flight; submit a pose before receiving")]
    RingEmpty,
    /// A snapshot of a frame whose layers are rendered in turns.
    #[error("a snapshot holds one batch of layers, these settings need {batches}: lower the rays or layers")]
    Batches {
        /// Batches needed.
        batches: u32,
    },
}

/// Renders frames of one scene with one probe and one set of settings.
#[derive(Debug)]
pub struct Renderer {
    pub(super) gpu: Gpu,
    pub(super) bvh: Bvh,
    probe: Probe,
    pub(super) params: Params,
    pub(super) tables: Tables,
    pub(super) plan: BatchPlan,
    pub(super) buffers: Buffers,
    pub(super) path_passes: Vec<Pass>,
    pub(super) image_passes: Vec<Pass>,
    slots: Vec<Slot>,
    /// Slot, submission and start of each frame that was not received.
    pub(super) in_flight: VecDeque<(usize, wgpu::SubmissionIndex, Instant)>,
    next_slot: usize,
    mapped: mpsc::Receiver<Result<(), wgpu::BufferAsyncError>>,
    map_done: mpsc::SyncSender<Result<(), wgpu::BufferAsyncError>>,
    uniforms: Vec<u8>,
}

impl Renderer {
    /// Builds the BVH, the tables and the pipelines, and warms the pipelines up.
    ///
    /// # Errors
    /// A value outside its range, a scene without triangles, or a device that fails or is too small.
    pub fn new(gpu: &Gpu, scene: &Scene, probe: &Probe, settings: &RenderSettings) -> Result<Self, RenderError> {
        Self::with_shaders(gpu, scene, Bvh::build(scene)?, probe, settings, &ShaderSet::default())
    }

    /// As [`Renderer::new`] with a BVH built before, and shaders that may differ from the shipped ones.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn with_shaders(
        gpu: &Gpu,
        scene: &Scene,
        bvh: Bvh,
        probe: &Probe,
        settings: &RenderSettings,
        shaders: &ShaderSet,
    ) -> Result<Self, RenderError> {
        probe.validate()?;
        settings.validate()?;
        check_scene(scene, &bvh)?;
        let tables = Tables::new(scene, probe, settings);
        if tables.sector_words.is_empty() {
            tracing::warn!(
                "the sector is thinner than a pixel and the image stays black: widen it (probe.width_mm, probe.fov_deg) or take more pixels (image.width, image.height)"
            );
        }
        let params = Params::new(scene, probe, settings, &tables);
        let plan = BatchPlan::new(probe.scanlines, settings.quality.rays, settings.quality.layers);
        let buffers = Buffers::new(gpu, scene, &bvh, &tables, &params, &plan, settings.lines)?;
        let pass = |name, groups, constants: &[(&str, f64)]| Pass::new(gpu, shaders, &buffers, name, groups, constants);
        let paths = params.scanlines * params.rays * plan.layers_per_batch;
        let samples_by = |run: u32| [params.row_samples.div_ceil(64 * run), params.scanlines, 1];
        let single_path = settings.quality.rays == 1 && settings.quality.layers == 1;
        let single = [("SINGLE_PATH", f64::from(u8::from(single_path)))];
        let path_passes = vec![
            pass("locate", [paths.div_ceil(64), 1, 1], &[])?,
            pass("trace", [paths.div_ceil(64), 1, 1], &[])?,
            pass("march", samples_by(16), &single)?,
            pass("echo", [params.scanlines.div_ceil(16), 1, 1], &[])?,
        ];
        let keep = [("KEEP_LINES", if settings.lines { 1.0 } else { 0.0 })];
        let image_passes = vec![
            pass("lateral", [params.row_samples.div_ceil(256), params.scanlines.div_ceil(4), 1], &[])?,
            pass("detect", samples_by(8), &keep)?,
            pass("section", [params.map_rays.div_ceil(32), 1, 1], &[])?,
            pass("percentile", [1, 1, 1], &[])?,
            pass("scan_convert", [params.sector_words.div_ceil(128), 1, 1], &[])?,
        ];
        let mut names = Vec::new();
        for _ in 0..plan.batches {
            names.extend(path_passes.iter().map(|p| p.name));
        }
        names.extend(image_passes.iter().map(|p| p.name));
        let pixels = u64::from(params.row_words * 4) * u64::from(params.height);
        let line_bytes =
            if settings.lines { u64::from(params.scanlines) * u64::from(params.row_samples) * 8 } else { 0 };
        let rows = (params.samples, params.row_samples);
        let slots = (0..FRAMES_IN_FLIGHT).map(|_| Slot::new(gpu, pixels, line_bytes, rows, names.clone())).collect();
        let (map_done, mapped) = mpsc::sync_channel(FRAMES_IN_FLIGHT);
        let mut renderer = Self {
            gpu: gpu.clone(),
            bvh,
            probe: *probe,
            params,
            tables,
            plan,
            buffers,
            path_passes,
            image_passes,
            slots,
            in_flight: VecDeque::with_capacity(FRAMES_IN_FLIGHT),
            next_slot: 0,
            mapped,
            map_done,
            uniforms: vec![0; (PARAMS_STRIDE * u64::from(plan.batches)) as usize],
        };
        // Drivers compile at the first dispatch: not in a user's first frame.
        let far = Pose { position_mm: renderer.bvh.centre_mm, orientation: glam::DQuat::IDENTITY };
        renderer.render(&far, &mut Frame::default())?;
        Ok(renderer)
    }

    /// How the sector lies in the image.
    pub fn sector(&self) -> &Sector {
        &self.tables.sector
    }

    /// Renders one frame and waits for it.
    ///
    /// # Errors
    /// A device that fails, or frames that are still in flight.
    pub fn render(&mut self, pose: &Pose, frame: &mut Frame) -> Result<(), RenderError> {
        if !self.in_flight.is_empty() {
            return Err(RenderError::RingFull);
        }
        self.submit(pose)?;
        self.receive(frame)
    }

    /// Places the probe: uploads the uniforms of every batch.
    pub(super) fn place(&mut self, pose: &Pose) {
        self.params.set_pose(pose, &self.bvh, &self.probe);
        let layers = self.params.layer_count;
        for batch in 0..self.plan.batches {
            let mut params = self.params;
            params.layer_first = batch * self.plan.layers_per_batch;
            params.layer_count = self.plan.layers_per_batch.min(layers - params.layer_first);
            let at = (u64::from(batch) * PARAMS_STRIDE) as usize;
            self.uniforms[at..at + size_of::<Params>()].copy_from_slice(bytemuck::bytes_of(&params));
        }
        self.gpu.queue.write_buffer(&self.buffers.params, 0, &self.uniforms);
    }

    /// Starts a frame; at most [`FRAMES_IN_FLIGHT`] may wait to be received.
    ///
    /// # Errors
    /// A full ring.
    pub fn submit(&mut self, pose: &Pose) -> Result<(), RenderError> {
        if self.in_flight.len() == FRAMES_IN_FLIGHT {
            return Err(RenderError::RingFull);
        }
        let started = Instant::now();
        self.place(pose);
        let slot = &self.slots[self.next_slot];
        let mut encoder =
            self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("frame") });
        encoder.clear_buffer(&self.buffers.overflows, 0, None);
        let batches = (0..self.plan.batches).flat_map(|batch| self.path_passes.iter().map(move |pass| (pass, batch)));
        for (index, (pass, batch)) in batches.chain(self.image_passes.iter().map(|pass| (pass, 0))).enumerate() {
            let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(pass.name),
                timestamp_writes: slot.timestamps(index),
            });
            pass.record(&mut compute, batch);
        }
        slot.record(&mut encoder, &self.buffers);
        let submission = self.gpu.queue.submit([encoder.finish()]);
        slot.map(&self.map_done);
        self.in_flight.push_back((self.next_slot, submission, started));
        self.next_slot = (self.next_slot + 1) % FRAMES_IN_FLIGHT;
        Ok(())
    }

    /// Waits for the oldest frame in flight and copies it into `frame`.
    ///
    /// # Errors
    /// An empty ring, or a device that fails.
    pub fn receive(&mut self, frame: &mut Frame) -> Result<(), RenderError> {
        let (index, submission, started) = self.in_flight.pop_front().ok_or(RenderError::RingEmpty)?;
        let lost = |reason: String| RenderError::Gpu(GpuError::Lost { reason });
        let result = loop {
            match self.mapped.try_recv() {
                Ok(result) => break result,
                Err(_) => {
                    // Of this frame alone: the next one may be at work.
                    let wait = wgpu::PollType::Wait { submission_index: Some(submission.clone()), timeout: None };
                    self.gpu.device.poll(wait).map_err(|e| lost(e.to_string()))?;
                }
            };
        };
        result.map_err(|e| lost(e.to_string()))?;
        self.gpu.check()?;
        frame.width = self.params.width;
        frame.height = self.params.height;
        self.slots[index].read(frame)?;
        frame.mask.clear();
        frame.mask.extend_from_slice(&self.tables.mask);
        frame.times.total_ms = started.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }
}

/// Checks every index that the shaders follow unchecked.
fn check_scene(scene: &Scene, bvh: &Bvh) -> Result<(), RenderError> {
    let (surfaces, tissues) = (scene.surfaces.len(), scene.tissues.tissues().len());
    let fail = |what: String| Err(RenderError::Scene { what });
    if surfaces > SURFACES_MAX {
        return fail(format!("{surfaces} surfaces; at most {SURFACES_MAX} are traced"));
    }
    if tissues > TISSUES_MAX as usize {
        return fail(format!("{tissues} tissues; at most {TISSUES_MAX} are numbered"));
    }
    if let Some(index) = scene.surfaces.iter().map(|s| s.tissue).chain([scene.background]).find(|&i| i >= tissues) {
        return fail(format!("tissue {index} of a table of {tissues}"));
    }
    match bvh.triangles.iter().find(|t| t.surface as usize >= surfaces) {
        Some(triangle) => fail(format!("its BVH names surface {} of {surfaces}", triangle.surface)),
        None => Ok(()),
    }
}
