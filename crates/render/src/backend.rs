//! Rendering backends and their choice.

use std::fmt;
use std::time::Duration;

use insonify_core::instructions::Instructions;
pub use insonify_core::settings::{BackendChoice, UnknownBackend, UnknownBackendVariable};

use super::compute_device::ComputeDevice;
use super::configuration::FrameInputs;
use super::device::Gpu;
use super::error::{BackendError, RenderError};
use super::hooks::TestHooks;
use super::host::{self, HostRenderer};
use super::maker::FrameMaker;
use super::trace_by::TraceBy;

/// An open backend: the host renderer or a graphics device. Clones share the device.
#[derive(Debug, Clone)]
pub struct Backend(Kind);

#[derive(Debug, Clone)]
enum Kind {
    Host,
    Device(Box<Gpu>),
}

impl Backend {
    /// Opens the backend that `choice` asks for.
    ///
    /// Devices are preferred in the order discrete, integrated, software; `WGPU_BACKEND` restricts the graphics
    /// interfaces (Vulkan, Metal, …). `INSONIFY_TRACE` chooses how the device runs the pass `trace`. `INSONIFY_SIMD` limits
    /// the vector instructions of the host.
    ///
    /// # Errors
    /// With `Device`: no driver, a driver that refuses a device, or a build without the feature `gpu`. `Auto` then
    /// falls back to the host, and warns if a driver fails. An unknown value of `INSONIFY_TRACE` or `INSONIFY_SIMD`, or
    /// one that the device or processor can't run.
    pub fn open(choice: BackendChoice) -> Result<Self, BackendError> {
        Instructions::limit_by_environment().map_err(BackendError::Instructions)?;
        let trace = TraceBy::from_environment().map_err(BackendError::Trace)?;
        let opened = |gpu: Gpu| match trace {
            Some(by) => Ok(Self(Kind::Device(Box::new(gpu.tracing_by(by)?)))),
            None => Ok(Self(Kind::Device(Box::new(gpu)))),
        };
        match choice {
            BackendChoice::Host => Ok(Self(Kind::Host)),
            BackendChoice::Device => opened(Gpu::open(true)?),
            BackendChoice::Auto if !Gpu::may_exist() => Ok(Self(Kind::Host)),
            BackendChoice::Auto => match Gpu::open(false) {
                Ok(gpu) => opened(gpu),
                Err(BackendError::NoAdapter { .. }) => Ok(Self(Kind::Host)),
                Err(error) => {
                    tracing::warn!("frames are made on the host: {error}");
                    Ok(Self(Kind::Host))
                }
            },
        }
    }

    /// Opens the same kind of backend again, after its device was lost.
    ///
    /// # Errors
    /// As [`Backend::open`].
    pub fn reopen(&self) -> Result<Self, BackendError> {
        match &self.0 {
            Kind::Host => Ok(self.clone()),
            Kind::Device(gpu) => Ok(Self(Kind::Device(Box::new(gpu.reopen()?)))),
        }
    }

    /// Sets the longest time for a frame, after which the device counts as lost. The default is a minute on a GPU, and
    /// unlimited in software. No effect on the host.
    pub fn answering_within(self, wait: Duration) -> Self {
        self.with_device(|gpu| gpu.answering_within(wait))
    }

    /// Sets how the device runs the pass `trace`, and overrides `INSONIFY_TRACE`. No effect on the host.
    ///
    /// # Errors
    /// `by` asks for lanes, and the device can't trace by lanes.
    pub fn tracing_by(self, by: TraceBy) -> Result<Self, BackendError> {
        Ok(match self.0 {
            Kind::Host => self,
            Kind::Device(gpu) => Self(Kind::Device(Box::new(gpu.tracing_by(by)?))),
        })
    }

    /// Sets how many frames of [`Renderer::render_many`](super::Renderer::render_many) one dispatch makes, 1 to 8. They
    /// may differ only in pose and seed. By default, a GPU takes as many frames as keep it busy, and a software device
    /// takes one. No effect on the host.
    pub fn with_frames_at_once(self, frames: u32) -> Self {
        self.with_device(|gpu| gpu.with_frames_at_once(frames))
    }

