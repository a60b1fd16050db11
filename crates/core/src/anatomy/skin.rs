//! Skin of a scene: its outer surface, on which the probe is placed.

use std::time::Duration;

use glam::{DQuat, DVec3, Vec3};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::Ray;
use obvhs::triangle::Triangle;

use super::ray::intersect;
use super::sdf::Solid;
use super::{BvhError, Scene};
use crate::pose::Pose;

/// Search length from inside a body to its skin, mm; exceeds any such distance.
const REACH_MM: u32 = 400;

/// Search length from a point to the skin in any direction, mm: more than the height of a body.
const BODY_MM: f32 = 3000.0;

/// Search length from a probe's face along its axis, mm. It exceeds the sum of the thickest gel, the widest coupling
/// gap and the largest tolerance.
const PROBE_MM: f64 = 30.0;

/// Offset of the two parallel rays that test one line, mm, to opposite sides. A ray exactly along the border between
/// two boxes may miss both boxes; an offset ray does not.
const ASIDE_MM: DVec3 = DVec3::new(1.3e-3, 0.7e-3, 1.1e-3);

/// Number of the six axis directions in which a point inside the body must have skin. A scanned body may be open on one
/// side.
const ENCLOSED: usize = 5;

/// Skin of a scene: the outer surface on which the probe is placed.
pub struct Skin {
    outside: Outside,
    /// Outermost surfaces of the whole scene. Present only if the skin does not surround the scene's middle: the skin
    /// may then be a slab over other tissues.
    body: Option<Box<Skin>>,
}

impl std::fmt::Debug for Skin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let triangles = match &self.outside {
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
    pub fn of_solid(solid: Solid) -> Self {
        Self { outside: Outside::Solid(solid), body: None }
    }

    /// Outermost surfaces of `scene`.
    ///
    /// # Errors
    /// A scene without triangles.
    pub fn of_scene(scene: &Scene) -> Result<Self, BvhError> {
        Self::of_triangles(scene.surfaces.iter().flat_map(|surface| surface.mesh.corners_mm()))
    }

