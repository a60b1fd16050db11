//! The graphics device.

use std::sync::{Arc, Mutex, PoisonError};

use thiserror::Error;

/// Why no device could be had, or what it reported.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum GpuError {
    /// No driver was found.
    #[error(
        "no GPU driver was found ({reason}). Install the driver of your GPU, or Mesa's software Vulkan: `sudo apt-get install mesa-vulkan-drivers libvulkan1` (scripts/setup does it)"
    )]
    NoAdapter {
        /// What wgpu said.
        reason: String,
    },
    /// The driver refused a device.
    #[error("the driver of {adapter} refused a device: {reason}; update the driver")]
    NoDevice {
        /// Adapter.
        adapter: String,
        /// What wgpu said.
        reason: String,
    },
    /// The device can't hold what the settings need.
    #[error(
        "{what} needs {needed} of {limit_name}, {adapter} offers {offered}: lower the rays, scanlines, samples or image size"
    )]
    Limit {
        /// What doesn't fit.
        what: &'static str,
        /// Amount needed.
        needed: u64,
        /// Limit's name.
        limit_name: &'static str,
        /// Amount offered.
        offered: u64,
        /// Adapter.
        adapter: String,
    },
    /// The device has no memory left for a buffer.
    #[error(
        "{adapter} has no memory left for {what} ({bytes} bytes): {reason}. Close what else uses the device, or lower the rays, scanlines, samples or image size"
    )]
    Memory {
        /// What the buffer is for.
        what: &'static str,
        /// Its size.
        bytes: u64,
        /// What wgpu said.
        reason: String,
        /// Adapter.
        adapter: String,
    },
    /// A shader or a pipeline was refused.
    #[error("the device refused the pass `{pass}`: {reason}")]
    Pipeline {
        /// Pass.
        pass: &'static str,
        /// What wgpu said.
        reason: String,
    },
    /// An environment that names no place.
    #[error("INSONIFY_TRACE is `{found}`; it says where paths are followed: `device` or `host`")]
    TraceOn {
        /// Value found.
        found: String,
    },
    /// The device was lost or a map failed.
    #[error("the GPU stopped answering: {reason}")]
    Lost {
        /// What wgpu said.
        reason: String,
    },
}

/// How the device is chosen.
#[derive(Debug, Clone, Default)]
pub struct GpuOptions {
    /// Part of the adapter's name to choose it by, in any case; empty: the fastest kind.
    pub adapter: String,
    /// Where paths are followed.
    pub trace: TraceOn,
    /// Where the image is made of them.
    pub image: ImageOn,
}

/// Where paths are followed through the scene: the passes `locate` and `trace`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum TraceOn {
    /// As the environment's `INSONIFY_TRACE` says (`device` or `host`); else on the host where the device is software, on the
    /// device where it is not.
    #[default]
    Auto,
    /// By the device's shaders.
    Device,
    /// By the host's cores.
    Host,
}

/// Where the image is made of the paths: the passes from `march` on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ImageOn {
    /// On the host where it follows the paths and the device is software; else on the device.
    #[default]
    Auto,
    /// By the device's shaders.
    Device,
}

/// Says where paths are followed, over what the kind of device calls for.
const TRACE_VARIABLE: &str = "INSONIFY_TRACE";

impl TraceOn {
    /// Whether the host follows the paths of a device of this kind.
    fn host(self, kind: wgpu::DeviceType) -> Result<bool, GpuError> {
        let software = kind == wgpu::DeviceType::Cpu;
        match self {
            Self::Device => Ok(false),
            Self::Host => Ok(true),
            Self::Auto => match std::env::var(TRACE_VARIABLE).as_deref() {
                Ok("device") => Ok(false),
                Ok("host") => Ok(true),
                Ok("") | Err(std::env::VarError::NotPresent) => Ok(software),
                Ok(found) => Err(GpuError::TraceOn { found: found.to_owned() }),
                Err(std::env::VarError::NotUnicode(found)) => {
                    Err(GpuError::TraceOn { found: found.to_string_lossy().into_owned() })
                }
            },
        }
    }
}

