//! Traits of the parts of a pipeline; tests implement fakes of them.

use std::sync::Arc;

use thiserror::Error;

use crate::needle::{Needle, NeedleEstimate};
use crate::pose::{Estimate, Pose};
use crate::render::{ComputeDevice, Frame, RenderSettings};
use crate::transducer::Probe;

/// Source of poses of the probe, and of the needle if there is one.
pub trait PoseSource: Send {
    /// Pose for a frame that is submitted at `now_ns` and shown at `display_ns`, both ns since 1970 (UTC). Must not
    /// block.
    fn sample(&mut self, now_ns: u64, display_ns: u64) -> Estimate;

    /// Needle for the same frame; none without a needle. Must not block.
    fn sample_needle(&mut self, _now_ns: u64, _display_ns: u64) -> Option<NeedleEstimate> {
        None
    }
}

impl<T: PoseSource + ?Sized> PoseSource for Box<T> {
    fn sample(&mut self, now_ns: u64, display_ns: u64) -> Estimate {
        (**self).sample(now_ns, display_ns)
    }

    fn sample_needle(&mut self, now_ns: u64, display_ns: u64) -> Option<NeedleEstimate> {
        (**self).sample_needle(now_ns, display_ns)
    }
}

/// Faults of a renderer.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum RenderFault {
    /// The device does not respond and must be opened again.
    #[error("{0}")]
    Lost(String),
    /// The settings are refused; others may work.
    #[error("{0}")]
    Refused(String),
}

/// Size and scale of a renderer's images.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ImageShape {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Side of a pixel, mm.
    pub pixel_mm: f64,
}

/// Renders frames, with at most two in flight.
pub trait FrameRenderer: Send {
    /// Size and scale of the images in the current configuration.
    fn shape(&self) -> ImageShape;

    /// Starts a frame.
    ///
    /// # Errors
    /// Fails if the device fails.
    fn submit(&mut self, pose: &Pose) -> Result<(), RenderFault>;

    /// Sets the scene time, s since the start of the session, for frames submitted from now on. Renderers of static
    /// scenes ignore it.
    fn set_time_s(&mut self, _time_s: f64) {}

    /// Sets the needle in the scene, for frames submitted from now on; none: they show no needle. Renderers of scenes
    /// without a needle ignore it.
    fn set_needle(&mut self, _needle: Option<Needle>) {}

    /// Waits for the oldest frame in flight and copies it into `frame`.
    ///
    /// # Errors
    /// Fails if the device fails.
    fn receive(&mut self, frame: &mut Frame) -> Result<(), RenderFault>;

    /// Changes the probe and settings. No frame may be in flight.
    ///
    /// # Errors
    /// The device fails, or refuses the settings; the previous settings then remain.
    fn reconfigure(&mut self, probe: &Probe, settings: &RenderSettings) -> Result<(), RenderFault>;

    /// Whether `submit` renders the frame itself, so that it returns only when the frame is done.
    fn renders_in_submit(&self) -> bool {
        false
    }

    /// Device that renders. A generator on the same device takes turns with it.
    fn compute_device(&self) -> ComputeDevice {
        ComputeDevice::UNKNOWN_GPU
    }

    /// Requests segmentation and attenuation for frames submitted from now on. Maps not requested may be empty.
    fn set_maps(&mut self, _wanted: bool) {}

    /// Distance of the centre of the probe's face from the skin at a pose, mm; none without skin. Called for reports
    /// only.
    fn skin_distance_mm(&self, _pose: &Pose) -> Option<f64> {
        None
    }
}

/// Builds a new renderer when the device is lost.
pub trait RendererFactory: Send {
    /// Opens a device and builds a renderer on it.
    ///
    /// # Errors
    /// No device is available, or it fails or refuses the settings.
    fn build(&mut self, probe: &Probe, settings: &RenderSettings) -> Result<Box<dyn FrameRenderer>, RenderFault>;
}

/// Failure to translate a frame.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum GenerateError {
    /// The run was terminated because it took too long.
    #[error("the run was terminated")]
    Terminated,
    /// Any other cause.
    #[error("{0}")]
    Failed(String),
}

/// Function that terminates a run of [`FrameGenerators`] from another thread.
pub type Terminator = Arc<dyn Fn() + Send + Sync>;

/// Generators that translate rendered frames, by index.
pub trait FrameGenerators: Send {
    /// Number of generators, at least one.
    fn count(&self) -> usize {
        1
    }

    /// Name of a generator.
    fn name(&self, generator: usize) -> &str;

    /// Device that runs the generators. They take turns with a renderer on the same device.
    fn compute_device(&self) -> ComputeDevice {
        ComputeDevice::UNKNOWN_GPU
    }

    /// Whether a generator reads segmentation or attenuation.
    fn reads_maps(&self, _generator: usize) -> bool {
        true
    }

    /// Translates `frame` into `out`, grey levels [height × width].
    ///
    /// # Errors
    /// The run fails, is terminated, or yields non-finite values.
    fn generate(&mut self, generator: usize, frame: &Frame, out: &mut Vec<u8>) -> Result<(), GenerateError>;

    /// Function that terminates an overlong run; none if the provider cannot stop a run.
    fn terminator(&self) -> Option<Terminator>;
}
