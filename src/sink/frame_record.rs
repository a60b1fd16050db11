//! Record of a frame's inputs and times, for `frame.json`.

use serde::Serialize;

use crate::pose::Pose;
use crate::render::{Effect, EffectPlan, Frame, FrameTimes, PassTime, Quality, RenderSettings};
use crate::transducer::{Probe, ProbeKind, Sector};

/// Inputs of a frame: pose, quality, image, probe, device. The station file holds scene and tissues.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameRecord {
    /// Version of insonify.
    pub version: &'static str,
    /// `scene_from_probe`.
    pub pose: PoseRecord,
    /// Paths as asked for.
    pub quality: QualityRecord,
    /// Paths and effects simulated.
    pub simulated: SimulatedRecord,
    /// Image.
    pub image: ImageRecord,
    /// Probe.
    pub probe: ProbeRecord,
    /// The 98th percentile that the attenuation map was divided by.
    pub attenuation_p98: f32,
    /// Crossings and interactions that did not fit the buffers; 0 in a sound frame.
    pub overflows: u32,
    /// Times.
    pub times: TimesRecord,
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

/// Rays and layers as asked for.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct QualityRecord {
    /// Rays per scanline and layer.
    pub rays: u32,
    /// Elevational layers.
    pub layers: u32,
    /// Seed.
    pub seed: u32,
    /// Reflections that a path is followed through.
    pub reflections_max: u32,
    /// Most taps of the lateral beam.
    pub beam_taps_max: u32,
    /// Most taps of the pulse.
    pub pulse_taps_max: u32,
}

/// Quality and effects after the effect plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulatedRecord {
    /// Rays per scanline and layer: one where more show nothing more.
    pub rays: u32,
    /// Elevational layers: likewise.
    pub layers: u32,
    /// Names of the effects that the frame is made of.
    pub effects: Vec<Effect>,
}

/// The image and how it lies in the probe frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImageRecord {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Side of a square pixel, mm.
    pub pixel_mm: f64,
    /// Probe-frame (x, z) of the upper left corner, mm.
    pub corner_mm: [f64; 2],
    /// Black to white, dB.
    pub dynamic_range_db: f64,
    /// Gain, dB.
    pub gain_db: f64,
    /// Time-gain compensation, dB a cm.
    pub tgc_db_per_cm: f64,
    /// Gain at eight depths from the face to the full depth, dB.
    pub tgc_sliders_db: [f64; 8],
}

/// The probe, under the keys of a station file's `[probe]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProbeRecord {
    /// `convex`, `linear` or `phased`.
    pub kind: &'static str,
    /// Radius of a convex face, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_mm: Option<f64>,
    /// Field of view of a convex or phased probe, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fov_deg: Option<f64>,
    /// Width of a linear face, mm.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width_mm: Option<f64>,
    /// Centre frequency, MHz.
    pub frequency_mhz: f64,
    /// Two-way −6 dB bandwidth over the centre frequency.
    pub fractional_bandwidth: f64,
    /// Image depth, mm.
    pub depth_mm: f64,
    /// Scanlines.
    pub scanlines: u32,
    /// Samples a scanline.
    pub samples: u32,
    /// Depth of the transmit focus, mm.
    pub focus_mm: f64,
    /// Widest active aperture, mm.
    pub aperture_mm: f64,
    /// Height of the elevational lens, mm.
    pub elevational_height_mm: f64,
    /// Focal depth of the elevational lens, mm.
    pub elevational_focus_mm: f64,
}

/// Times of a frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TimesRecord {
    /// From the call until the frame lay in memory, ms.
    pub total_ms: f64,
    /// GPU time of each pass, in order, its runs added up; empty where the device has no timestamps.
    pub passes: Vec<PassRecord>,
}

/// Time of a pass.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PassRecord {
    /// Name of the pass, that of its shader.
    pub name: &'static str,
    /// Time on the device, ms.
    pub ms: f64,
}

/// The device.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AdapterRecord {
    /// Name of the adapter.
    pub name: String,
    /// Its driver.
    pub driver: String,
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
        let image = settings.image;
        Self {
            version: env!("CARGO_PKG_VERSION"),
            pose: PoseRecord::from(pose),
            quality: QualityRecord::from(settings),
            simulated: SimulatedRecord::new(settings, plan),
            image: ImageRecord {
                width: frame.width,
                height: frame.height,
                pixel_mm: sector.pixel_mm,
                corner_mm: sector.corner_mm.to_array(),
                dynamic_range_db: image.dynamic_range_db,
                gain_db: image.gain_db,
                tgc_db_per_cm: image.tgc_db_per_cm,
                tgc_sliders_db: image.tgc_sliders_db,
            },
            probe: ProbeRecord::from(probe),
            attenuation_p98: frame.attenuation_p98,
            overflows: frame.overflows,
            times: TimesRecord::from(&frame.times),
            adapter,
        }
    }
}

impl From<&Pose> for PoseRecord {
    fn from(pose: &Pose) -> Self {
        let q = pose.orientation;
        Self { position_mm: pose.position_mm.to_array(), orientation_wxyz: [q.w, q.x, q.y, q.z] }
    }
}

impl From<&RenderSettings> for QualityRecord {
    fn from(settings: &RenderSettings) -> Self {
        let Quality { rays, layers, seed } = settings.quality;
        let &RenderSettings { reflections_max, beam_taps_max, pulse_taps_max, .. } = settings;
        Self { rays, layers, seed, reflections_max, beam_taps_max, pulse_taps_max }
    }
}

impl SimulatedRecord {
    fn new(settings: &RenderSettings, plan: &EffectPlan) -> Self {
        let Quality { rays, layers, .. } = plan.settings(settings).quality;
        Self { rays, layers, effects: plan.effects().iter().collect() }
    }
}

impl From<&Probe> for ProbeRecord {
    fn from(probe: &Probe) -> Self {
        let (kind, radius_mm, fov_deg, width_mm) = match probe.kind {
            ProbeKind::Convex { radius_mm, fov_deg } => ("convex", Some(radius_mm), Some(fov_deg), None),
            ProbeKind::Linear { width_mm } => ("linear", None, None, Some(width_mm)),
            ProbeKind::Phased { fov_deg } => ("phased", None, Some(fov_deg), None),
        };
        Self {
            kind,
            radius_mm,
            fov_deg,
            width_mm,
            frequency_mhz: probe.frequency_mhz,
            fractional_bandwidth: probe.fractional_bandwidth,
            depth_mm: probe.depth_mm,
            scanlines: probe.scanlines,
            samples: probe.samples,
            focus_mm: probe.focus_mm,
            aperture_mm: probe.aperture_mm,
            elevational_height_mm: probe.elevational_height_mm,
            elevational_focus_mm: probe.elevational_focus_mm,
        }
    }
}

impl From<&FrameTimes> for TimesRecord {
    fn from(times: &FrameTimes) -> Self {
        let passes = pass_totals(times).iter().map(|p| PassRecord { name: p.name, ms: p.ms }).collect();
        Self { total_ms: times.total_ms, passes }
    }
}

/// The passes of a frame in the order in which they first ran, each with the sum of its runs.
pub fn pass_totals(times: &FrameTimes) -> Vec<PassTime> {
    let mut totals: Vec<PassTime> = Vec::with_capacity(times.passes.len());
    for pass in &times.passes {
        match totals.iter_mut().find(|total| total.name == pass.name) {
            Some(total) => total.ms += pass.ms,
            None => totals.push(*pass),
        }
    }
    totals
}