    /// Applies `change` to the device. The host has none.
    fn with_device(self, change: impl FnOnce(Gpu) -> Gpu) -> Self {
        match self.0 {
            Kind::Host => self,
            Kind::Device(gpu) => Self(Kind::Device(Box::new(change(*gpu)))),
        }
    }

    /// Whether the device can trace each path by several lanes; false for the host.
    pub fn has_trace_by_lanes(&self) -> bool {
        match &self.0 {
            Kind::Host => false,
            Kind::Device(gpu) => gpu.has_trace_by_lanes(),
        }
    }

    /// How the device runs the pass `trace`: `path`, `lanes`, or both by the number of paths. `None` on the host, and
    /// before the first renderer, which may measure both.
    pub fn trace(&self) -> Option<String> {
        match &self.0 {
            Kind::Host => None,
            Kind::Device(gpu) => gpu.trace(),
        }
    }

    /// Adds a hang of about `duration`, which a test can inject into the device. A device that is opened again has no
    /// hang.
    ///
    /// # Errors
    /// The host, which has no device; a device that fails.
    #[cfg(all(feature = "test-hooks", feature = "gpu"))]
    pub fn with_hang(self, duration: Duration) -> Result<(Self, super::InjectedHang), BackendError> {
        match self.0 {
            Kind::Host => Err(BackendError::NoAdapter { reason: "the host has no device that could hang".to_owned() }),
            Kind::Device(gpu) => {
                let (gpu, hang) = gpu.with_hang(duration)?;
                Ok((Self(Kind::Device(Box::new(gpu))), hang))
            }
        }
    }

    /// Whether the host renderer makes the frames.
    pub fn on_host(&self) -> bool {
        matches!(self.0, Kind::Host)
    }

    /// Whether frames are made on the CPU: by the host renderer or by a software device.
    pub fn is_software(&self) -> bool {
        match &self.0 {
            Kind::Host => true,
            Kind::Device(gpu) => gpu.is_software(),
        }
    }

    /// Device that computes frames.
    pub fn compute_device(&self) -> ComputeDevice {
        match &self.0 {
            Kind::Host => ComputeDevice::Processors,
            Kind::Device(gpu) => gpu.compute_device(),
        }
    }

    /// Name of the adapter, or of the host's processor.
    pub fn name(&self) -> String {
        match &self.0 {
            Kind::Host => host::processor_name(),
            Kind::Device(gpu) => gpu.adapter_name(),
        }
    }

    /// Driver and its version; for the host, threads and instruction set.
    pub fn driver(&self) -> String {
        match &self.0 {
            Kind::Host => host::description(),
            Kind::Device(gpu) => gpu.driver(),
        }
    }

    /// A frame maker of this backend, configured for `inputs`.
    pub(super) fn maker(&self, inputs: FrameInputs<'_>, hooks: &TestHooks) -> Result<Box<dyn FrameMaker>, RenderError> {
        Ok(match &self.0 {
            Kind::Host => Box::new(HostRenderer::new(inputs, hooks.trace, hooks.image)?),
            Kind::Device(gpu) => gpu.maker(inputs, &hooks.shaders)?,
        })
    }
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ({})", self.name(), self.driver())?;
        self.trace().map_or(Ok(()), |by| write!(f, ", trace by {by}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_are_read_and_written() {
        for (word, choice) in ["auto", "host", "device"].into_iter().zip(BackendChoice::ALL) {
            assert_eq!(word.parse(), Ok(choice));
            assert_eq!(choice.to_string(), word);
        }
        let error = "gpu".parse::<BackendChoice>().unwrap_err().to_string();
        assert_eq!(error, "`gpu` is no backend; they are auto, host, device");
    }

    #[test]
    fn the_host_names_its_processor_and_how_it_uses_it() {
        let host = Backend::open(BackendChoice::Host).unwrap();
        assert!(host.on_host() && host.is_software() && !host.name().is_empty());
        let driver = host.driver();
        assert!(driver.starts_with("insonify host, ") && driver.contains("thread"), "{driver}");
        assert!(host.reopen().unwrap().on_host());
    }
}
