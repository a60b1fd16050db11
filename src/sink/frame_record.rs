//! Record of a frame's inputs and times, for `frame.json`.

use std::fmt;

use serde::Serialize;

use crate::needle::Needle;
use crate::pose::Pose;
use crate::render::{Backend, Effect, EffectPlan, Frame, FrameTimes};
use crate::settings::{ContactSettings, ImageSettings, LookSettings, Probe, Quality, ReceiverSettings, RenderSettings};
use crate::transducer::{Contact, Sector};

/// Inputs of a frame: pose, quality, image, probe, device. Scene and tissues are in the station file, not here.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameRecord {
    /// Version of insonify.
    pub version: &'static str,
    /// `scene_from_probe`.
    pub pose: PoseRecord,
    /// `scene_from_needle`; left out for a frame without a needle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub needle: Option<PoseRecord>,
    /// Requested quality.
    pub quality: RenderSettings,
    /// Quality that a budget chose, and why; none if the quality is fixed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chosen: Option<String>,
    /// Quality and effects as simulated.
    pub simulated: SimulatedRecord,
    /// Image size and position.
    pub image: ImageRecord,
    /// Post-processing, from baseband lines to the displayed levels.
    pub look: LookSettings,
    /// Coupling: gel and tolerance.
    pub coupling: ContactSettings,
    /// Levels of noise, clutter and reverberation.
    pub receiver: ReceiverSettings,
    /// Probe with its settings.
    pub probe: Probe,
    /// Positions of the samples in lines.npy; none in a frame without its lines.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lines: Option<LinesRecord>,
    /// Contact of the probe's face with the skin; none without the effect `contact`.
    pub contact: Option<Contact>,
    /// 98th percentile of the attenuation, by which the attenuation map was divided; 0 without maps.
    pub attenuation_p98: f32,
    /// Number of hits and interactions that did not fit the buffers; 0 in a complete frame.
    pub overflows: u32,
    /// Durations of the frame's stages.
    pub times: FrameTimes,
    /// Device that rendered the frame.
    pub adapter: AdapterRecord,
}

/// A pose in the scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseRecord {
    /// Centre of the transducer's face, or the needle's tip, in the scene, mm.
    pub position_mm: [f64; 3],
    /// Unit quaternion w, x, y, z that turns the tool's axes into scene axes.
    pub orientation_wxyz: [f64; 4],
}

/// Quality and effects with which the frame was rendered, as the effect plan decided.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulatedRecord {
    /// Number of rays per scanline and layer; 1 if more would change nothing.
    pub rays: u32,
    /// Number of elevational layers; 1 if more would change nothing.
    pub layers: u32,
    /// Simulated effects.
    pub effects: Vec<Effect>,
}

/// Scale, position and settings of the image, in the probe frame.
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

/// Positions of the samples in lines.npy [scanlines, samples], in the probe frame. Sample j of scanline i is centred
/// at `origin(i)` + (`first_depth_mm` + j · `depth_step_mm`) · `direction(i)`.
///
/// A curved face has `direction` = (sin a, 0, cos a) and `origin` = R (sin a, 0, cos a − 1). The angle a is the
/// scanline's; R is the radius of the face, 0 for a phased array. A flat face has `direction` = (0, 0, 1) and
/// `origin` = (x, 0, 0).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LinesRecord {
    /// Depth of sample 0 below the face along its scanline, mm.
    pub first_depth_mm: f64,
    /// Depth between two samples, mm at 1540 m/s.
    pub depth_step_mm: f64,
    /// Position of scanline 0, and the step to the next scanline.
    #[serde(flatten)]
    pub lateral: Lateral,
    /// Phase of an echo in turns per mm of depth: at depth z the echo carries the factor e^(−i2π·turns·z).
    pub phase_turns_per_mm: f64,
}

/// Positions of scanlines across the face.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Lateral {
    /// Angles, for convex and phased probes.
    Angle {
        /// Angle of scanline 0 from the probe's axis, positive towards +x, degrees.
        first_angle_deg: f64,
        /// Angle between two scanlines, degrees.
        angle_step_deg: f64,
        /// Radius of the face, mm.
        face_radius_mm: f64,
    },
    /// Positions along x, for linear probes.
    Position {
        /// Probe-frame x of scanline 0, mm.
        first_x_mm: f64,
        /// Distance between two scanlines, mm.
        x_step_mm: f64,
    },
}

