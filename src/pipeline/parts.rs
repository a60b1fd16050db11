//! What a pipeline is put together from: each a trait, so that tests put fakes in their place.

use std::sync::Arc;

use thiserror::Error;

use crate::pose::{Pose, TrackingState};
use crate::render::{Frame, RenderSettings};
use crate::transducer::Probe;

/// Where the probe is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PoseSample {
    /// `scene_from_probe`; none before the first pose, and where the tracking is lost.
    pub scene_from_probe: Option<Pose>,
    /// How far it can be trusted.
    pub state: TrackingState,
    /// When the first byte of the newest record behind it came, ns since 1970 (UTC); none without a tracker.
    pub first_byte_ns: Option<u64>,
    /// How far it was predicted beyond that record, ms.
    pub predicted_ms: f64,
}

/// Knows where the probe is.
pub trait PoseSource: Send {
    /// The pose for a frame that is submitted now and shown at `display_ns`; both ns since 1970 (UTC). Must not block.
    fn sample(&mut self, now_ns: u64, display_ns: u64) -> PoseSample;
}

/// Why a renderer can't go on.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum RenderFault {
    /// The device doesn't answer any more: another has to be opened.
    #[error("{0}")]
    Lost(String),
    /// It can't be as it was asked for; with other settings it may.
    #[error("{0}")]
    Refused(String),
}

/// Size and scale of a renderer's images.
#[derive(Debug, Clone, Copy, PartialEq)]
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

    /// Moves what moves in the scene to where it is at `time_s` of the session, for frames submitted from now on; one of
    /// a scene at rest need not listen.
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

    /// Whether the machine's own processors make its frames, each within `submit`: a submitted frame is then done, and a
    /// generator that runs on them takes turns with it.
    fn on_processors(&self) -> bool {
        false
    }

    /// Whether somebody reads segmentation and attenuation of the frames that are submitted from now on. Those that
    /// nobody reads may be empty; one that always makes them need not listen.
    fn set_maps(&mut self, _wanted: bool) {}
}

/// Makes renderers, after the first one's device was lost.
pub trait RendererFactory: Send {
    /// Opens a device and makes a renderer on it.
    ///
    /// # Errors
    /// No device, or one that fails or refuses.
    fn build(&mut self, probe: &Probe, settings: &RenderSettings) -> Result<Box<dyn FrameRenderer>, RenderFault>;
}

/// Why a frame could not be translated.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("{0}")]
pub struct EnhanceError(pub String);

/// Ends a run of an [`Enhancer`] from another thread, where its provider can.
pub type Terminator = Arc<dyn Fn() + Send + Sync>;

/// What becomes of a frame that an [`Enhancer`] is offered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Readiness {
    /// It can be translated.
    Runs,
    /// It can't be translated without its maps.
    NeedsMaps,
    /// Nothing may run now.
    Rests,
}

/// Translates rendered frames to generated ones.
pub trait Enhancer: Send {
    /// Name of the tier at work.
    fn tier(&self) -> &str;

    /// Whether a run takes the machine's own processors, in place of a device of its own.
    fn on_processors(&self) -> bool {
        false
    }

    /// Whether the frame that is there can be translated: one with segmentation and attenuation, or without its `maps`.
    /// Where not, it is left out, which is no failure.
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

    /// What ends a run that takes too long; none where the provider can't.
    fn terminator(&self) -> Option<Terminator>;
}
