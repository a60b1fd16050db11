//! Winding number of a surface about a point, and the nearest point of the surface.
//!
//! The number is the solid angle that the surface covers, over 4π. It is 1 within a closed surface and 0 outside. Around
//! an open one it passes 0.5 where a soap film would close the hole; within a plane rim, in the rim's plane
//! (Jacobson 2013). Clusters of distant triangles count by the first two terms of a series (Barill 2018).

use std::f64::consts::TAU;

use glam::{DMat3, DVec3, Vec3};

/// Most triangles of a cluster that isn't divided.
const LEAF: usize = 8;
/// Distance from which a cluster counts by its series, in radii of the cluster; where the number is near 0.5, the second.
const FAR: [f64; 2] = [3.0, 6.0];
/// Distance from 0.5 below which the number is computed with the second of [`FAR`].
const CLOSE: f64 = 0.15;

/// A cluster of triangles. Its descendants follow it, up to `next`.
struct Cluster {
    centre_mm: DVec3,
    /// Distance of the farthest corner from the centre, mm.
    radius_mm: f64,
    /// Sum of the triangles' normals, each as long as its triangle's area, mm².
    area_mm2: DVec3,
    /// Sum of n dᵀ over the triangles: normal as above, and place of the triangle's middle from the centre, mm³.
    spread_mm3: DMat3,
    /// Range of the triangles in [`Winding::triangles`].
    range: [u32; 2],
    /// Index of the first cluster that is no descendant.
    next: u32,
}

/// Clusters of a surface's triangles.
pub struct Winding {
    clusters: Vec<Cluster>,
    /// Triangles, in the order of the clusters.
    triangles: Vec<Corners>,
}

/// Corners of a triangle, mm, and its index.
type Corners = ([DVec3; 3], u32);

/// Crossing of a line segment and a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Place along the segment, 0..=1.
    pub share: f64,
    /// Unit normal of the triangle.
    pub normal: DVec3,
    /// Index of the triangle.
    pub triangle: u32,
}

impl Winding {
    /// Clusters of the triangles with these corners, mm.
    pub fn of(corners: impl Iterator<Item = [Vec3; 3]>) -> Self {
        let triangles = corners.map(|corners| corners.map(|v| v.as_dvec3())).zip(0..).collect();
        let mut winding = Self { clusters: Vec::new(), triangles };
        winding.divide(0, winding.triangles.len());
        winding
    }

    /// Adds the cluster of a range of triangles, and its descendants.
    fn divide(&mut self, from: usize, to: usize) {
        let own = &mut self.triangles[from..to];
        if own.is_empty() {
            return;
        }
        let area = |([a, b, c], _): &Corners| 0.5 * (b - a).cross(c - a);
        let middle = |([a, b, c], _): &Corners| (a + b + c) / 3.0;
        let weight: f64 = own.iter().map(|t| area(t).length()).sum();
        let sum: DVec3 = own.iter().map(|t| area(t).length() * middle(t)).sum();
        let centre_mm = if weight > 0.0 { sum / weight } else { middle(&own[0]) };
        let farthest =
            own.iter().flat_map(|(corners, _)| corners).map(|v| v.distance_squared(centre_mm)).fold(0.0, f64::max);
        let index = self.clusters.len();
        self.clusters.push(Cluster {
            centre_mm,
            radius_mm: farthest.sqrt(),
            area_mm2: own.iter().map(area).sum(),
            spread_mm3: own.iter().map(|t| spread(area(t), middle(t) - centre_mm)).fold(DMat3::ZERO, |a, b| a + b),
            range: [from as u32, to as u32],
            next: 0,
        });
        if own.len() > LEAF {
            let low = own.iter().map(middle).fold(DVec3::INFINITY, DVec3::min);
            let size = own.iter().map(middle).fold(DVec3::NEG_INFINITY, DVec3::max) - low;
            let axis = (0..3).fold(0, |best, axis| if size[axis] > size[best] { axis } else { best });
            let half = own.len() / 2;
            own.select_nth_unstable_by(half, |s, t| middle(s)[axis].total_cmp(&middle(t)[axis]));
            self.divide(from, from + half);
            self.divide(from + half, to);
        }
        self.clusters[index].next = self.clusters.len() as u32;
    }

    /// Calls `of` with each cluster; descends if it returns true. Calls `each` with the triangles of clusters without
    /// descendants.
    fn visit(&self, mut of: impl FnMut(&Cluster) -> bool, mut each: impl FnMut(&Corners)) {
        let mut at = 0;
        while let Some(cluster) = self.clusters.get(at) {
            let is_leaf = cluster.next as usize == at + 1;
            if !of(cluster) {
                at = cluster.next as usize;
                continue;
            }
            if is_leaf {
                self.triangles[cluster.range[0] as usize..cluster.range[1] as usize].iter().for_each(&mut each);
            }
            at += 1;
        }
    }

