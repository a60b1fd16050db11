//! Where a probe touches: the outside of a scene.

use std::time::Duration;

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;

use super::phantom::sdf::Solid;
use super::phantom::{self, Parameters};
use super::{BvhError, Scene};
use crate::pose::Pose;

/// Longer than from any point of a body to its skin, mm.
const REACH_MM: u32 = 400;

/// How far in front of a probe's face the body is looked for, mm.
const PROBE_MM: f64 = 30.0;

/// A ray within the very border of one of the tree's boxes may miss the box: rays on both sides of it do not.
const ASIDE_MM: DVec3 = DVec3::new(1.3e-3, 0.7e-3, 1.1e-3);

/// The outside of a scene.
pub struct Skin(Outside);

enum Outside {
    Solid(Solid),
    Mesh { tree: CwBvh, triangles: Vec<Triangle> },
}

impl Skin {
    /// The skin of the obstetric phantom's mother, as it is modelled.
    pub fn phantom(parameters: &Parameters) -> Self {
        Self(Outside::Solid(phantom::skin(parameters)))
    }

    /// The outermost surfaces of `scene`.
    ///
    /// # Errors
    /// A scene without triangles.
    pub fn of_scene(scene: &Scene) -> Result<Self, BvhError> {
        let corners = scene.surfaces.iter().flat_map(|surface| surface.mesh.corners_mm());
        let triangles: Vec<Triangle> =
            corners.map(|[a, b, c]| Triangle { v0: a.into(), v1: b.into(), v2: c.into() }).collect();
        if triangles.is_empty() {
            return Err(BvhError::Empty);
        }
        let tree = build_cwbvh_from_tris(&triangles, BvhBuildParams::medium_build(), &mut Duration::default());
        Ok(Self(Outside::Mesh { tree, triangles }))
    }

    /// Where the line from `from_mm` inside the body along the unit `direction` leaves the body; none where it starts
    /// outside, or leaves nowhere within 400 mm. Of a mesh, the last surface that it meets.
    pub fn exit(&self, from_mm: DVec3, direction: DVec3) -> Option<DVec3> {
        let t = match &self.0 {
            Outside::Solid(skin) => exit_solid(skin, from_mm, direction),
            Outside::Mesh { tree, triangles } => {
                let mut last = f32::NEG_INFINITY;
                for aside_mm in [ASIDE_MM, -ASIDE_MM] {
                    // The tree drops rays along an axis: none is quite along one.
                    let along = (direction + aside_mm * 1e-3).as_vec3a();
                    let origin = (from_mm + aside_mm).as_vec3a();
                    tree.ray_traverse_anyhit(Ray::new(origin, along, 0.0, REACH_MM as f32), |ray, hit| {
                        let index = tree.primitive_indices.get(hit).map(|&i| i as usize);
                        if let Some(t) = index.and_then(|i| intersect(triangles.get(i)?, ray)) {
                            last = last.max(t);
                        }
                    });
                }
                last.is_finite().then_some(f64::from(last))
            }
        }?;
        Some(from_mm + direction * t)
    }

    /// How deep the centre of a probe's face is below the skin along its axis, mm: negative where a gap is left, none
    /// where the probe is more than 30 mm away or points elsewhere.
    pub fn press_mm(&self, pose: &Pose) -> Option<f64> {
        let into_body = pose.orientation * DVec3::Z;
        let deep = pose.position_mm + into_body * PROBE_MM;
        Some(self.exit(deep, -into_body)?.distance(deep) - PROBE_MM)
    }
}

/// Distance along `ray` to `triangle` (Möller & Trumbore, J Graph Tools 2:21, 1997). A little more than the triangle
/// counts, so that a ray through a corner meets one of its triangles.
fn intersect(triangle: &Triangle, ray: &Ray) -> Option<f32> {
    const MORE: f64 = 1e-5;
    let d = |v: Vec3A| v.as_dvec3();
    let (a, direction) = (d(triangle.v0), d(ray.direction));
    let (ab, ac) = (d(triangle.v1) - a, d(triangle.v2) - a);
    let p = direction.cross(ac);
    let det = ab.dot(p);
    if det == 0.0 {
        return None;
    }
    let from_a = d(ray.origin) - a;
    let q = from_a.cross(ab);
    let (u, v, t) = (from_a.dot(p) / det, direction.dot(q) / det, ac.dot(q) / det);
    let inside = u >= -MORE && v >= -MORE && u + v <= 1.0 + MORE;
    (inside && t >= f64::from(ray.tmin) && t <= f64::from(ray.tmax)).then_some(t as f32)
}

/// Distance to where a line leaves the solid: the first crossing, bisected.
fn exit_solid(skin: &Solid, from: DVec3, direction: DVec3) -> Option<f64> {
    let outside = |t: f64| skin.distance_mm((from + direction * t).as_vec3()) > 0.0;
    let mut far = f64::from((1..REACH_MM).find(|&t| outside(f64::from(t)))?);
    let mut near = far - 1.0;
    for _ in 0..30 {
        let middle = 0.5 * (near + far);
        if outside(middle) { far = middle } else { near = middle }
    }
    (far > 1.0).then_some(far)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::{Mesh, Motion, Surface, TissueTable, analytic};

    #[test]
    fn a_ball_of_triangles_is_left_at_its_outside() {
        let mesh = |radius: f32| analytic::sphere(glam::Vec3::new(5.0, 0.0, 0.0), radius, 5);
        let surface = |mesh: Mesh| Surface { name: "ball".into(), tissue: 0, priority: 0, mesh };
        let tissues = TissueTable::builtin().unwrap();
        let surfaces = vec![surface(mesh(20.0)), surface(mesh(50.0))];
        let scene = Scene { tissues, background: 0, surfaces, motion: Motion::default() };
        let skin = Skin::of_scene(&scene).unwrap();
        for direction in [DVec3::X, DVec3::Y, DVec3::new(0.6, 0.0, -0.8)] {
            let exit = skin.exit(DVec3::new(5.0, 0.0, 0.0), direction).unwrap();
            assert!((exit.distance(DVec3::new(5.0, 0.0, 0.0)) - 50.0).abs() < 0.1, "{exit}");
        }
        for (i, direction) in [DVec3::Z, -DVec3::Z, -DVec3::Y, -DVec3::X].into_iter().enumerate() {
            assert!(skin.exit(DVec3::new(5.0, 0.0, 0.0), direction).is_some(), "direction {i}");
        }
        assert_eq!(skin.exit(DVec3::new(80.0, 0.0, 0.0), DVec3::X), None);
        let at = |z: f64| Pose::looking(DVec3::new(5.0, 0.0, z), DVec3::NEG_Z, DVec3::X);
        assert!((skin.press_mm(&at(47.0)).unwrap() - 3.0).abs() < 0.1);
        assert!((skin.press_mm(&at(60.0)).unwrap() + 10.0).abs() < 0.1);
        assert_eq!(skin.press_mm(&at(90.0)), None);
    }

    #[test]
    fn the_phantoms_belly_is_where_its_landmark_says() {
        let skin = Skin::phantom(&Parameters::default());
        let top = phantom::landmarks(&Parameters::default()).belly_top_mm.as_dvec3();
        let exit = skin.exit(DVec3::ZERO, DVec3::Z).unwrap();
        assert!(exit.distance(top) < 0.5, "{exit}");
        assert_eq!(skin.exit(top + DVec3::Z * 5.0, DVec3::Z), None, "starts outside");
    }
}
