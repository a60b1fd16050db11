//! A graphics device: opening, submission, waiting and buffers.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use super::submitter::{Missing, Submitter};
use crate::batch_plan::SEGMENT_BYTES_LEAST;
use crate::compute_device::{ComputeDevice, PciAddress};
use crate::constants::PATH_LANES;
use crate::error::BackendError;
use crate::trace_times::TraceChoice;

/// Usage of storage buffers.
const STORAGE: wgpu::BufferUsages =
    wgpu::BufferUsages::STORAGE.union(wgpu::BufferUsages::COPY_SRC).union(wgpu::BufferUsages::COPY_DST);
/// Usage of small tables, which are uniforms.
pub(super) const UNIFORM: wgpu::BufferUsages = wgpu::BufferUsages::UNIFORM.union(wgpu::BufferUsages::COPY_DST);

/// Prefixes of the names of GPU nodes in `/dev` and `/dev/dri`.
const DEVICE_NODES: [&str; 7] = ["renderD", "nvidia", "nvhost", "nvmap", "mali", "kgsl", "dxg"];

/// Number of threads over which a frame's searches of the scene are spread; the threads in between are idle. On an
/// H200, frames of 32 × 3 rays × layers are slower with more threads, and frames of 1 × 1 with fewer.
const SPREAD_THREADS: u32 = 1 << 17;
/// Most threads started for one search: the size of the widest subgroup.
const LANES_APART_MAX: u32 = 32;

/// Number of paths that keeps a GPU busy. With more paths, several frames at once gain nothing.
const FILLING_PATHS: u32 = 1 << 13;
/// Most frames in one dispatch.
pub(super) const FRAMES_AT_ONCE_MAX: u32 = 8;
/// Most memory for the buffers that passes of several frames write, bytes.
const FRAMES_BYTES_MAX: u64 = 1 << 30;

/// Default time limit for a frame of a GPU. Software has none.
const PATIENCE: Duration = Duration::from_secs(60);
/// Factor on the time limit if a pass has never run: the driver may compile it.
const COLD: u32 = 10;

/// A device and its queue.
#[derive(Debug, Clone)]
pub(crate) struct Gpu {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    pub(super) timestamps: bool,
    /// Time limit for a frame; `None` is unlimited.
    patience: Option<Duration>,
    /// How to run `trace`, once it was set or measured. Clones share it.
    pub(super) trace: Arc<OnceLock<TraceChoice>>,
    /// Requested number of frames per dispatch; `None` lets the device choose.
    at_once: Option<u32>,
    submitter: Submitter,
    /// First error that the device reported outside a call, or the reason why it was given up.
    fault: Arc<Mutex<Option<String>>>,
    /// Hang injected by a test; `None` after the device was opened again.
    #[cfg(feature = "test-hooks")]
    pub(super) hang: Option<super::InjectedHang>,
}

impl Gpu {
    /// Whether this machine may have a GPU. Only lists `/dev` and `/dev/dri`; loads no driver.
    pub(crate) fn may_exist() -> bool {
        if !cfg!(target_os = "linux") {
            return true;
        }
        let names = |folder: &str| {
            let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
            entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect::<Vec<_>>()
        };
        let is_node = |name: &String| DEVICE_NODES.iter().any(|prefix| name.starts_with(prefix));
        names("/dev").iter().chain(&names("/dev/dri")).any(is_node)
    }