    /// Winding number about a point.
    pub fn number(&self, at_mm: DVec3) -> f64 {
        let rough = self.with(at_mm, FAR[0]);
        if (rough - 0.5).abs() < CLOSE { self.with(at_mm, FAR[1]) } else { rough }
    }

    fn with(&self, at_mm: DVec3, far: f64) -> f64 {
        let dipoles = std::cell::Cell::new(0.0);
        let mut angles = Angles::default();
        let is_near = |cluster: &Cluster| {
            let to = cluster.centre_mm - at_mm;
            let square = to.length_squared();
            if square <= (far * cluster.radius_mm).powi(2) {
                return true;
            }
            // First and second term of the solid angle's series.
            let spread = &cluster.spread_mm3;
            let trace = spread.x_axis.x + spread.y_axis.y + spread.z_axis.z;
            let second = trace - 3.0 * to.dot(*spread * to) / square;
            dipoles.set(dipoles.get() + (cluster.area_mm2.dot(to) + second) / (square * square.sqrt()));
            false
        };
        self.visit(is_near, |(corners, _)| angles.add(corners.map(|corner| corner - at_mm)));
        (dipoles.get() + angles.sum()) / (2.0 * TAU)
    }

    /// Nearest point of the surface that is nearer than `within_mm`.
    pub fn nearest(&self, at_mm: DVec3, within_mm: f64) -> Option<DVec3> {
        self.nearest_on(at_mm, within_mm).map(|(point, _)| point)
    }

    /// Nearest point of the surface that is nearer than `within_mm`, and the corners of its triangle.
    pub fn nearest_on(&self, at_mm: DVec3, within_mm: f64) -> Option<(DVec3, [DVec3; 3])> {
        let best = std::cell::Cell::new(within_mm);
        let mut found = None;
        let may_hold = |cluster: &Cluster| cluster.centre_mm.distance(at_mm) - cluster.radius_mm < best.get();
        self.visit(may_hold, |&(corners, _)| {
            let point = nearest_of(corners, at_mm);
            let distance = point.distance(at_mm);
            if distance < best.get() {
                best.set(distance);
                found = Some((point, corners));
            }
        });
        found
    }

    /// Triangles that may lie within `radius_mm` of a point, and perhaps some farther ones.
    pub fn near(&self, at_mm: DVec3, radius_mm: f64) -> Vec<[DVec3; 3]> {
        let mut near = Vec::new();
        let may_hold = |cluster: &Cluster| cluster.centre_mm.distance(at_mm) <= cluster.radius_mm + radius_mm;
        self.visit(may_hold, |&(corners, _)| near.push(corners));
        near
    }

    /// Crossings of the segment from `from_mm` to `to_mm` with the surface, in order.
    pub fn hits(&self, from_mm: DVec3, to_mm: DVec3) -> Vec<Hit> {
        let (middle, half) = (0.5 * (from_mm + to_mm), 0.5 * from_mm.distance(to_mm));
        let mut hits = Vec::new();
        let may_hold = |cluster: &Cluster| cluster.centre_mm.distance(middle) <= cluster.radius_mm + half;
        self.visit(may_hold, |&triangle| hits.extend(hit(triangle, from_mm, to_mm)));
        hits.sort_by(|a: &Hit, b| a.share.total_cmp(&b.share));
        hits
    }
}

/// The matrix n dᵀ.
fn spread(n: DVec3, d: DVec3) -> DMat3 {
    DMat3::from_cols(n * d.x, n * d.y, n * d.z)
}

/// Sum of the solid angles of triangles about the origin, steradian: positive for triangles that face away.
///
/// Half a solid angle is the angle of a complex number (Van Oosterom and Strackee 1983). The angle of the numbers'
/// product is the sum of their angles, except for whole turns, which are counted.
struct Angles {
    real: f64,
    imaginary: f64,
    turns: f64,
}

impl Default for Angles {
    fn default() -> Self {
        Self { real: 1.0, imaginary: 0.0, turns: 0.0 }
    }
}

impl Angles {
    fn add(&mut self, [a, b, c]: [DVec3; 3]) {
        let [la, lb, lc] = [a, b, c].map(DVec3::length);
        let real = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        let imaginary = a.dot(b.cross(c));
        let size = real.abs() + imaginary.abs();
        if size == 0.0 {
            // The origin is a corner.
            return;
        }
        let product = [self.real * real - self.imaginary * imaginary, self.real * imaginary + self.imaginary * real];
        match (self.imaginary >= 0.0, imaginary >= 0.0, product[1] >= 0.0) {
            (true, true, false) => self.turns += 1.0,
            (false, false, true) => self.turns -= 1.0,
            _ => {}
        }
        let scale = 1.0 / (product[0].abs() + product[1].abs());
        (self.real, self.imaginary) = (scale * product[0], scale * product[1]);
    }

