//! Intersection of a surface with a plane.

use glam::DVec2;

use super::Mesh;
use crate::pose::Pose;

/// Outline of a surface in a plane: line segments in no particular order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Section {
    /// Both ends of each segment, (x, z) of the probe frame, mm.
    pub segments_mm: Vec<[DVec2; 2]>,
}

impl Section {
    /// Intersects `mesh` with the image plane of a probe at `pose`, moved by `offset_mm` along the probe's elevational
    /// axis.
    pub fn of(mesh: &Mesh, pose: &Pose, offset_mm: f64) -> Self {
        let probe_from_scene = pose.inverse();
        let local: Vec<_> = mesh.vertices_mm.iter().map(|v| probe_from_scene.transform_point(v.as_dvec3())).collect();
        let mut segments_mm = Vec::new();
        for triangle in &mesh.triangles {
            let corners = triangle.map(|i| local[i as usize]);
            let above = corners.map(|c| c.y >= offset_mm);
            // Each edge that crosses the plane gives a point; a triangle has two such edges or none.
            let mut ends = [0, 1, 2].into_iter().filter_map(|i| {
                let j = (i + 1) % 3;
                (above[i] != above[j]).then(|| {
                    let (a, b) = (corners[i], corners[j]);
                    let t = (offset_mm - a.y) / (b.y - a.y);
                    DVec2::new(a.x + t * (b.x - a.x), a.z + t * (b.z - a.z))
                })
            });
            if let (Some(first), Some(second)) = (ends.next(), ends.next()) {
                segments_mm.push([first, second]);
            }
        }
        Self { segments_mm }
    }

    /// Distances along a ray from `origin_mm` in the unit `direction` to its crossings with the outline, mm.
    pub fn crossings_mm(&self, origin_mm: DVec2, direction: DVec2) -> impl Iterator<Item = f64> + '_ {
        self.segments_mm.iter().filter_map(move |[a, b]| {
            let (a, b) = (*a - origin_mm, *b - origin_mm);
            let (sa, sb) = (direction.perp_dot(a), direction.perp_dot(b));
            // If the ends lie on opposite sides of the ray, the crossing divides the segment in the ratio of `sa` to
            // `sb`.
            if (sa >= 0.0) == (sb >= 0.0) {
                return None;
            }
            let t = direction.dot(a.lerp(b, sa / (sa - sb)));
            (t > 0.0).then_some(t)
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::anatomy::analytic;

    #[test]
    fn a_ball_is_cut_in_circles() {
        let ball = analytic::sphere(Vec3::new(3.0, 4.0, 50.0), 20.0, 5);
        let pose = Pose::looking(DVec3::new(3.0, 0.0, 0.0), DVec3::Z, DVec3::X);
        // The plane y = 0 is 4 mm from the centre; with an offset of 4 mm it passes through the centre.
        for (offset_mm, radius) in [(0.0, (400.0f64 - 16.0).sqrt()), (4.0, 20.0)] {
            let section = Section::of(&ball, &pose, offset_mm);
            assert!(section.segments_mm.len() > 100);
            for end in section.segments_mm.iter().flatten() {
                assert!((end.distance(DVec2::new(0.0, 50.0)) - radius).abs() < 0.05, "{end}");
            }
            for i in 0..16 {
                let direction = DVec2::from_angle(0.3 + f64::from(i));
                let crossings: Vec<_> = section.crossings_mm(DVec2::new(0.0, 50.0), direction).collect();
                assert!(crossings.len() == 1 && (crossings[0] - radius).abs() < 0.05, "{crossings:?}");
            }
        }
        assert_eq!(Section::of(&ball, &pose, 30.0), Section::default());
    }
}