/// A device and its queue.
#[derive(Debug, Clone)]
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    pub(crate) timestamps: bool,
    /// Whether the host follows the paths.
    pub(crate) host_trace: bool,
    /// Whether the host makes the image too, and nothing is left to the device.
    pub(crate) host_image: bool,
    /// The first error that the device reported outside of any call.
    fault: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// Opens a device: discrete before integrated before software, `WGPU_BACKEND` obeyed.
    ///
    /// # Errors
    /// No driver (with the remedy), or a driver that refuses a device.
    pub fn new(options: &GpuOptions) -> Result<Self, GpuError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::PRIMARY);
        let backends = descriptor.backends;
        let instance = wgpu::Instance::new(descriptor);
        let mut adapters = pollster::block_on(instance.enumerate_adapters(backends));
        let wanted = options.adapter.to_lowercase();
        adapters.retain(|a| a.get_info().name.to_lowercase().contains(&wanted));
        adapters.sort_by_key(|a| match a.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        });
        let Some(adapter) = adapters.into_iter().next() else {
            let reason = if wanted.is_empty() {
                format!("backends tried: {backends:?}")
            } else {
                format!("no adapter's name contains `{}`", options.adapter)
            };
            return Err(GpuError::NoAdapter { reason });
        };
        let info = adapter.get_info();
        let host_trace = options.trace.host(info.device_type)?;
        let host_image = host_trace && info.device_type == wgpu::DeviceType::Cpu && options.image == ImageOn::Auto;
        let features = wgpu::Features::TIMESTAMP_QUERY & adapter.features();
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("insonify"),
            required_features: features,
            required_limits: adapter.limits(),
            ..Default::default()
        });
        let (device, queue) = pollster::block_on(request)
            .map_err(|e| GpuError::NoDevice { adapter: info.name.clone(), reason: e.to_string() })?;
        let fault = Arc::new(Mutex::new(None));
        let reported = fault.clone();
        device.on_uncaptured_error(Arc::new(move |error| {
            reported.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }));
        let timestamps = features.contains(wgpu::Features::TIMESTAMP_QUERY);
        Ok(Self { device, queue, info, timestamps, host_trace, host_image, fault })
    }

    /// The same device, whose shaders do all the work.
    pub(crate) fn without_host(mut self) -> Self {
        (self.host_trace, self.host_image) = (false, false);
        self
    }

    /// Fails if the device reported an error since it was opened: what it computes can't be trusted.
    pub(crate) fn check(&self) -> Result<(), GpuError> {
        match self.fault.lock().unwrap_or_else(PoisonError::into_inner).as_ref() {
            Some(reason) => Err(GpuError::Lost { reason: reason.clone() }),
            None => Ok(()),
        }
    }

    /// A buffer of `bytes` zeros.
    pub(crate) fn buffer(
        &self,
        what: &'static str,
        bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, GpuError> {
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
                Err(GpuError::Memory { what, bytes, reason, adapter: self.adapter_name() })
            }
            None => Ok(buffer),
        }
    }

    /// Name of the adapter.
    pub fn adapter_name(&self) -> String {
        self.info.name.clone()
    }

    /// Driver and its version.
    pub fn driver(&self) -> String {
        format!("{} {} ({:?})", self.info.driver, self.info.driver_info, self.info.backend)
    }

    /// Whether the adapter is software on the CPU.
    pub fn is_software(&self) -> bool {
        self.info.device_type == wgpu::DeviceType::Cpu
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_that_finds_no_memory_is_an_error_of_its_own_and_no_fault_of_the_device() {
        let gpu = Gpu::new(&GpuOptions::default()).unwrap();
        let bytes = 1 << 50;
        let error = gpu.buffer("segments", bytes, wgpu::BufferUsages::STORAGE).unwrap_err();
        assert!(matches!(error, GpuError::Memory { what: "segments", bytes: b, .. } if b == bytes), "{error}");
        gpu.check().unwrap();
        gpu.buffer("segments", 1 << 10, wgpu::BufferUsages::STORAGE).unwrap();
    }
}
