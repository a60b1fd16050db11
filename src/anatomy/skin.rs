//! Skin of a scene: its outer surface, where a probe touches.

use std::time::Duration;

use glam::{DVec3, Vec3};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;

use super::ray::intersect;
use super::sdf::Solid;
use super::{BvhError, Scene};
use crate::pose::Pose;

/// Search length, mm; exceeds any distance from inside a body to its skin.
const REACH_MM: u32 = 400;

/// Search length for the skin around a point, mm: beyond the height of any body.
const BODY_MM: f32 = 3000.0;

/// Search length in front of a probe's face, mm: more than the thickest gel, the gap that couples, and the largest
/// tolerance together.
const PROBE_MM: f64 = 30.0;

/// Sideways offset of test rays, mm: a ray exactly along a box's border may miss the box; rays on both sides do not.
const ASIDE_MM: DVec3 = DVec3::new(1.3e-3, 0.7e-3, 1.1e-3);

/// Outer surface of a scene.
pub struct Skin(Outside);

impl std::fmt::Debug for Skin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let triangles = match &self.0 {
            Outside::Solid(_) => None,
            Outside::Mesh { triangles, .. } => Some(triangles.len()),
        };
        f.debug_struct("Skin").field("triangles", &triangles).finish()
    }
}

enum Outside {
    Solid(Solid),
    Mesh { tree: CwBvh, triangles: Vec<Triangle> },
}

impl Skin {
    /// Surface of a solid.
    pub(crate) fn of_solid(solid: Solid) -> Self {
        Self(Outside::Solid(solid))
    }

    /// Outermost surfaces of `scene`.
    ///
    /// # Errors
    /// A scene without triangles.
    pub fn of_scene(scene: &Scene) -> Result<Self, BvhError> {
        Self::of_triangles(scene.surfaces.iter().flat_map(|surface| surface.mesh.corners_mm()))
    }

    /// Outermost of the triangles with these corners, mm.
    ///
    /// # Errors
    /// No triangle.
    pub fn of_triangles(corners: impl IntoIterator<Item = [Vec3; 3]>) -> Result<Self, BvhError> {
        let triangle = |[a, b, c]: [Vec3; 3]| Triangle { v0: a.into(), v1: b.into(), v2: c.into() };
        let triangles: Vec<Triangle> = corners.into_iter().map(triangle).collect();
        if triangles.is_empty() {
            return Err(BvhError::Empty);
        }
        let tree = build_cwbvh_from_tris(&triangles, BvhBuildParams::medium_build(), &mut Duration::default());
        Ok(Self(Outside::Mesh { tree, triangles }))
    }

    /// Exit point of the line from `from_mm` inside the body along the unit `direction`; for a mesh, the last surface
    /// hit. `None` if the line hits no skin within 400 mm, or starts outside a solid.
    pub fn exit(&self, from_mm: DVec3, direction: DVec3) -> Option<DVec3> {
        Some(from_mm + direction * self.exit_mm(from_mm, direction, REACH_MM as f32)?)
    }

    /// Distance to the exit point of [`Skin::exit`], mm. A mesh is searched up to 3 m, a solid up to 400 mm.
    pub fn way_out_mm(&self, from_mm: DVec3, direction: DVec3) -> Option<f64> {
        self.exit_mm(from_mm, direction, BODY_MM)
    }

    /// Distance to the exit point, mm. A mesh is searched up to `reach_mm`, a solid up to 400 mm.
    fn exit_mm(&self, from_mm: DVec3, direction: DVec3, reach_mm: f32) -> Option<f64> {
        match &self.0 {
            Outside::Solid(skin) => exit_solid(skin, from_mm, direction),
            Outside::Mesh { tree, triangles } => {
                let mut last = f32::NEG_INFINITY;
                for aside_mm in [ASIDE_MM, -ASIDE_MM] {
                    // The tree drops rays parallel to an axis; the offsets tilt them.
                    let along = (direction + aside_mm * 1e-3).as_vec3a();
                    let origin = (from_mm + aside_mm).as_vec3a();
                    tree.ray_traverse_anyhit(Ray::new(origin, along, 0.0, reach_mm), |ray, hit| {
                        let index = tree.primitive_indices.get(hit).map(|&i| i as usize);
                        if let Some(t) = index.and_then(|i| distance_mm(triangles.get(i)?, ray)) {
                            last = last.max(t);
                        }
                    });
                }
                last.is_finite().then_some(f64::from(last))
            }
        }
    }

    /// Depth of the probe face's centre below the skin along its axis, mm. Negative for a gap; `None` if the probe is
    /// more than 30 mm away or points elsewhere.
    pub fn press_mm(&self, pose: &Pose) -> Option<f64> {
        let into_body = pose.orientation * DVec3::Z;
        let deep = pose.position_mm + into_body * PROBE_MM;
        Some(self.exit(deep, -into_body)?.distance(deep) - PROBE_MM)
    }
}

/// Distance along `ray` to `triangle`.
fn distance_mm(triangle: &Triangle, ray: &Ray) -> Option<f32> {
    /// Enlargement of triangles, which makes a ray through a corner hit at least one of them.
    const MARGIN: f64 = 1e-5;
    let corners = [triangle.v0, triangle.v1, triangle.v2].map(Vec3::from);
    let (t, _) = intersect(corners, MARGIN, ray.origin.as_dvec3(), ray.direction.as_dvec3())?;
    (f64::from(ray.tmin)..=f64::from(ray.tmax)).contains(&t).then_some(t as f32)
}

/// Distance to the exit from the solid: the first crossing, refined by bisection.
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
    use crate::anatomy::{TissueTable, analytic};

    #[test]
    fn the_exit_from_a_ball_of_triangles_is_its_outer_side() {
        let ball = |radius: f32| {
            let mesh = analytic::sphere(Vec3::new(5.0, 0.0, 0.0), radius, 5);
            analytic::Part { name: "ball", tissue: "water", priority: 0, mesh }
        };
        let scene = analytic::scene(vec![ball(20.0), ball(50.0)], &TissueTable::builtin().unwrap(), "gel").unwrap();
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
}
