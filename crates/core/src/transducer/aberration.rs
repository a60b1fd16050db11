//! Aberration by the tissue in front of a probe.

use super::Probe;
use crate::anatomy::Scene;
use crate::anatomy::doctor::aberration::{Aperture, Caster, Summary};
use crate::pose::Pose;

/// Width of each aperture over which delays are compared, mm.
const APERTURE_MM: f64 = 30.0;
/// Depths to which delays are accumulated, mm: within an abdominal wall, below most walls, below all walls.
const DEPTHS_MM: [f64; 3] = [20.0, 40.0, 60.0];
/// Number of apertures along the face.
const BEAMS: u32 = 9;

/// Aberration of nine beams of `probe` at `pose` (`scene_from_probe`), summarised for each depth.
pub fn aberration(scene: &Scene, probe: &Probe, pose: &Pose) -> Vec<Summary> {
    let caster = Caster::of(scene);
    let fraction = |i: u32| (f64::from(i) + 0.5) / f64::from(BEAMS);
    let beams: Vec<_> = (0..BEAMS).map(|i| probe.ray(probe.lateral_coordinate(fraction(i)))).collect();
    let face_radius_mm = probe.face_radius_mm().filter(|&radius_mm| radius_mm > 0.0);
    let at = |depth_mm| caster.summary(pose, &beams, &Aperture { width_mm: APERTURE_MM, face_radius_mm, depth_mm });
    DEPTHS_MM.into_iter().filter_map(at).collect()
}
