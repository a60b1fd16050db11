//! Needle with which frames are timed.

use glam::DVec3;

use crate::needle::Needle;
use crate::pose::Pose;
use crate::render::RenderSettings;
use crate::transducer::Probe;

/// Depth of the tip, as a part of the image's depth.
const DEPTH: f64 = 0.6;

/// Needle in the image plane of a probe at `scene_from_probe`, at 45° from the left, with its tip in the lower half of the
/// image. `None` for a station whose needle has no echo, or which has none.
pub fn timed_needle(settings: &RenderSettings, probe: &Probe, scene_from_probe: &Pose) -> Option<Needle> {
    settings.needle.filter(|needle| needle.echoes())?;
    let tip_mm = DVec3::Z * DEPTH * probe.depth_mm;
    let probe_from_needle = Pose::looking(tip_mm, DVec3::new(1.0, 0.0, 1.0).normalize(), DVec3::X);
    Some(Needle { scene_from_needle: *scene_from_probe * probe_from_needle, bevel_known: true })
}
