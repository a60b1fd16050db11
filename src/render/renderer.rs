//! Frames from poses: records the passes, keeps up to two frames in flight, reads them back.

use std::collections::VecDeque;
use std::sync::{Arc, mpsc};
use std::time::Instant;

use thiserror::Error;

use super::configuration::{Configuration, Media};
use super::device::buffers::{PARAMS_STRIDE, SceneBuffers};
use super::device::gpu::{Gpu, GpuError};
use super::device::passes::{Pass, Pipelines};
use super::device::readback::{Contents, Slot};
use super::device::shaders::ShaderSet;
use super::host::{HostScene, HostTrace, HostWork};
use super::plan::{Choice, Effect, EffectPlan};
use super::settings::SettingsError;
use super::tables::TISSUES_MAX;
use super::{Frame, PassTime, RenderSettings};
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

/// A frame that was submitted and not received, with what reading it needs: later settings may differ.
#[derive(Debug)]
struct InFlight {
    mask: Arc<[u8]>,
    work: Work,
    started: Instant,
}

/// What a frame in flight waits for.
#[derive(Debug)]
enum Work {
    Device {
        slot: Arc<Slot>,
        contents: Contents,
        submission: wgpu::SubmissionIndex,
        /// Time that the host followed paths for, ms.
        traced_ms: Option<f64>,
    },
    /// Nothing: the host made it.
    Host(Frame),
}

/// Renders frames of one scene.
#[derive(Debug)]
pub struct Renderer {
    pub(super) gpu: Gpu,
    pub(super) bvh: Arc<Bvh>,
    pub(super) media: Media,
    pub(super) scene: SceneBuffers,
    /// Follows paths in the device's place.
    pub(super) host: Option<HostTrace>,
    pipelines: Pipelines,
    pub(super) now: Configuration,
    /// Whether the next frames carry their image.
    image: bool,
    in_flight: VecDeque<InFlight>,
    /// Memory of frames that the host makes.
    spare_frames: Vec<Frame>,
    next_slot: usize,
    mapped: mpsc::Receiver<Result<(), wgpu::BufferAsyncError>>,
    map_done: mpsc::SyncSender<Result<(), wgpu::BufferAsyncError>>,
    uniforms: Vec<u8>,
}

impl Renderer {
    /// Builds the BVH, the tables and the pipelines, and warms the pipelines up.
    ///
    /// # Errors
    /// A value outside its range, a scene without triangles, or a device that fails, is too small or has no memory left.
    pub fn new(gpu: &Gpu, scene: &Scene, probe: &Probe, settings: &RenderSettings) -> Result<Self, RenderError> {
        Self::with_shaders(gpu, scene, Bvh::build(scene)?, probe, settings, &ShaderSet::default())
    }