    /// Opens the best device: discrete, else integrated, else software if `software` is true. `WGPU_BACKEND` restricts
    /// the graphics interfaces.
    ///
    /// # Errors
    /// No driver (the message names the remedy), or a driver that refuses a device.
    pub(crate) fn open(software: bool) -> Result<Self, BackendError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY);
        let backends = descriptor.backends;
        let instance = wgpu::Instance::new(descriptor);
        let adapters = pollster::block_on(instance.enumerate_adapters(backends)).into_iter();
        let found = adapters.filter(|a| software || a.get_info().device_type != wgpu::DeviceType::Cpu);
        let best = found.min_by_key(|a| match a.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        });
        let Some(adapter) = best else {
            return Err(BackendError::NoAdapter { reason: format!("backends tried: {backends:?}") });
        };
        let info = adapter.get_info();
        let features = (wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::SUBGROUP) & adapter.features();
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("insonify"),
            required_features: features,
            required_limits: adapter.limits(),
            ..Default::default()
        });
        let (device, queue) = pollster::block_on(request)
            .map_err(|e| BackendError::NoDevice { adapter: info.name.clone(), reason: e.to_string() })?;
        let fault = Arc::new(Mutex::new(None));
        let reported = fault.clone();
        device.on_uncaptured_error(Arc::new(move |error| {
            reported.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }));
        let reported = fault.clone();
        device.set_device_lost_callback(move |reason, message| {
            // A dropped device is reported as lost, too, but nobody reads that.
            let message = if message.is_empty() { format!("{reason:?}") } else { message };
            reported.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(message);
        });
        let submitter = Submitter::start()
            .map_err(|e| BackendError::NoDevice { adapter: info.name.clone(), reason: format!("no thread: {e}") })?;
        let timestamps = features.contains(wgpu::Features::TIMESTAMP_QUERY);
        let patience = (info.device_type != wgpu::DeviceType::Cpu).then_some(PATIENCE);
        Ok(Self {
            device,
            queue,
            info,
            timestamps,
            patience,
            trace: Arc::default(),
            at_once: None,
            submitter,
            fault,
            #[cfg(feature = "test-hooks")]
            hang: None,
        })
    }

    /// Sets the time limit for a frame, after which the device counts as lost.
    pub(crate) fn answering_within(self, wait: Duration) -> Self {
        Self { patience: Some(wait), ..self }
    }

    /// Adds a hang of about `duration` that a test can inject.
    ///
    /// # Errors
    /// A device that fails.
    #[cfg(feature = "test-hooks")]
    pub(crate) fn with_hang(self, duration: Duration) -> Result<(Self, super::InjectedHang), BackendError> {
        let hang = super::InjectedHang::new(self.device.clone(), self.queue.clone(), duration)?;
        Ok((Self { hang: Some(hang.clone()), ..self }, hang))
    }

    /// Sets the number of frames per dispatch, up to [`FRAMES_AT_ONCE_MAX`].
    pub(crate) fn with_frames_at_once(self, frames: u32) -> Self {
        Self { at_once: Some(frames), ..self }
    }

    /// Number of frames per dispatch: a power of two up to [`FRAMES_AT_ONCE_MAX`]. Unless requested, it is the number
    /// that keeps a GPU busy and fits into [`FRAMES_BYTES_MAX`]; 1 in software. Each frame has `paths` paths, and its
    /// passes write `bytes` bytes.
    pub(super) fn frames_at_once(&self, paths: u32, bytes: u64) -> u32 {
        let filling = if self.is_software() { 1 } else { FILLING_PATHS / paths.max(1) };
        let in_memory = (FRAMES_BYTES_MAX / bytes.max(1)).min(u64::from(FRAMES_AT_ONCE_MAX)) as u32;
        let frames = self.at_once.unwrap_or_else(|| filling.min(in_memory));
        1 << frames.clamp(1, FRAMES_AT_ONCE_MAX).ilog2()
    }

    /// Opens a device of the same kind, with the same time limit and choices.
    ///
    /// # Errors
    /// As [`Gpu::open`].
    pub(crate) fn reopen(&self) -> Result<Self, BackendError> {
        let opened = Self::open(self.is_software())?;
        let is_same = (opened.adapter_name(), opened.driver()) == (self.adapter_name(), self.driver());
        let trace = if is_same { &self.trace } else { &opened.trace }.clone();
        Ok(Self { patience: self.patience, trace, at_once: self.at_once, ..opened })
    }

    /// Submits commands, then calls `after`. `cold` says that one of their passes has never run.
    ///
    /// # Errors
    /// A device that does not take the commands in time; it then counts as lost.
    pub(super) fn submit(
        &self,
        commands: wgpu::CommandBuffer,
        cold: bool,
        after: impl FnOnce() + Send + 'static,
    ) -> Result<wgpu::SubmissionIndex, BackendError> {
        let queue = self.queue.clone();
        #[cfg(feature = "test-hooks")]
        let hang = self.hang.clone();
        let submit = move || {
            #[cfg(feature = "test-hooks")]
            if let Some(hang) = hang {
                hang.submit_if_due();
            }
            let submission = queue.submit([commands]);
            after();
            submission
        };
        let Some(limit) = self.limit(cold) else { return Ok(submit()) };
        self.submitter.run(limit, submit).map_err(|missing| match missing {
            Missing::Late => self.give_up(limit),
            Missing::Gone => BackendError::Lost { reason: "its thread panicked".to_owned() },
        })
    }

    /// Waits until a submission is done. `cold` says that one of its passes has never run.
    ///
    /// # Errors
    /// A device that is lost, or that does not finish in time; it then counts as lost.
    pub(super) fn wait(&self, submission: wgpu::SubmissionIndex, cold: bool) -> Result<(), BackendError> {
        let timeout = self.limit(cold);
        let wait = wgpu::PollType::Wait { submission_index: Some(submission), timeout };
        match self.device.poll(wait) {
            Ok(_) => Ok(()),
            Err(wgpu::PollError::Timeout) => Err(self.give_up(timeout.unwrap_or_default())),
            Err(error) => Err(BackendError::Lost { reason: error.to_string() }),
        }
    }

    /// Time limit for a submission or a wait; `None` is unlimited.
    fn limit(&self, cold: bool) -> Option<Duration> {
        self.patience.map(|patience| if cold { COLD * patience } else { patience })
    }

    /// Marks the device as lost after `limit` has passed, and returns the error to report.
    fn give_up(&self, limit: Duration) -> BackendError {
        // Dropping the last handle would wait forever for the hanging work.
        std::mem::forget((self.device.clone(), self.queue.clone()));
        let error = BackendError::Hung { adapter: self.adapter_name(), wait_s: limit.as_secs_f64() };
        self.fault.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        error
    }

    /// Checks that the device has reported no error since it was opened. After an error, its results can't be trusted.
    ///
    /// # Errors
    /// The first reported error.
    pub(super) fn check(&self) -> Result<(), BackendError> {
        match self.fault.lock().unwrap_or_else(PoisonError::into_inner).as_ref() {
            Some(reason) => Err(BackendError::Lost { reason: reason.clone() }),
            None => Ok(()),
        }
    }

    /// Checks a need of the settings against a limit of the device.
    ///
    /// # Errors
    /// The device offers less than `needed`.
    pub(super) fn check_limit(
        &self,
        what: &'static str,
        needed: u64,
        limit_name: &'static str,
        offered: u64,
    ) -> Result<(), BackendError> {
        if needed <= offered {
            return Ok(());
        }
        Err(BackendError::Limit { what, needed, limit_name, offered, adapter: self.adapter_name() })
    }

    /// Returns the result of `make`, or an error of `pass` if the device reports a validation error meanwhile.
    pub(super) fn validated<T>(&self, pass: &'static str, make: impl FnOnce() -> T) -> Result<T, BackendError> {
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = make();
        match pollster::block_on(scope.pop()) {
            Some(error) => Err(BackendError::Pipeline { pass, reason: error.to_string() }),
            None => Ok(made),
        }
    }

    /// Makes a storage buffer of at least `bytes` bytes, filled with zeros.
    pub(super) fn storage(&self, what: &'static str, bytes: u64) -> Result<wgpu::Buffer, BackendError> {
        let limits = self.device.limits();
        let offered = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        self.check_limit(what, bytes, "bytes a storage buffer", offered)?;
        self.buffer(what, bytes.max(16), STORAGE)
    }

    /// Makes a buffer of `bytes` bytes, filled with zeros.
    pub(super) fn buffer(
        &self,
        what: &'static str,
        bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, BackendError> {
        let refused = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let exhausted = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(what),
            size: bytes,
            usage,
            mapped_at_creation: false,
        });
        let errors = [pollster::block_on(exhausted.pop()), pollster::block_on(refused.pop())];
        match errors.into_iter().flatten().next() {
            Some(error) => {
                let reason = error.to_string();
                Err(BackendError::Memory { what, bytes, reason, adapter: self.adapter_name() })
            }
            None => Ok(buffer),
        }
    }

    /// Name of the adapter.
    pub(crate) fn adapter_name(&self) -> String {
        self.info.name.clone()
    }

    /// Driver and its version.
    pub(crate) fn driver(&self) -> String {
        format!("{} {} ({:?})", self.info.driver, self.info.driver_info, self.info.backend)
    }

    /// Number of threads to start for each of `threads` searches of the scene: a power of two, 1 in software. Only one
    /// of them searches. Threads of a subgroup wait for each other's searches, so idle threads between searches save
    /// time on a GPU.
    pub(super) fn lanes_apart(&self, threads: u32) -> u32 {
        if self.is_software() {
            return 1;
        }
        1 << (SPREAD_THREADS / threads.max(1)).clamp(1, LANES_APART_MAX).ilog2()
    }

    /// Like [`Gpu::lanes_apart`], in units of a path's [`PATH_LANES`] lanes: number of units to start for each of
    /// `paths` paths.
    pub(super) fn paths_apart(&self, paths: u32) -> u32 {
        self.lanes_apart(paths.saturating_mul(PATH_LANES)).min(LANES_APART_MAX / PATH_LANES)
    }

    /// Least and greatest size of a subgroup, lanes.
    pub(super) fn subgroup_sizes(&self) -> [u32; 2] {
        [self.info.subgroup_min_size, self.info.subgroup_max_size]
    }

    /// Kind and PCI address of the device, to tell whether other work shares it.
    pub(crate) fn compute_device(&self) -> ComputeDevice {
        if self.is_software() {
            return ComputeDevice::Processors;
        }
        let vendor = Some(self.info.vendor).filter(|vendor| *vendor != 0);
        ComputeDevice::Gpu { vendor, address: PciAddress::parse(&self.info.device_pci_bus_id) }
    }

    /// Largest segment buffer, bytes: a share of the memory that the smallest devices of this kind have.
    pub(super) fn segment_bytes_max(&self) -> u64 {
        let share = match self.info.device_type {
            wgpu::DeviceType::DiscreteGpu => 1 << 30,
            wgpu::DeviceType::Cpu => SEGMENT_BYTES_LEAST,
            _ => 1 << 28,
        };
        let limits = self.device.limits();
        share.min(limits.max_storage_buffer_binding_size).min(limits.max_buffer_size)
    }

    /// Whether the adapter is software on the CPU.
    pub(crate) fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_that_finds_no_memory_is_an_error_of_its_own_and_no_fault_of_the_device() {
        let gpu = Gpu::open(true).unwrap();
        let bytes = 1 << 50;
        let error = gpu.buffer("segments", bytes, wgpu::BufferUsages::STORAGE).unwrap_err();
        assert!(matches!(error, BackendError::Memory { what: "segments", bytes: b, .. } if b == bytes), "{error}");
        gpu.check().unwrap();
        gpu.buffer("segments", 1 << 10, wgpu::BufferUsages::STORAGE).unwrap();
    }
}