    /// Outermost surfaces among triangles, given by their corners, mm.
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
        Ok(Self { outside: Outside::Mesh { tree, triangles }, body: None })
    }

    /// The skin as a part of a scene whose triangles are `all`. If the skin does not surround the middle of the scene,
    /// these triangles decide between inside and outside.
    #[must_use]
    pub fn within(mut self, all: impl IntoIterator<Item = [Vec3; 3]>) -> Self {
        let all: Vec<[Vec3; 3]> = all.into_iter().collect();
        let low = all.iter().flatten().fold(Vec3::INFINITY, |low, corner| low.min(*corner));
        let high = all.iter().flatten().fold(Vec3::NEG_INFINITY, |high, corner| high.max(*corner));
        let is_part = matches!(&self.outside, Outside::Mesh { triangles, .. } if triangles.len() < all.len());
        if is_part && self.depth_mm((0.5 * (low + high)).as_dvec3(), DQuat::IDENTITY).is_none() {
            self.body = Self::of_triangles(all).ok().map(Box::new);
        }
        self
    }

    /// Surface that decides between inside and outside: the skin itself, or the surface of the whole scene.
    pub(crate) fn body(&self) -> &Self {
        self.body.as_deref().unwrap_or(self)
    }

    /// Smallest distance from a point in the body to the skin, mm, along the positive and negative axes of `axes`.
    /// `None` for a point outside, which has skin in fewer than five of these six directions.
    pub(crate) fn depth_mm(&self, from_mm: DVec3, axes: DQuat) -> Option<f64> {
        let ways = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z];
        let ways = ways.into_iter().filter_map(|axis| self.way_out_mm(from_mm, axes * axis));
        let (count, least_mm) = ways.fold((0, f64::INFINITY), |(count, least), mm| (count + 1, mm.min(least)));
        (count >= ENCLOSED).then_some(least_mm)
    }

    /// Exit point of the line that starts at `from_mm` inside the body and runs along the unit `direction`. For a mesh,
    /// it is the last surface hit. `None` if the line hits no skin within 400 mm, or starts outside a solid.
    pub fn exit(&self, from_mm: DVec3, direction: DVec3) -> Option<DVec3> {
        Some(from_mm + direction * self.exit_mm(from_mm, direction, REACH_MM as f32)?)
    }

    /// Distance from `from_mm` to the exit point as in [`Skin::exit`], mm. A mesh is searched up to 3 m, a solid up to
    /// 400 mm.
    pub fn way_out_mm(&self, from_mm: DVec3, direction: DVec3) -> Option<f64> {
        self.exit_mm(from_mm, direction, BODY_MM)
    }

    /// Distance from `from_mm` to the exit point, mm. A mesh is searched up to `reach_mm`, a solid up to 400 mm.
    fn exit_mm(&self, from_mm: DVec3, direction: DVec3, reach_mm: f32) -> Option<f64> {
        match &self.outside {
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

    /// Distance of a point inside or outside from the nearest skin, mm. A mesh takes milliseconds: all triangles are
    /// visited.
    pub fn distance_mm(&self, from_mm: DVec3) -> f64 {
        match &self.outside {
            Outside::Solid(skin) => f64::from(skin.distance_mm(from_mm.as_vec3())).abs(),
            Outside::Mesh { triangles, .. } => {
                let corners = |t: &Triangle| [t.v0, t.v1, t.v2].map(|corner| Vec3::from(corner).as_dvec3());
                triangles.iter().map(|t| from_triangle_mm(corners(t), from_mm)).fold(f64::INFINITY, f64::min)
            }
        }
    }

    /// Depth of the centre of the probe's face below the skin along the probe's axis, mm; negative for a gap. `None` if
    /// the probe is more than 30 mm away or points elsewhere.
    pub fn press_mm(&self, pose: &Pose) -> Option<f64> {
        let into_body = pose.orientation * DVec3::Z;
        let deep = pose.position_mm + into_body * PROBE_MM;
        Some(self.exit(deep, -into_body)?.distance(deep) - PROBE_MM)
    }
}

/// Distance along `ray` to `triangle`, mm; `None` if the ray misses it.
fn distance_mm(triangle: &Triangle, ray: &Ray) -> Option<f32> {
    /// Enlargement of triangles relative to their size, so that a ray through a shared corner hits at least one of
    /// them.
    const MARGIN: f64 = 1e-5;
    let corners = [triangle.v0, triangle.v1, triangle.v2].map(Vec3::from);
    let (t, _) = intersect(corners, MARGIN, ray.origin.as_dvec3(), ray.direction.as_dvec3())?;
    (f64::from(ray.tmin)..=f64::from(ray.tmax)).contains(&t).then_some(t as f32)
}

/// Distance of a point from a triangle, mm.
fn from_triangle_mm([a, b, c]: [DVec3; 3], from_mm: DVec3) -> f64 {
    let normal = (b - a).cross(c - a);
    let edges = [(a, b), (b, c), (c, a)];
    let is_above = edges.iter().all(|(from, to)| normal.cross(*to - *from).dot(from_mm - *from) >= 0.0);
    if is_above && normal.length() > 0.0 {
        return ((from_mm - a).dot(normal) / normal.length()).abs();
    }
    let from_edge = |(from, to): (DVec3, DVec3)| {
        let along = to - from;
        let part = ((from_mm - from).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        from_mm.distance(from + along * part)
    };
    edges.into_iter().map(from_edge).fold(f64::INFINITY, f64::min)
}

/// Distance from `from` to the exit from the solid, mm: the first crossing, refined by bisection.
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

    #[test]
    fn the_distance_is_that_of_the_nearest_point_on_the_skin() {
        let mesh = analytic::cuboid(Vec3::ZERO, Vec3::splat(10.0));
        let cube = Skin::of_triangles(mesh.corners_mm()).unwrap();
        let ball = Skin::of_solid(crate::anatomy::sdf::sphere(Vec3::ZERO, 10.0));
        for (from, expected) in [
            ([4.0, 3.0, 12.0], 2.0),
            ([4.0, 3.0, 9.0], 1.0),
            ([13.0, 14.0, 5.0], 5.0),
            ([12.0, 12.0, 11.0], 3.0),
            ([-300.0, 5.0, 5.0], 300.0),
        ] {
            assert!((cube.distance_mm(DVec3::from(from)) - expected).abs() < 1e-4, "{from:?}");
        }
        assert!((ball.distance_mm(DVec3::X * 13.0) - 3.0).abs() < 1e-4);
        assert!((ball.distance_mm(DVec3::X * 9.0) - 1.0).abs() < 1e-4);
        // A triangle without an area, and one that is a point.
        assert!((from_triangle_mm([DVec3::ZERO, DVec3::X, DVec3::X * 2.0], DVec3::Y) - 1.0).abs() < 1e-12);
        assert!((from_triangle_mm([DVec3::ZERO; 3], DVec3::Y * 2.0) - 2.0).abs() < 1e-12);
    }
}