impl LinesRecord {
    /// Positions of the samples of `probe`.
    pub fn new(probe: &Probe) -> Self {
        let lines = f64::from(probe.scanlines);
        let [first, second] = [0.5, 1.5].map(|line| probe.lateral_coordinate(line / lines));
        let lateral = match probe.face_radius_mm() {
            Some(face_radius_mm) => Lateral::Angle {
                first_angle_deg: first.to_degrees(),
                angle_step_deg: (second - first).to_degrees(),
                face_radius_mm,
            },
            None => Lateral::Position { first_x_mm: first, x_step_mm: second - first },
        };
        let depth_step_mm = probe.sample_spacing_mm();
        let phase_turns_per_mm = probe.phase_turns_per_mm();
        Self { first_depth_mm: 0.5 * depth_step_mm, depth_step_mm, lateral, phase_turns_per_mm }
    }
}

/// Device that rendered a frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct AdapterRecord {
    /// Name of the adapter.
    pub name: String,
    /// Name of the adapter's driver.
    pub driver: String,
    /// How the pass `trace` ran on a device: one thread per path, several lanes per path, or chosen by the number of
    /// paths. None on the processor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace: Option<String>,
}

impl From<&Backend> for AdapterRecord {
    fn from(backend: &Backend) -> Self {
        Self { name: backend.name(), driver: backend.driver(), trace: backend.trace() }
    }
}

impl FrameRecord {
    /// Record of `frame`, rendered at `pose` by `adapter` with the effects of `plan`.
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
            needle: None,
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
            lines: (!frame.lines.is_empty()).then(|| LinesRecord::new(&probe.sampled(settings.coarse_samples))),
            contact: frame.contact,
            attenuation_p98: frame.attenuation_p98,
            overflows: frame.overflows,
            times: frame.times.clone(),
            adapter,
        }
    }

    /// Stores the needle's pose. A pointer is stored, too, though the frame doesn't show it.
    pub fn set_needle(&mut self, needle: Option<&Needle>) {
        let in_station = needle.filter(|_| self.quality.needle.is_some());
        self.needle = in_station.map(|needle| PoseRecord::from(&needle.scene_from_needle));
    }
}

impl fmt::Display for FrameRecord {
    /// Writes size, simulated quality, time and device in one line.
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

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::settings::ProbeKind;

    #[test]
    fn samples_lie_where_the_record_says() {
        for kind in [
            ProbeKind::Convex { radius_mm: 40.0, fov_deg: 70.0 },
            ProbeKind::Linear { width_mm: 38.0 },
            ProbeKind::Phased { fov_deg: 90.0 },
        ] {
            let probe = Probe { kind, scanlines: 64, samples: 500.into(), depth_mm: 80.0, ..Probe::default() };
            // Reads the record as another program would.
            let record = serde_json::to_value(LinesRecord::new(&probe)).unwrap();
            let number = |key: &str| record[key].as_f64().unwrap();
            for (line, sample) in [(0_u32, 0_u32), (5, 17), (63, 499)] {
                let depth_mm = number("first_depth_mm") + f64::from(sample) * number("depth_step_mm");
                let position = match kind {
                    ProbeKind::Linear { .. } => {
                        DVec3::new(number("first_x_mm") + f64::from(line) * number("x_step_mm"), 0.0, depth_mm)
                    }
                    _ => {
                        let angle = number("first_angle_deg") + f64::from(line) * number("angle_step_deg");
                        let (sin, cos) = angle.to_radians().sin_cos();
                        let radius = number("face_radius_mm");
                        DVec3::new((radius + depth_mm) * sin, 0.0, (radius + depth_mm) * cos - radius)
                    }
                };
                let fraction = (f64::from(line) + 0.5) / 64.0;
                let (origin, direction) = probe.ray(probe.lateral_coordinate(fraction));
                let expected = origin + (f64::from(sample) + 0.5) * 80.0 / 500.0 * direction;
                assert!(position.distance(expected) < 1e-9, "{kind:?}, {line}, {sample}: {position} {expected}");
            }
        }
    }
}
