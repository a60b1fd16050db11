//! Probe for a view of a patient: convex, linear or phased, by the organ and the depth of the view.

use glam::DVec3;
use insonify_core::anatomy::{Mesh, Skin};
use insonify_core::pose::Pose;

/// Radius of curvature of a convex probe's face, mm, and angle of its sector, degrees.
pub(super) const CONVEX: (f64, f64) = (60.0, 60.0);
/// Width of a linear probe's face, mm.
pub(super) const LINEAR_WIDTH_MM: f64 = 40.0;
/// Angle of a phased array's sector, degrees, and width of its face, mm.
pub(super) const PHASED_FOV_DEG: f64 = 80.0;
const PHASED_WIDTH_MM: f64 = 20.0;

/// Smallest and largest image depth, mm.
const DEPTHS_MM: [f64; 2] = [40.0, 220.0];
/// Distance from the organ's deepest point to the bottom of the image, mm.
const BELOW_MM: f64 = 15.0;
/// Depth of the image below a lung's pleura, mm.
const LUNG_BELOW_MM: f64 = 60.0;
/// Largest image depth for which a convex probe is set to 5 MHz: soft tissue then loses 64 dB two ways.
const PENETRATION_MM: f64 = 80.0;
/// Largest image depth for which a linear probe is chosen, mm.
const LINEAR_MM: f64 = 60.0;

/// Whether an organ is a lung or a lobe of one.
fn is_lung(name: &str) -> bool {
    name == "lung"
        || ["lung_left", "lung_right", "lung_upper", "lung_middle", "lung_lower"].iter().any(|l| name.starts_with(l))
}

/// Kind of a probe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProbeKind {
    /// Curved face, for deep organs.
    Convex,
    /// Flat face, for organs near the skin.
    Linear,
    /// Small face whose beams are steered, for the heart between the ribs.
    Phased,
}

/// Probe for a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbeChoice {
    /// Kind of the probe.
    pub kind: ProbeKind,
    /// Centre frequency, MHz.
    pub frequency_mhz: f64,
    /// Image depth, mm.
    pub depth_mm: f64,
    /// Depth of the focus, mm.
    pub focus_mm: f64,
}

impl ProbeChoice {
    /// Probe at `pose` that shows all of the organ `name` with the surface `mesh`: a phased array for the heart, a linear
    /// probe for an organ near the skin, else a convex one. Of a lung, the image shows the part under its pleura.
    pub fn for_organ(pose: &Pose, name: &str, mesh: &Mesh) -> Self {
        let probe_from_scene = pose.inverse();
        let depth = |v: &glam::Vec3| probe_from_scene.transform_point(v.as_dvec3()).z;
        if is_lung(name) {
            let ahead = Skin::of_triangles(mesh.corners_mm()).ok().and_then(|lung| {
                lung.exit(pose.transform_point(200.0 * DVec3::Z), pose.transform_vector(DVec3::NEG_Z))
            });
            let pleura_mm = ahead.map_or(0.0, |at| probe_from_scene.transform_point(at).z);
            return Self::of_depth(Self::kind_of(name), pleura_mm + LUNG_BELOW_MM);
        }
        let deepest_mm = mesh.vertices_mm.iter().map(depth).fold(0.0, f64::max);
        Self::of_depth(Self::kind_of(name), deepest_mm + BELOW_MM)
    }

    /// Kind of probe that an organ demands at any depth; `None` if the depth decides.
    pub(super) fn kind_of(name: &str) -> Option<ProbeKind> {
        name.starts_with("heart").then_some(ProbeKind::Phased)
    }

    /// Probe for an image depth of `depth_mm`, rounded up to whole cm, within 40 to 220 mm. Without a kind, the depth
    /// decides between linear and convex.
    pub fn of_depth(kind: Option<ProbeKind>, depth_mm: f64) -> Self {
        let depth_mm = (10.0 * (depth_mm / 10.0).ceil()).clamp(DEPTHS_MM[0], DEPTHS_MM[1]);
        let kind = kind.unwrap_or(if depth_mm > LINEAR_MM { ProbeKind::Convex } else { ProbeKind::Linear });
        let frequency_mhz = match (kind, depth_mm) {
            (ProbeKind::Linear, _) => 9.0,
            (ProbeKind::Phased, _) => 2.5,
            (ProbeKind::Convex, d) if d <= PENETRATION_MM => 5.0,
            (ProbeKind::Convex, _) => 3.5,
        };
        Self { kind, frequency_mhz, depth_mm, focus_mm: (0.55 * depth_mm).round() }
    }

    /// Face of the probe.
    pub fn face(&self) -> Face {
        let (radius_mm, fov_deg) = CONVEX;
        match self.kind {
            ProbeKind::Convex => Face { half_width_mm: radius_mm * (0.5 * fov_deg).to_radians().sin(), radius_mm },
            ProbeKind::Linear => Face { half_width_mm: 0.5 * LINEAR_WIDTH_MM, radius_mm: f64::INFINITY },
            ProbeKind::Phased => Face { half_width_mm: 0.5 * PHASED_WIDTH_MM, radius_mm: f64::INFINITY },
        }
    }

    /// Start and direction of scanlines across the image, in the probe's frame, mm.
    pub(super) fn scanlines(&self, count: usize) -> Vec<(DVec3, DVec3)> {
        let (radius_mm, fov_deg) = CONVEX;
        let at = |n: usize| (n as f64 + 0.5) / count as f64 - 0.5;
        let steered = |n: usize, fov_deg: f64| {
            let angle = at(n) * fov_deg.to_radians();
            DVec3::new(angle.sin(), 0.0, angle.cos())
        };
        let line = |n: usize| match self.kind {
            ProbeKind::Convex => {
                let along = steered(n, fov_deg);
                (radius_mm * (along - DVec3::Z), along)
            }
            ProbeKind::Linear => (DVec3::X * at(n) * LINEAR_WIDTH_MM, DVec3::Z),
            ProbeKind::Phased => (DVec3::ZERO, steered(n, PHASED_FOV_DEG)),
        };
        (0..count).map(line).collect()
    }
}

/// Face of a probe, in its image plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Face {
    /// Half the width, mm.
    pub half_width_mm: f64,
    /// Radius of curvature, mm; infinite for a linear probe.
    pub radius_mm: f64,
}

impl Face {
    /// Height of the face over its middle, mm, at a distance from the middle.
    pub(super) fn height_mm(&self, aside_mm: f64) -> f64 {
        if self.radius_mm.is_finite() {
            self.radius_mm - (self.radius_mm * self.radius_mm - aside_mm * aside_mm).max(0.0).sqrt()
        } else {
            0.0
        }
    }
}
