//! Points on a patient's skin to touch with a stylus, for registering a tracker to a mannequin of the same body.

use std::path::{Path, PathBuf};

use glam::DVec3;
use insonify_core::pose::csv::Named;

use super::from_labels::Made;
use super::shape::Shape;
use super::windows::Sight;

/// Directions from the middle of the body: x left, y back, z head. They point to all sides and are not in one plane.
const DIRECTIONS: [(&str, [f64; 3]); 7] = [
    ("FRONT_MIDDLE", [0.0, -1.0, 0.0]),
    ("FRONT_UPPER", [0.0, -0.8, 0.6]),
    ("FRONT_LOWER", [0.0, -0.8, -0.6]),
    ("LEFT_FLANK", [1.0, 0.0, 0.0]),
    ("RIGHT_FLANK", [-1.0, 0.0, 0.0]),
    ("LEFT_LOWER", [0.64, -0.6, -0.48]),
    ("RIGHT_LOWER", [-0.64, -0.6, -0.48]),
];

/// Path of the points of the scene file `scene`: the same name with `.points.csv` instead of its extension.
pub fn points_path(scene: &Path) -> PathBuf {
    scene.with_extension("points.csv")
}

/// Points of the skin to touch, LPS, mm: over the lower end of the sternum and the front of both hip bones, if these
/// bones are segments, and around the body, wherever there is skin.
pub fn skin_points(surfaces: &[Made], sight: &Sight) -> Vec<Named<DVec3>> {
    let mut points = Vec::new();
    let mut add = |name: &str, from_mm: DVec3, direction: DVec3| {
        if let Some(value) = sight.contact(from_mm, direction.normalize_or(DVec3::NEG_Y)) {
            points.push(Named { name: name.to_owned(), value });
        }
    };
    let bone = |name: &str| surfaces.iter().find(|s| s.segment.as_deref() == Some(name));
    // Vertex of a mesh that is farthest along a direction.
    let end = |made: &Made, direction: DVec3| {
        let vertices = made.mesh.vertices_mm.iter().map(|v| v.as_dvec3());
        vertices.max_by(|a, b| a.dot(direction).total_cmp(&b.dot(direction)))
    };
    if let Some(at) = bone("sternum").and_then(|bone| end(bone, DVec3::NEG_Z)) {
        add("XIPHOID", at, DVec3::NEG_Y);
    }
    for (name, hip) in [("LEFT_ILIAC_SPINE", "hip_left"), ("RIGHT_ILIAC_SPINE", "hip_right")] {
        if let Some(at) = bone(hip).and_then(|bone| end(bone, DVec3::NEG_Y)) {
            add(name, at, DVec3::NEG_Y);
        }
    }
    if let Some(centre_mm) = surfaces.first().and_then(|outer| Shape::of(&outer.mesh)).map(|shape| shape.centre_mm) {
        for (name, direction) in DIRECTIONS {
            add(name, centre_mm, DVec3::from_array(direction));
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::sphere;
    use insonify_core::pose::registration::{PointPair, register};

    use super::*;

    #[test]
    fn points_lie_on_the_skin_and_register_a_tracker() {
        let made = |name: &str, centre: Vec3, radius: f32| Made {
            name: name.to_owned(),
            tissue: "skin".to_owned(),
            priority: 0,
            mesh: sphere(centre, radius, 5),
            segment: Some(name.to_owned()),
            voxels_mm3: None,
        };
        let surfaces = [made("skin", Vec3::ZERO, 100.0), made("sternum", Vec3::new(0.0, -70.0, 40.0), 8.0)];
        let sight = Sight::new(&surfaces, Vec::new(), |_| false).unwrap();
        let points = skin_points(&surfaces, &sight);
        assert_eq!(points.len(), 8, "{points:?}");
        assert_eq!(points[0].name, "XIPHOID");
        assert!(points.iter().all(|p| (p.value.length() - 100.0).abs() < 0.2), "{points:?}");
        let pairs: Vec<_> =
            points.iter().map(|p| PointPair { scene_mm: p.value, tracker_mm: p.value + DVec3::X * 300.0 }).collect();
        assert!(!register(&pairs).unwrap().coplanar);
    }
}
