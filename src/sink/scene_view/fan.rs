//! The probe: its fan, its housing, and the image in the fan.

use glam::{DVec2, DVec3};

use crate::anatomy::Mesh;
use crate::anatomy::analytic::sphere;
use crate::pose::Pose;
use crate::transducer::{Probe, Sector};

/// A B-mode image to be laid into the fan.
#[derive(Debug, Clone, PartialEq)]
pub struct BmodeImage {
    /// Where its pixels lie in the imaging plane.
    pub sector: Sector,
    /// Grey levels [height × width] of the sector's size.
    pub grey: Vec<u8>,
}

/// A probe in the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Fan {
    /// Its pose.
    pub scene_from_probe: Pose,
    /// Its shape.
    pub probe: Probe,
    /// What it sees, if that is known.
    pub image: Option<BmodeImage>,
}

/// Length of the housing, mm.
const HOUSING_MM: f64 = 45.0;

impl Fan {
    /// Distance along the line of `point_mm` and `direction` at which it meets the imaging plane; none where it hardly does.
    pub(super) fn meets(&self, point_mm: DVec3, direction: DVec3) -> Option<f64> {
        let normal = self.scene_from_probe.orientation * DVec3::Y;
        let slope = normal.dot(direction);
        (slope.abs() > 1e-3).then(|| normal.dot(self.scene_from_probe.position_mm - point_mm) / slope)
    }

    /// Grey level at a scene point of the imaging plane, or None without an image; None outside the fan.
    pub(super) fn at(&self, point_mm: DVec3) -> Option<Option<u8>> {
        let local = self.scene_from_probe.inverse().transform_point(point_mm);
        let place = DVec2::new(local.x, local.z);
        Sector::polar(&self.probe, place)?;
        Some(self.image.as_ref().map(|image| {
            let pixel = image.sector.pixel_from_probe(place);
            let column = (pixel.x.max(0.0) as usize).min(image.sector.width.saturating_sub(1) as usize);
            let row = (pixel.y.max(0.0) as usize).min(image.sector.height.saturating_sub(1) as usize);
            image.grey.get(row * image.sector.width as usize + column).copied().unwrap_or(0)
        }))
    }

    /// The fan's outline, a closed line of scene points, mm: the face from image left to right, then the far end back.
    pub fn outline_mm(&self) -> Vec<DVec3> {
        const STEPS: u32 = 48;
        let along = |i: u32, depth: f64| {
            let (origin, direction) = self.probe.ray(self.probe.lateral_coordinate(f64::from(i) / f64::from(STEPS)));
            self.scene_from_probe.transform_point(origin + direction * depth)
        };
        let face = (0..=STEPS).map(|i| along(i, 0.0));
        face.chain((0..=STEPS).rev().map(|i| along(i, self.probe.depth_mm))).collect()
    }

    /// The probe's housing in the scene, and a bead on the side that is the image's left.
    pub(crate) fn housing(&self) -> [Mesh; 2] {
        const STEPS: u32 = 24;
        let half_height = 0.5 * self.probe.elevational_height_mm + 2.0;
        let face: Vec<DVec3> = (0..=STEPS)
            .map(|i| self.probe.ray(self.probe.lateral_coordinate(f64::from(i) / f64::from(STEPS))).0)
            .collect();
        let half_width = face.iter().map(|p| p.x.abs()).fold(0.5 * self.probe.aperture_mm, f64::max);
        let deepest = face.iter().map(|p| p.z).fold(0.0, f64::min);
        let mut outline = face;
        if outline.first().is_some_and(|p| p.x > -half_width) {
            // A phased array's lines leave one point; its face is as wide as its aperture.
            outline = vec![DVec3::new(-half_width, 0.0, 0.0), DVec3::new(half_width, 0.0, 0.0)];
        }
        let narrow = 0.7 * half_width;
        outline.extend([
            DVec3::new(half_width, 0.0, deepest - 8.0),
            DVec3::new(narrow, 0.0, deepest - 20.0),
            DVec3::new(narrow, 0.0, deepest - HOUSING_MM),
            DVec3::new(-narrow, 0.0, deepest - HOUSING_MM),
            DVec3::new(-narrow, 0.0, deepest - 20.0),
            DVec3::new(-half_width, 0.0, deepest - 8.0),
        ]);
        let corners = outline.len() as u32;
        let scene = |p: DVec3, y: f64| self.scene_from_probe.transform_point(p + DVec3::Y * y).as_vec3();
        let mut mesh = Mesh::default();
        for y in [-half_height, half_height] {
            mesh.vertices_mm.extend(outline.iter().map(|&p| scene(p, y)));
        }
        let middle = DVec3::new(0.0, 0.0, deepest - 8.0);
        mesh.vertices_mm.extend([-half_height, half_height].map(|y| scene(middle, y)));
        for i in 0..corners {
            let j = (i + 1) % corners;
            // The outline runs from −x to +x along the face: counter-clockwise seen from +y.
            mesh.triangles.extend([[i, j, corners + j], [i, corners + j, corners + i]]);
            mesh.triangles.extend([[2 * corners, j, i], [2 * corners + 1, corners + i, corners + j]]);
        }
        let bead = self.scene_from_probe.transform_point(DVec3::new(-half_width, 0.0, deepest - 12.0));
        [mesh, sphere(bead.as_vec3(), 2.5, 2)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn housings_are_closed_and_stay_behind_the_face() {
        use crate::transducer::ProbeKind;
        let kinds = [
            ProbeKind::Convex { radius_mm: 40.0, fov_deg: 70.0 },
            ProbeKind::Linear { width_mm: 50.0 },
            ProbeKind::Phased { fov_deg: 90.0 },
        ];
        for kind in kinds {
            let probe = Probe { kind, ..Probe::default() };
            let fan = Fan { scene_from_probe: Pose::IDENTITY, probe, image: None };
            for mesh in fan.housing() {
                assert_eq!(mesh.unpaired_edges(), 0, "{kind:?}");
                assert!(mesh.signed_volume_mm3() > 0.0, "{kind:?}");
                assert!(mesh.vertices_mm.iter().all(|v| v.z < 1e-3), "{kind:?}");
            }
            assert!(fan.at(DVec3::new(0.0, 0.0, 75.0)) == Some(None) && fan.at(DVec3::new(0.0, 0.0, 151.0)).is_none());
        }
    }
}
