//! Inward offset of a surface: the lumen within a vessel's wall, the fat within the skin.

use std::time::Duration;

use glam::{DAffine3, DVec3, Vec3, Vec3A};
use insonify_core::anatomy::doctor::{crossing, tree::Tree};
use obvhs::BvhBuildParams;
use obvhs::cwbvh::builder::build_cwbvh_from_tris;
use obvhs::ray::{Ray, RayHit};
use obvhs::triangle::Triangle;
use rayon::prelude::*;

use super::part::Part;
use super::shrunk::shrunk;
use crate::segmentation::shape::pieces_mm3;

/// Largest depth of the offset, relative to the thickness of the part along the normal.
const SHARE_MAX: f64 = 0.35;
/// Rounds of averaging depths and directions over neighbours.
const EVEN_ROUNDS: usize = 3;
/// Rounds of averaging that spread the shift at the rim of a cut face over the cut face.
const CUT_ROUNDS: usize = 60;
/// Rounds of reducing the depth where faces would turn over.
const FOLD_ROUNDS: usize = 12;
/// Smallest cosine of the angle between the normals of a face and of its offset. Faces below this limit turn over.
const TURN_MIN: f64 = 0.3;
/// Distance inward from the surface at which a ray starts, mm.
const START_MM: f64 = 1e-3;

impl Part {
    /// The surface `depth_mm` further inward. It doesn't pass through itself, and it ends at the grid's border where this surface
    /// does.
    ///
    /// Usually it has the same triangles, and in thin parts a depth of at most about a third of the thickness. Where it
    /// would cross itself so, in ears or folds, it is the surface of what lies deeper than `depth_mm`: thin parts then
    /// have nothing within.
    #[must_use]
    pub fn inward(&self, depth_mm: f64) -> Self {
        self.inward_except(depth_mm, &vec![false; self.vertices_mm.len()])
    }

    /// The surface moved inward as by [`Self::inward`], except cavities, which stay.
    #[must_use]
    pub fn outside_inward(&self, depth_mm: f64) -> Self {
        let (piece_of, volumes) = pieces_mm3(&self.mesh(&DAffine3::IDENTITY));
        let mut stays = vec![false; self.vertices_mm.len()];
        for (t, _) in self.triangles.iter().zip(&piece_of).filter(|(_, piece)| volumes[**piece as usize] < 0.0) {
            t.iter().for_each(|&v| stays[v as usize] = true);
        }
        self.inward_except(depth_mm, &stays)
    }

    fn inward_except(&self, depth_mm: f64, stays: &[bool]) -> Self {
        let moved = self.moved_inward(depth_mm, stays);
        let mesh = moved.mesh(&DAffine3::IDENTITY);
        // Shallow folds are accepted, as by the check of scenes.
        let found = Tree::new(&mesh).map(|tree| crossing::find(&tree, &[]));
        let crosses = found.is_some_and(|found| found.are_serious(mesh.triangles.len()));
        if crosses { shrunk(self, depth_mm) } else { moved }
    }

    fn moved_inward(&self, depth_mm: f64, stays: &[bool]) -> Self {
        let neighbours = self.neighbours();
        let normals = self.normals();
        // Normals are projected onto the grid's faces, so they are zero within a face that the scan cuts.
        let in_cut: Vec<bool> = normals.iter().map(|n| *n == DVec3::ZERO).collect();
        let mut depths = self.depths(&normals, depth_mm);
        depths.iter_mut().zip(stays).filter(|(_, stays)| **stays).for_each(|(depth_mm, _)| *depth_mm = 0.0);
        let mut directions = normals;
        for _ in 0..EVEN_ROUNDS {
            depths = each(&neighbours, |v, around| {
                let mean = mean(around.iter().filter(|&&w| !in_cut[w as usize]).map(|&w| depths[w as usize]));
                mean.map_or(depths[v], |mean| depths[v].min(0.5 * (mean + depths[v])))
            });
            directions = each(&neighbours, |v, around| {
                let sum: DVec3 = around.iter().map(|&w| directions[w as usize]).sum();
                self.in_border(v, directions[v] * around.len() as f64 + sum)
            });
        }
        for _ in 0..FOLD_ROUNDS {
            let inner = self.moved(&neighbours, &in_cut, &directions, &depths);
            let folds: Vec<[u32; 3]> = self.folds(&inner);
            if folds.is_empty() {
                return inner;
            }
            for v in folds.into_iter().flatten() {
                for &w in neighbours[v as usize].iter().chain([&v]) {
                    depths[w as usize] *= 0.7;
                }
            }
        }
        // Faces that still turn over are moved back to the outer surface.
        let mut inner = self.moved(&neighbours, &in_cut, &directions, &depths);
        loop {
            let folds = self.folds(&inner);
            let held: Vec<u32> = folds
                .into_iter()
                .flatten()
                .filter(|&v| inner.vertices_mm[v as usize] != self.vertices_mm[v as usize])
                .collect();
            if held.is_empty() {
                return inner;
            }
            for v in held {
                inner.vertices_mm[v as usize] = self.vertices_mm[v as usize];
            }
        }
    }

