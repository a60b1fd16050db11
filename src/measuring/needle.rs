//! Needle with which frames are timed.

use glam::DVec3;

use crate::needle::Needle;
use crate::pose::Pose;
use crate::render::RenderSettings;
use crate::transducer::Probe;

/// Depth of the tip, as a part of the image's depth.
const DEPTH: f64 = 0.6;

/// Needle in the image plane of a probe at `scene_from_probe`, at 45° from the left, with its tip in the lower half of the
/// image. `None` without a needle, or for a pointer, which has no echo.
pub fn timed_needle(settings: &RenderSettings, probe: &Probe, scene_from_probe: &Pose) -> Option<Needle> {
    settings.needle.filter(|needle| needle.echoes())?;
    let tip_mm = DVec3::Z * DEPTH * probe.depth_mm;
    let probe_from_needle = Pose::looking(tip_mm, DVec3::new(1.0, 0.0, 1.0).normalize(), DVec3::X);
    Some(Needle { scene_from_needle: *scene_from_probe * probe_from_needle, bevel_known: true })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{NeedleKind, NeedleSettings};

    #[test]
    fn the_tip_lies_in_the_image_plane_of_any_pose() {
        let probe = Probe { depth_mm: 50.0, ..Probe::default() };
        let pose = Pose::looking(DVec3::new(3.0, -8.0, 40.0), DVec3::new(0.2, 0.9, -0.1).normalize(), DVec3::X);
        let needle = |needle| timed_needle(&RenderSettings { needle, ..RenderSettings::default() }, &probe, &pose);
        let placed = needle(Some(NeedleSettings::default())).unwrap();
        let probe_from_scene = pose.inverse();
        assert!(probe_from_scene.transform_point(placed.tip_mm()).distance(DVec3::Z * 30.0) < 1e-9);
        assert!(probe_from_scene.transform_vector(placed.direction()).y.abs() < 1e-9);
        assert_eq!(needle(Some(NeedleSettings { kind: NeedleKind::Pointer, ..NeedleSettings::default() })), None);
        assert_eq!(needle(None), None);
    }
}