    fn sum(&self) -> f64 {
        2.0 * (self.imaginary.atan2(self.real) + TAU * self.turns)
    }
}

/// Crossing of a segment and a triangle.
fn hit(([a, b, c], triangle): Corners, from: DVec3, to: DVec3) -> Option<Hit> {
    let normal = (b - a).cross(c - a);
    let [start, end] = [from, to].map(|p| normal.dot(p - a));
    if start == end || start * end > 0.0 {
        return None;
    }
    let share = start / (start - end);
    let at = from.lerp(to, share);
    let within = [(a, b), (b, c), (c, a)].iter().all(|(u, v)| (*v - *u).cross(at - *u).dot(normal) >= 0.0);
    within.then_some(Hit { share, normal: normal.normalize_or_zero(), triangle })
}

/// Point of a triangle nearest to `p` (Ericson 2005, section 5.1.5).
fn nearest_of([a, b, c]: [DVec3; 3], p: DVec3) -> DVec3 {
    let (ab, ac) = (b - a, c - a);
    let [d1, d2] = [ab, ac].map(|side| side.dot(p - a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let [d3, d4] = [ab, ac].map(|side| side.dot(p - b));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let [d5, d6] = [ab, ac].map(|side| side.dot(p - c));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let scale = 1.0 / (va + vb + vc);
    a + ab * (vb * scale) + ac * (vc * scale)
}

#[cfg(test)]
mod tests {
    use insonify_core::anatomy::Mesh;
    use insonify_core::anatomy::analytic::sphere;

    use super::*;

    /// A sphere of 20 mm about (5, −3, 40) mm, without the part above `top_mm`.
    fn bowl(top_mm: f32) -> Mesh {
        let mut mesh = sphere(Vec3::new(5.0, -3.0, 40.0), 20.0, 5);
        let at = mesh.vertices_mm.clone();
        mesh.triangles.retain(|t| t.iter().all(|&v| at[v as usize].z < top_mm));
        mesh
    }

    #[test]
    fn a_closed_surface_winds_once_about_what_is_inside() {
        let winding = Winding::of(bowl(100.0).corners_mm());
        let centre = DVec3::new(5.0, -3.0, 40.0);
        for (x, expected) in [(0.0, 1.0), (19.0, 1.0), (21.0, 0.0), (25.0, 0.0), (300.0, 0.0)] {
            let number = winding.number(centre + DVec3::X * x);
            assert!((number - expected).abs() < 0.05, "{x}: {number}");
        }
    }

    #[test]
    fn the_number_of_a_bowl_is_one_half_in_the_plane_of_its_rim() {
        let mut mesh = bowl(45.0);
        // The rim is moved into the plane.
        mesh.vertices_mm.iter_mut().filter(|v| v.z > 43.0).for_each(|v| v.z = 45.0);
        let winding = Winding::of(mesh.corners_mm());
        for x in [0.0, 4.0, 8.0] {
            let number = winding.number(DVec3::new(5.0 + x, -3.0, 45.0));
            assert!((number - 0.5).abs() < 0.01, "{x}: {number}");
        }
    }

    #[test]
    fn the_sum_of_solid_angles_counts_whole_turns() {
        // Spheres about the origin, one within the other, facing outward and inward.
        let ball = |radius_mm: f32| sphere(Vec3::ZERO, radius_mm, 2);
        let mut inward = ball(7.0);
        inward.flip();
        for (meshes, expected) in [
            (vec![ball(10.0), ball(20.0), ball(30.0)], 3.0),
            (vec![ball(10.0), inward.clone()], 0.0),
            (vec![inward], -1.0),
        ] {
            let mut angles = Angles::default();
            meshes.iter().flat_map(|mesh| mesh.corners_mm()).for_each(|c| angles.add(c.map(|v| v.as_dvec3())));
            assert!((angles.sum() / (2.0 * TAU) - expected).abs() < 1e-9, "{}", angles.sum());
        }
    }

    #[test]
    fn the_nearest_point_and_the_crossings_are_those_of_all_triangles() {
        let mesh = bowl(50.0);
        let winding = Winding::of(mesh.corners_mm());
        let all = || mesh.corners_mm().map(|c| c.map(|v| v.as_dvec3()));
        for at in [DVec3::new(9.0, 2.0, 44.0), DVec3::new(5.0, -3.0, 58.0), DVec3::new(-60.0, 3.0, 1.0)] {
            let least = all().map(|c| nearest_of(c, at).distance(at)).fold(f64::INFINITY, f64::min);
            assert!((winding.nearest(at, 1e3).unwrap().distance(at) - least).abs() < 1e-9);
            assert_eq!(winding.nearest(at, least - 1e-6), None);
            let to = DVec3::new(30.0, -9.0, 30.0);
            assert_eq!(winding.hits(at, to).len(), all().filter_map(|c| hit((c, 0), at, to)).count());
        }
    }
}
