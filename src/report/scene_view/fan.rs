//! The probe in a picture: its fan, its housing, and the image in the fan.

use glam::{DVec2, DVec3};

use crate::pose::Pose;
use crate::transducer::{Probe, Sector};

/// A B-mode image that is drawn in the fan.
#[derive(Debug, Clone, PartialEq)]
pub struct BmodeImage {
    /// Geometry of its pixels in the imaging plane.
    pub sector: Sector,
    /// Grey levels [height × width], of the sector's size.
    pub grey: Vec<u8>,
}

/// A probe in the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Fan {
    /// Pose of the probe.
    pub scene_from_probe: Pose,
    /// Shape of the probe.
    pub probe: Probe,
    /// Image in the fan, if there is one.
    pub image: Option<BmodeImage>,
}

impl Fan {
    /// Distance from `point_mm` along `direction` to the imaging plane, mm; `None` if line and plane are nearly
    /// parallel.
    pub(super) fn meets(&self, point_mm: DVec3, direction: DVec3) -> Option<f64> {
        let normal = self.scene_from_probe.orientation * DVec3::Y;
        let slope = normal.dot(direction);
        (slope.abs() > 1e-3).then(|| normal.dot(self.scene_from_probe.position_mm - point_mm) / slope)
    }

    /// Grey level at a scene point in the imaging plane. `None` outside the fan; `Some(None)` inside a fan without an
    /// image.
    pub(super) fn at(&self, point_mm: DVec3) -> Option<Option<u8>> {
        let local = self.scene_from_probe.inverse().transform_point(point_mm);
        let point = DVec2::new(local.x, local.z);
        Sector::polar(&self.probe, point)?;
        Some(self.image.as_ref().map(|image| {
            let pixel = image.sector.pixel_from_probe(point);
            let column = (pixel.x.max(0.0) as usize).min(image.sector.width.saturating_sub(1) as usize);
            let row = (pixel.y.max(0.0) as usize).min(image.sector.height.saturating_sub(1) as usize);
            image.grey.get(row * image.sector.width as usize + column).copied().unwrap_or(0)
        }))
    }

    /// Outline of the fan, a closed line of scene points, mm: the face from the image's left to its right, then the
    /// far end back.
    pub(crate) fn outline_mm(&self) -> Vec<DVec3> {
        border_mm(&self.probe, 48).map(|point| self.scene_from_probe.transform_point(point)).collect()
    }
}

/// Border of a probe's sector in the probe frame, mm: the face in `steps` from the image's left to its right, then
/// the far end back.
pub(in crate::report) fn border_mm(probe: &Probe, steps: u32) -> impl Iterator<Item = DVec3> + '_ {
    let at = move |i: u32, depth_mm: f64| {
        let (origin, direction) = probe.ray(probe.lateral_coordinate(f64::from(i) / f64::from(steps)));
        origin + direction * depth_mm
    };
    (0..=steps).map(move |i| at(i, 0.0)).chain((0..=steps).rev().map(move |i| at(i, probe.depth_mm)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fan_ends_at_its_depth() {
        let fan = Fan { scene_from_probe: Pose::IDENTITY, probe: Probe::default(), image: None };
        assert!(fan.at(DVec3::new(0.0, 0.0, 75.0)) == Some(None) && fan.at(DVec3::new(0.0, 0.0, 151.0)).is_none());
    }
}