    fn moved(&self, neighbours: &[Vec<u32>], in_cut: &[bool], directions: &[DVec3], depths: &[f64]) -> Self {
        let mut shifts: Vec<DVec3> = directions.par_iter().zip(depths).map(|(n, d)| -*n * *d).collect();
        if in_cut.iter().any(|&cut| cut) {
            for (v, shift) in shifts.iter_mut().enumerate() {
                if in_cut[v] {
                    *shift = DVec3::ZERO;
                }
            }
            for _ in 0..CUT_ROUNDS {
                shifts = each(neighbours, |v, around| {
                    let mean = if in_cut[v] { mean_of(around.iter().map(|&w| shifts[w as usize])) } else { None };
                    mean.map_or(shifts[v], |mean| self.along_border(v, mean))
                });
            }
        }
        let vertices_mm = self.vertices_mm.iter().zip(&shifts).map(|(p, shift)| *p + *shift).collect();
        Self { vertices_mm, ..self.clone() }
    }

    /// Faces that turn over between this surface and `inner`, as vertex indices.
    fn folds(&self, inner: &Self) -> Vec<[u32; 3]> {
        let cross = |part: &Self, t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| part.vertices_mm[v as usize]);
            (b - a).cross(c - a)
        };
        let turned = |t: &&[u32; 3]| {
            let (outer, inner) = (cross(self, t), cross(inner, t));
            outer.dot(inner) < TURN_MIN * outer.length() * inner.length()
        };
        self.triangles.par_iter().filter(turned).copied().collect()
    }

    fn neighbours(&self) -> Vec<Vec<u32>> {
        let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); self.vertices_mm.len()];
        for &[a, b, c] in &self.triangles {
            for (v, w) in [(a, b), (b, c), (c, a)] {
                // The other face at the edge adds the opposite direction.
                neighbours[v as usize].push(w);
            }
        }
        neighbours
    }

    /// The vector `v` without components perpendicular to the grid's faces on which the vertex lies.
    fn along_border(&self, vertex: usize, mut v: DVec3) -> DVec3 {
        let border = self.borders[vertex] | self.borders[vertex] >> 3;
        (0..3).filter(|axis| border >> axis & 1 == 1).for_each(|axis| v[axis] = 0.0);
        v
    }

    fn in_border(&self, vertex: usize, direction: DVec3) -> DVec3 {
        let along = self.along_border(vertex, direction);
        // For a vertex within a cut face, the projection leaves only rounding errors.
        if along.length() > 1e-6 * direction.length().max(1e-12) { along.normalize_or_zero() } else { DVec3::ZERO }
    }

    /// Unit normal of each vertex, projected onto the grid's faces for vertices on these faces; zero within a cut face.
    fn normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.vertices_mm.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|v| self.vertices_mm[v as usize]);
            let area = (b - a).cross(c - a);
            t.iter().for_each(|&v| normals[v as usize] += area);
        }
        normals.into_iter().enumerate().map(|(v, n)| self.in_border(v, n.normalize_or_zero())).collect()
    }

    /// Depth of the offset at each vertex, mm: `depth_mm`, or less where the part is thin along the normal.
    fn depths(&self, normals: &[DVec3], depth_mm: f64) -> Vec<f64> {
        let corner = |v: u32| Vec3A::from(self.vertices_mm[v as usize].as_vec3());
        let triangle = |t: &[u32; 3]| Triangle { v0: corner(t[0]), v1: corner(t[1]), v2: corner(t[2]) };
        let triangles: Vec<Triangle> = self.triangles.iter().map(triangle).collect();
        if triangles.is_empty() {
            return Vec::new();
        }
        let tree = build_cwbvh_from_tris(&triangles, BvhBuildParams::fast_build(), &mut Duration::default());
        let depth = |(v, normal): (usize, &DVec3)| {
            if *normal == DVec3::ZERO {
                return 0.0;
            }
            let inside = -self.off_border(v) * 0.1 - *normal * START_MM;
            let origin = (self.vertices_mm[v] + inside).as_vec3();
            let reach = (depth_mm / SHARE_MAX) as f32;
            // The ray is tilted slightly, since the tree loses rays parallel to an axis.
            let along = -normal.as_vec3() + Vec3::new(1.3e-3, 0.7e-3, 1.1e-3);
            let ray = Ray::new(origin.into(), along.normalize().into(), 2.0 * START_MM as f32, reach);
            let mut hit = RayHit::none();
            let found = tree.ray_traverse(ray, &mut hit, |ray, id| {
                let index = tree.primitive_indices.get(id).map_or(0, |&i| i as usize);
                triangles.get(index).map_or(f32::INFINITY, |t| t.intersect(ray))
            });
            if found { depth_mm.min(SHARE_MAX * f64::from(hit.t)) } else { depth_mm }
        };
        normals.par_iter().enumerate().map(depth).collect()
    }

    /// Outward direction, not of unit length, of the grid's faces on which a vertex lies; zero for inner vertices.
    fn off_border(&self, vertex: usize) -> DVec3 {
        let bits = self.borders[vertex];
        let along = |axis: u8| f64::from(bits >> (axis + 3) & 1) - f64::from(bits >> axis & 1);
        DVec3::new(along(0), along(1), along(2))
    }
}

fn each<T: Send>(neighbours: &[Vec<u32>], f: impl Fn(usize, &[u32]) -> T + Sync) -> Vec<T> {
    neighbours.par_iter().enumerate().map(|(v, around)| f(v, around)).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

fn mean_of(values: impl Iterator<Item = DVec3>) -> Option<DVec3> {
    let (sum, count) = values.fold((DVec3::ZERO, 0), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}
