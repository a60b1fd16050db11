//! Traits of the parts of a pipeline; tests implement them by fakes.

use std::sync::Arc;

use thiserror::Error;

use crate::pose::{Estimate, Pose};
use crate::render::{Frame, RenderSettings};
use crate::transducer::Probe;

/// Source of probe poses.
pub trait PoseSource: Send {
    /// The pose for a frame that is submitted now and shown at `display_ns`; both ns since 1970 (UTC). Must not block.
    fn sample(&mut self, now_ns: u64, display_ns: u64) -> Estimate;
}

/// Faults of a renderer.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum RenderFault {
    /// The device does not answer: another has to be opened.
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

/// Renders frames, two in flight at most.
pub trait FrameRenderer: Send {
    /// Size and scale of its images as it is configured now.
    fn shape(&self) -> ImageShape;

    /// Starts a frame.
    ///
    /// # Errors
    /// A device that fails.
    fn submit(&mut self, pose: &Pose) -> Result<(), RenderFault>;

    /// Moves the scene to `time_s` of the session, for frames submitted from now on. Renderers of a scene at rest
    /// ignore it.
    fn set_time_s(&mut self, _time_s: f64) {}

    /// Waits for the oldest frame in flight and copies it into `frame`.
    ///
    /// # Errors
    /// A device that fails.
    fn receive(&mut self, frame: &mut Frame) -> Result<(), RenderFault>;

    /// Goes on with another probe and other settings. No frame is in flight.
    ///
    /// # Errors
    /// A device that fails; settings that it refuses, after which it goes on with the ones before.
    fn reconfigure(&mut self, probe: &Probe, settings: &RenderSettings) -> Result<(), RenderFault>;

    /// Whether the CPU makes its frames, each within `submit`. A submitted frame is then done, and a generator on the
    /// CPU takes turns with it.
    fn on_processors(&self) -> bool {
        false
    }

    /// Whether somebody reads segmentation and attenuation of the frames submitted from now on. Maps that nobody reads
    /// may be empty.
    fn set_maps(&mut self, _wanted: bool) {}
}

/// Makes another renderer when the device is lost.
pub trait RendererFactory: Send {
    /// Opens a device and makes a renderer on it.
    ///
    /// # Errors
    /// No device, or one that fails or refuses.
    fn build(&mut self, probe: &Probe, settings: &RenderSettings) -> Result<Box<dyn FrameRenderer>, RenderFault>;
}

/// Failure to translate a frame.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("{0}")]
pub struct EnhanceError(pub String);

/// Function that ends a run of an [`Enhancer`] from another thread.
pub type Terminator = Arc<dyn Fn() + Send + Sync>;

/// Outcome of offering a frame to an [`Enhancer`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Readiness {
    /// It is translated.
    Runs,
    /// It lacks the maps that the generator reads.
    NeedsMaps,
    /// The generator rests.
    Rests,
}

/// Translates rendered frames to generated ones.
pub trait Enhancer: Send {
    /// Name of the active tier.
    fn tier(&self) -> &str;

    /// Whether a run takes the CPU instead of a device of its own.
    fn on_processors(&self) -> bool {
        false
    }

    /// Whether the next frame, which has its `maps` or not, can be translated. A frame that can't is left out, which is
    /// no failure.
    fn ready(&mut self, maps: bool) -> Readiness {
        if maps || !self.reads_maps() { Readiness::Runs } else { Readiness::NeedsMaps }
    }

    /// Whether the next frames need their segmentation and attenuation, as of the last [`Enhancer::ready`].
    fn reads_maps(&self) -> bool {
        true
    }

    /// Translates `frame` into `out`, grey levels [height × width].
    ///
    /// # Errors
    /// A run that fails, is terminated, or gives numbers that are not finite.
    fn enhance(&mut self, frame: &Frame, out: &mut Vec<u8>) -> Result<(), EnhanceError>;

    /// Function that ends a run that takes too long; none where the provider cannot be stopped.
    fn terminator(&self) -> Option<Terminator>;
}
