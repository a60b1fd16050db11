//! Work that keeps a device busy, injected to test how an unresponsive device is handled.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use crate::error::BackendError;

/// The loop's count stays below the 65,536 turns that software Vulkan allows.
const SHADER: &str = "
@group(0) @binding(0) var<storage, read_write> kept: array<u32>;
@compute @workgroup_size(1)
fn main(@builtin(workgroup_id) group: vec3<u32>) {
    var x = 65535u * group.y + group.x + 1u;
    for (var turn = 0u; turn < 60000u; turn++) {
        x ^= x << 13u;
        x ^= x >> 17u;
        x ^= x << 5u;
    }
    if (x == 0u) { kept[0] = 1u; }
}";

/// Most workgroups of a dispatch in one dimension.
const GROUPS_MAX: u64 = 65_535;
/// Least duration of the trial dispatch from which the size of the hang is scaled.
const TRIAL: Duration = Duration::from_millis(50);
/// Time limit of a trial dispatch.
const TRIAL_MAX: Duration = Duration::from_secs(60);
/// Trial dispatches of each size.
const TRIALS: u32 = 4;

/// A dispatch of about a given duration, which runs before the next frame once it is requested. Clones share it.
#[derive(Debug, Clone)]
pub struct InjectedHang(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
    /// Workgroups of the dispatch.
    groups: u64,
    is_due: AtomicBool,
    begun: OnceLock<Instant>,
    /// Measured duration of the dispatch, once it is over.
    lasted: OnceLock<Duration>,
}

impl InjectedHang {
    /// Prepares a dispatch of about `duration`, scaled from the times of smaller dispatches.
    ///
    /// # Errors
    /// The device refuses the shader or the buffer, or fails.
    pub(super) fn new(device: wgpu::Device, queue: wgpu::Queue, duration: Duration) -> Result<Self, BackendError> {
        let kept = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("injected hang"),
            size: 16,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        let pipeline = {
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("injected hang"),
                source: wgpu::ShaderSource::Wgsl(SHADER.into()),
            });
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some("injected hang"),
                layout: None,
                module: &module,
                entry_point: Some("main"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        };
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("injected hang"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: kept.as_entire_binding() }],
        });
        let mut shared = Shared {
            device,
            queue,
            pipeline,
            bindings,
            groups: 1,
            is_due: AtomicBool::new(false),
            begun: OnceLock::new(),
            lasted: OnceLock::new(),
        };
        // The first dispatch also compiles.
        shared.time(1)?;
        let mut groups = 64;
        let took = loop {
            // The least of several times: other programs may use the processors, too.
            let mut took = shared.time(groups)?;
            for _ in 1..TRIALS {
                took = took.min(shared.time(groups)?);
            }
            if took >= TRIAL {
                break took;
            }
            groups *= 2;
        };
        let whole = groups as f64 * duration.as_secs_f64() / took.as_secs_f64();
        shared.groups = (whole.ceil() as u64).clamp(1, GROUPS_MAX * GROUPS_MAX);
        Ok(Self(Arc::new(shared)))
    }

    /// Requests that the dispatch runs before the next frame.
    pub fn inject(&self) {
        self.0.is_due.store(true, Ordering::Release);
    }

    /// Whether the dispatch was submitted.
    pub fn has_begun(&self) -> bool {
        self.0.begun.get().is_some()
    }

    /// Whether the dispatch is running.
    pub fn lasts(&self) -> bool {
        self.has_begun() && self.lasted().is_none()
    }

    /// Duration of the dispatch; `None` until it is over.
    pub fn lasted(&self) -> Option<Duration> {
        self.0.lasted.get().copied()
    }

    /// Submits the dispatch if it was requested.
    pub(super) fn submit_if_due(&self) {
        if !self.0.is_due.swap(false, Ordering::AcqRel) {
            return;
        }
        let begun = *self.0.begun.get_or_init(Instant::now);
        let submission = self.0.submit(self.0.groups);
        // Waits on another thread: wgpu may hold its locks while a driver is in a submission.
        let shared = self.0.clone();
        std::thread::spawn(move || {
            let _ = shared.device.poll(wgpu::PollType::Wait { submission_index: Some(submission), timeout: None });
            shared.lasted.get_or_init(|| begun.elapsed());
        });
    }
}

impl Shared {
    /// Submits a dispatch of at least `groups` workgroups.
    fn submit(&self, groups: u64) -> wgpu::SubmissionIndex {
        let (x, y) = (groups.min(GROUPS_MAX), groups.div_ceil(GROUPS_MAX));
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.bindings, &[]);
            pass.dispatch_workgroups(x as u32, y as u32, 1);
        }
        self.queue.submit([encoder.finish()])
    }

    /// Duration of a dispatch of `groups` workgroups.
    fn time(&self, groups: u64) -> Result<Duration, BackendError> {
        let started = Instant::now();
        let wait = wgpu::PollType::Wait { submission_index: Some(self.submit(groups)), timeout: Some(TRIAL_MAX) };
        self.device.poll(wait).map_err(|error| BackendError::Lost { reason: error.to_string() })?;
        Ok(started.elapsed())
    }
}
