//! Record of a frame's inputs and times, for `frame.json`.

use std::fmt;

use serde::Serialize;

use crate::pose::Pose;
use crate::render::{Backend, Effect, EffectPlan, Frame, FrameTimes};
use crate::settings::{ContactSettings, ImageSettings, LookSettings, Probe, Quality, ReceiverSettings, RenderSettings};
use crate::transducer::{Contact, Sector};

/// Inputs of a frame: pose, quality, image, probe, device. The station file holds scene and tissues.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameRecord {
    /// Version of insonify.
    pub version: &'static str,
    /// `scene_from_probe`.
    pub pose: PoseRecord,
    /// Requested quality.
    pub quality: RenderSettings,
    /// Quality that a budget chose, and why; none if the quality is fixed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chosen: Option<String>,
    /// Simulated quality and effects.
    pub simulated: SimulatedRecord,
    /// Image.
    pub image: ImageRecord,
    /// From lines to the display.
    pub look: LookSettings,
    /// Gel and tolerance.
    pub coupling: ContactSettings,
    /// Levels of noise, clutter and reverberation.
    pub receiver: ReceiverSettings,
    /// Probe.
    pub probe: Probe,
    /// Contact of the face with the skin; none if everything is coupled.
    pub contact: Option<Contact>,
    /// The 98th percentile that the attenuation map was divided by.
    pub attenuation_p98: f32,
    /// Crossings and interactions that did not fit the buffers; 0 in a sound frame.
    pub overflows: u32,
    /// Times.
    pub times: FrameTimes,
    /// Device that rendered it.
    pub adapter: AdapterRecord,
}

/// A pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseRecord {
    /// Centre of the transducer's face in the scene, mm.
    pub position_mm: [f64; 3],
    /// Unit quaternion w, x, y, z that turns probe axes into scene axes.
    pub orientation_wxyz: [f64; 4],
}

/// Quality and effects after the effect plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulatedRecord {
    /// Rays per scanline and layer; 1 if more would change nothing.
    pub rays: u32,
    /// Elevational layers; 1 if more would change nothing.
    pub layers: u32,
    /// Simulated effects.
    pub effects: Vec<Effect>,
}

/// The image and its geometry in the probe frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImageRecord {
    /// Side of a square pixel, mm.
    pub pixel_mm: f64,
    /// Probe-frame (x, z) of the upper left corner, mm.
    pub corner_mm: [f64; 2],
    /// Settings of the image.
    #[serde(flatten)]
    pub settings: ImageSettings,
}

/// The device.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AdapterRecord {
    /// Name of the adapter.
    pub name: String,
    /// Its driver.
    pub driver: String,
    /// Way of `trace` on a device: by path, by lanes, or both by the number of paths.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace: Option<String>,
}

impl From<&Backend> for AdapterRecord {
    fn from(backend: &Backend) -> Self {
        Self { name: backend.name(), driver: backend.driver(), trace: backend.trace() }
    }
}

impl FrameRecord {
    /// The record of `frame`, rendered at `pose` by `adapter` with the effects of `plan`.
    pub fn new(
        frame: &Frame,
        pose: &Pose,
        probe: &Probe,
        settings: &RenderSettings,
        plan: &EffectPlan,
        sector: &Sector,
        adapter: AdapterRecord,
    ) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            pose: PoseRecord::from(pose),
            quality: *settings,
            chosen: None,
            simulated: SimulatedRecord::new(settings, plan),
            image: ImageRecord {
                pixel_mm: sector.pixel_mm,
                corner_mm: sector.corner_mm.to_array(),
                settings: settings.image,
            },
            look: settings.look,
            coupling: settings.contact,
            receiver: settings.receiver,
            probe: *probe,
            contact: frame.contact,
            attenuation_p98: frame.attenuation_p98,
            overflows: frame.overflows,
            times: frame.times.clone(),
            adapter,
        }
    }
}

impl fmt::Display for FrameRecord {
    /// Size, simulated quality, time and device in a line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = |simulated: u32, asked: u32, what: &str| match asked {
            _ if asked == simulated => format!("{asked} {what}"),
            _ => format!("{simulated} of {asked} {what}"),
        };
        let (asked, simulated) = (self.quality.quality, &self.simulated);
        let rays = of(simulated.rays, asked.rays, "rays");
        let layers = of(simulated.layers, asked.layers, "layers");
        let ImageSettings { width, height, .. } = self.image.settings;
        let ms = self.times.total_ms;
        write!(f, "{width} x {height} pixels, {rays} x {layers} in {ms:.1} ms on {}", self.adapter.name)
    }
}

impl From<&Pose> for PoseRecord {
    fn from(pose: &Pose) -> Self {
        let q = pose.orientation;
        Self { position_mm: pose.position_mm.to_array(), orientation_wxyz: [q.w, q.x, q.y, q.z] }
    }
}

impl SimulatedRecord {
    fn new(settings: &RenderSettings, plan: &EffectPlan) -> Self {
        let Quality { rays, layers, .. } = plan.settings(settings).quality;
        Self { rays, layers, effects: plan.effects().iter().collect() }
    }
}
