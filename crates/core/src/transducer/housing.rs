//! Housing of a probe as meshes, for pictures of a scene.

use glam::DVec3;

use super::Probe;
use crate::anatomy::Mesh;
use crate::anatomy::analytic::sphere;
use crate::pose::Pose;

/// Length of the housing, mm.
const HOUSING_MM: f64 = 45.0;

/// Meshes in the scene, mm: the housing of `probe`, and a bead on the side that appears on the image's left.
pub fn housing(probe: &Probe, scene_from_probe: &Pose) -> [Mesh; 2] {
    const STEPS: u32 = 24;
    let half_height = 0.5 * probe.elevational_height_mm + 2.0;
    let face: Vec<DVec3> =
        (0..=STEPS).map(|i| probe.ray(probe.lateral_coordinate(f64::from(i) / f64::from(STEPS))).0).collect();
    let half_width = face.iter().map(|p| p.x.abs()).fold(0.5 * probe.aperture_mm, f64::max);
    let deepest = face.iter().map(|p| p.z).fold(0.0, f64::min);
    let mut outline = face;
    if outline.first().is_some_and(|p| p.x > -half_width) {
        // The scanlines of a phased array leave one point; its face is as wide as its aperture.
        outline = vec![DVec3::new(-half_width, 0.0, 0.0), DVec3::new(half_width, 0.0, 0.0)];
    }
    let narrow = 0.7 * half_width;
    let side = [(half_width, 8.0), (narrow, 20.0), (narrow, HOUSING_MM)];
    let side = side.map(|(x, behind)| DVec3::new(x, 0.0, deepest - behind));
    outline.extend(side.into_iter().chain(side.into_iter().rev().map(|p| p.with_x(-p.x))));
    let corners = outline.len() as u32;
    let scene = |p: DVec3, y: f64| scene_from_probe.transform_point(p + DVec3::Y * y).as_vec3();
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
    let bead = scene_from_probe.transform_point(DVec3::new(-half_width, 0.0, deepest - 12.0));
    [mesh, sphere(bead.as_vec3(), 2.5, 2)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transducer::ProbeKind;

    #[test]
    fn housings_are_closed_and_stay_behind_the_face() {
        let kinds = [
            ProbeKind::Convex { radius_mm: 40.0, fov_deg: 70.0 },
            ProbeKind::Linear { width_mm: 50.0 },
            ProbeKind::Phased { fov_deg: 90.0 },
        ];
        for kind in kinds {
            for mesh in housing(&Probe { kind, ..Probe::default() }, &Pose::IDENTITY) {
                assert_eq!(mesh.unpaired_edges(), 0, "{kind:?}");
                assert!(mesh.signed_volume_mm3() > 0.0, "{kind:?}");
                assert!(mesh.vertices_mm.iter().all(|v| v.z < 1e-3), "{kind:?}");
            }
        }
    }
}
