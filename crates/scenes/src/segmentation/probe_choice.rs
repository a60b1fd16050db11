//! Probe for a view of a patient: convex or linear, by the depth of the view.

use insonify_core::anatomy::Mesh;
use insonify_core::pose::Pose;

/// Radius of curvature of a convex probe's face, mm, and angle of its sector, degrees.
pub(super) const CONVEX: (f64, f64) = (60.0, 60.0);
/// Width of a linear probe's face, mm.
pub(super) const LINEAR_WIDTH_MM: f64 = 40.0;

/// Smallest and largest image depth, mm.
const DEPTHS_MM: [f64; 2] = [40.0, 220.0];
/// Distance from the organ's deepest point to the bottom of the image, mm.
const BELOW_MM: f64 = 15.0;
/// Largest image depth for which a linear probe is chosen, mm.
const LINEAR_MM: f64 = 60.0;

/// Probe for a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbeChoice {
    /// Whether the probe is convex; otherwise it is linear.
    pub is_convex: bool,
    /// Centre frequency, MHz.
    pub frequency_mhz: f64,
    /// Image depth, mm.
    pub depth_mm: f64,
    /// Depth of the focus, mm.
    pub focus_mm: f64,
}

impl ProbeChoice {
    /// Probe at `pose` that shows all of `target`: a linear probe if the target is near the skin, else a convex one.
    pub fn for_target(pose: &Pose, target: &Mesh) -> Self {
        let probe_from_scene = pose.inverse();
        let depth = |v: &glam::Vec3| probe_from_scene.transform_point(v.as_dvec3()).z;
        let deepest_mm = target.vertices_mm.iter().map(depth).fold(0.0, f64::max);
        Self::of_depth(deepest_mm + BELOW_MM)
    }

    /// Probe for an image depth of `depth_mm`, rounded up to whole cm, within 40 to 220 mm.
    pub fn of_depth(depth_mm: f64) -> Self {
        let depth_mm = (10.0 * (depth_mm / 10.0).ceil()).clamp(DEPTHS_MM[0], DEPTHS_MM[1]);
        let is_convex = depth_mm > LINEAR_MM;
        let frequency_mhz = match depth_mm {
            d if d <= LINEAR_MM => 9.0,
            d if d <= 110.0 => 5.0,
            _ => 3.5,
        };
        Self { is_convex, frequency_mhz, depth_mm, focus_mm: (0.55 * depth_mm).round() }
    }

    /// Face of the probe.
    pub fn face(&self) -> Face {
        let (radius_mm, fov_deg) = CONVEX;
        if self.is_convex {
            Face { half_width_mm: radius_mm * (0.5 * fov_deg).to_radians().sin(), radius_mm }
        } else {
            Face { half_width_mm: 0.5 * LINEAR_WIDTH_MM, radius_mm: f64::INFINITY }
        }
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