    /// As [`Renderer::new`] with a BVH built before, which renderers may share, and shaders that may differ from the
    /// shipped ones: then the device runs them, of whatever kind it is.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn with_shaders(
        gpu: &Gpu,
        scene: &Scene,
        bvh: impl Into<Arc<Bvh>>,
        probe: &Probe,
        settings: &RenderSettings,
        shaders: &ShaderSet,
    ) -> Result<Self, RenderError> {
        let bvh = bvh.into();
        // Shaders that are not the shipped ones are there to be run.
        let gpu = &if shaders.host_may() { gpu.clone() } else { gpu.clone().without_host() };
        // Before anything is made for them.
        probe.validate()?;
        settings.validate()?;
        check_scene(scene, &bvh)?;
        let media = Media::new(scene, &bvh);
        let scene = SceneBuffers::new(gpu, &media.surface_words, &bvh)?;
        let host = gpu.host_trace.then(|| HostTrace::new(&bvh, shaders.host, shaders.image));
        let mut pipelines = Pipelines::new(shaders);
        let now = Configuration::new(gpu, (&scene, &media), &mut pipelines, probe, settings, None)?;
        now.fill(gpu, None);
        pipelines.take_cold();
        let (map_done, mapped) = mpsc::sync_channel(FRAMES_IN_FLIGHT);
        let mut renderer = Self {
            gpu: gpu.clone(),
            bvh,
            media,
            scene,
            host,
            pipelines,
            now,
            image: true,
            in_flight: VecDeque::with_capacity(FRAMES_IN_FLIGHT),
            spare_frames: Vec::with_capacity(FRAMES_IN_FLIGHT),
            next_slot: 0,
            mapped,
            map_done,
            uniforms: Vec::new(),
        };
        renderer.warm_up(&[true, false])?;
        Ok(renderer)
    }

    /// Goes on with another probe and other settings. The device, the scene's buffers and compiled passes are kept:
    ///
    /// - gain, dynamic range, TGC, seed, reflections and maps are numbers of the next frame and cost nothing,
    ///   as long as the plan calls for the same effects;
    /// - all else makes the tables anew and those buffers whose sizes change; what was never rendered with before (kept
    ///   lines) is compiled, and then a frame of its own warms it up.
    ///
    /// Frames in flight stay as they were submitted: they are received after it in their order, with their own size and
    /// maps, and none is lost. While both are held, the memory of both is used.
    ///
    /// # Errors
    /// A value outside its range, or more than the device has: the renderer is then as it was before. A device that
    /// fails in the warm-up.
    pub fn reconfigure(&mut self, probe: &Probe, settings: &RenderSettings) -> Result<(), RenderError> {
        probe.validate()?;
        settings.validate()?;
        if self.now.has_tables_of(&self.media, probe, settings) {
            self.now.take(&self.media, settings);
            return Ok(());
        }
        let scene = (&self.scene, &self.media);
        let next = Configuration::new(&self.gpu, scene, &mut self.pipelines, probe, settings, Some(&self.now))?;
        next.fill(&self.gpu, Some(&self.now));
        let rests = self.now.effects.has(Effect::Motion) && !next.effects.has(Effect::Motion);
        self.now = next;
        if rests && self.bvh.moves() {
            self.move_to(0.0);
        }
        // With frames in flight the ring has no room: the next frame compiles what is new.
        if self.pipelines.take_cold() && self.in_flight.is_empty() { self.warm_up(&[settings.maps]) } else { Ok(()) }
    }

    /// Renders a frame for each of `with` or without maps: drivers compile at the first dispatch, not in a user's first
    /// frame.
    fn warm_up(&mut self, with_maps: &[bool]) -> Result<(), RenderError> {
        let (maps, image) = (self.now.settings.maps, std::mem::replace(&mut self.image, true));
        // Looks away from the scene, as that takes the least time.
        let beside_mm = self.bvh.centre_mm + 2.0 * self.bvh.radius_mm * glam::DVec3::Z;
        let away = Pose { position_mm: beside_mm, orientation: glam::DQuat::IDENTITY };
        for &with in with_maps {
            self.now.settings.maps = with;
            let rendered = self.render(&away, &mut Frame::default());
            self.now.settings.maps = maps;
            if rendered.is_err() {
                self.image = image;
                return rendered;
            }
        }
        self.image = image;
        Ok(())
    }

    /// Whether the next frames carry segmentation and attenuation: as [`Renderer::reconfigure`] with
    /// [`RenderSettings::maps`], at no cost, for a choice that is made for each frame.
    pub fn set_maps(&mut self, maps: bool) {
        if maps != self.now.settings.maps {
            self.now.settings.maps = maps;
            self.now.effects = self.media.plan(&self.now.probe, &self.now.settings);
        }
    }

    /// Whether the next frames carry their B-mode image: without it [`Frame::bmode`] is empty and the passes that make it
    /// are left out, for a generator that takes maps alone. Frames without maps, and those whose lines are kept, have it in
    /// any case. Costs nothing; frames in flight stay as they were submitted.
    pub fn set_image(&mut self, image: bool) {
        self.image = image;
    }

    /// The settings it renders with.
    pub fn settings(&self) -> &RenderSettings {
        &self.now.settings
    }

    /// Which effects its frames are made of, and why.
    pub fn plan(&self) -> &EffectPlan {
        &self.now.effects
    }

    /// The probe it renders with.
    pub fn probe(&self) -> &Probe {
        &self.now.probe
    }

    /// Whether the host's processors make its frames, within [`Renderer::submit`], and nothing of them is left to the device.
    pub fn on_host(&self) -> bool {
        self.now.host_frame.is_some()
    }

    /// Frames that were submitted and not received.
    pub fn frames_in_flight(&self) -> usize {
        self.in_flight.len()
    }

    /// How the sector lies in the image.
    pub fn sector(&self) -> &Sector {
        &self.now.tables.sector
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
        let now = &mut self.now;
        now.params.set_pose(pose, &self.bvh, &now.probe);
        if now.host_frame.is_some() {
            return;
        }
        self.uniforms.clear();
        for batch in 0..now.plan.batches {
            let params = now.plan.params(batch, &now.params);
            self.uniforms.resize((u64::from(batch) * PARAMS_STRIDE) as usize, 0);
            self.uniforms.extend_from_slice(bytemuck::bytes_of(&params));
        }
        self.gpu.queue.write_buffer(&now.buffers.params, 0, &self.uniforms);
    }

    /// Starts a frame; at most [`FRAMES_IN_FLIGHT`] may wait to be received.
    ///
    /// What the host does of it, it does in this call: the paths, or all of it.
    ///
    /// # Errors
    /// A full ring, or a device that fails.
    pub fn submit(&mut self, pose: &Pose) -> Result<(), RenderError> {
        if self.in_flight.len() == FRAMES_IN_FLIGHT {
            return Err(RenderError::RingFull);
        }
        let started = Instant::now();
        self.place(pose);
        let maps = self.now.settings.maps || self.now.settings.effects.of(Effect::Maps) == Choice::On;
        let contents = Contents { image: self.image || !maps || self.now.settings.lines, maps };
        if self.now.host_frame.is_some() {
            self.submit_on_host(contents, started);
            return Ok(());
        }
        let slot = self.now.slots[self.next_slot].clone();
        let label = wgpu::CommandEncoderDescriptor { label: Some("frame") };
        let mut encoder = self.gpu.device.create_command_encoder(&label);
        encoder.clear_buffer(&self.now.buffers.overflows, 0, None);
        self.now.clear_unwritten(&mut encoder);
        let mut index = 0;
        let mut record = |encoder: &mut wgpu::CommandEncoder, pass: &Pass, batch: u32| {
            let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(pass.name),
                timestamp_writes: slot.timestamps(index),
            });
            pass.record(&mut compute, batch);
            index += 1;
        };
        let mut work = HostWork::default();
        // Maps alone need no paths.
        let batches = if contents.image { self.now.plan.batches } else { 0 };
        for batch in 0..batches {
            self.trace_on_host(batch, &mut encoder, &mut work)?;
            for pass in &self.now.path_passes {
                record(&mut encoder, pass, batch);
            }
            // The device may begin with these paths while the host follows the next.
            if self.host.is_some() && batch + 1 < batches {
                let whole = std::mem::replace(&mut encoder, self.gpu.device.create_command_encoder(&label));
                self.now.submitted(&self.gpu.queue.submit([whole.finish()]));
            }
        }
        for pass in self.now.image_passes(contents) {
            record(&mut encoder, pass, 0);
        }
        slot.record(&mut encoder, &self.now.buffers, contents);
        let submission = self.gpu.queue.submit([encoder.finish()]);
        self.now.submitted(&submission);
        slot.map(&self.map_done);
        let mask = self.now.tables.mask.clone();
        let traced_ms = self.host.is_some().then_some(work.ms);
        let work = Work::Device { slot, contents, submission, traced_ms };
        self.in_flight.push_back(InFlight { mask, work, started });
        self.next_slot = (self.next_slot + 1) % FRAMES_IN_FLIGHT;
        Ok(())
    }

    /// Makes a frame of the pose that the probe is placed at.
    fn submit_on_host(&mut self, contents: Contents, started: Instant) {
        let mut frame = self.spare_frames.pop().unwrap_or_default();
        self.make_on_host(contents, &mut frame, None);
        let mask = self.now.tables.mask.clone();
        self.in_flight.push_back(InFlight { mask, work: Work::Host(frame), started });
    }

    /// Makes a frame where the host makes frames; `scattered` takes its baseband before the interfaces echo.
    pub(super) fn make_on_host(
        &mut self,
        contents: Contents,
        frame: &mut Frame,
        scattered: Option<&mut Vec<[f32; 2]>>,
    ) {
        let Configuration { host_frame, params, plan, tables, effects, .. } = &mut self.now;
        let (Some(host), Some(made)) = (&self.host, host_frame) else { return };
        let effects = effects.effects();
        let scene = HostScene { host, media: &self.media, bvh: &self.bvh, tables, plan, effects, params };
        made.render(scene, contents, frame, scattered);
    }

    /// Waits for the oldest frame in flight and copies it into `frame`.
    ///
    /// # Errors
    /// An empty ring, or a device that fails.
    pub fn receive(&mut self, frame: &mut Frame) -> Result<(), RenderError> {
        let InFlight { mask, work, started } = self.in_flight.pop_front().ok_or(RenderError::RingEmpty)?;
        match work {
            Work::Host(mut made) => {
                self.gpu.check()?;
                // The memory changes hands.
                std::mem::swap(frame, &mut made);
                std::mem::swap(&mut frame.mask, &mut made.mask);
                self.spare_frames.push(made);
            }
            Work::Device { slot, contents, submission, traced_ms } => {
                self.read_back(&slot, contents, &submission, traced_ms, frame)?
            }
        }
        frame.mask.clear();
        frame.mask.extend_from_slice(&mask);
        frame.times.total_ms = started.elapsed().as_secs_f64() * 1e3;
        Ok(())
    }

    /// Waits for a submission and copies its frame out of `slot`.
    fn read_back(
        &mut self,
        slot: &Slot,
        contents: Contents,
        submission: &wgpu::SubmissionIndex,
        traced_ms: Option<f64>,
        frame: &mut Frame,
    ) -> Result<(), RenderError> {
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
        slot.read(frame, contents)?;
        if let Some(ms) = traced_ms {
            frame.times.passes.insert(0, PassTime { name: "trace", ms });
        }
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
