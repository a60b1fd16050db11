//! Intersecting triangles of one surface.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::RESOLUTION_MM;
use super::finding::Region;
use super::tree::Tree;
use crate::anatomy::Mesh;

/// Depth of a crossing below which it counts as shallow, mm: about half a wavelength at 8 MHz.
const SHALLOW_MM: f64 = 0.1;

/// Parts only touch if the extent of all their crossings is below this, mm. Depth alone doesn't tell: a crossing is
/// never deeper than its triangles are large, so finely meshed parts that overlap have shallow crossings.
const TOUCH_MM: f32 = 1.0;

/// Smallest number of crossing pairs that count as an overlap of two solids; fewer are a fold.
const RING: usize = 3;

/// Crossings of triangles in a surface.
pub struct Crossings {
    /// Number of triangle pairs that cross because two parts overlap, or two distant regions of one part.
    pub overlaps: usize,
    /// Number of crossing pairs that are near neighbours or cross shallowly: creases left by decimation.
    pub folds: usize,
    /// Region of all overlaps, then region of a single overlap; without overlaps, the same for the folds.
    pub regions: Vec<Region>,
}

/// Folds are accepted up to one in this number of a surface's triangles.
const FOLDS_ONE_IN: usize = 25;

impl Crossings {
    /// Whether there are more folds than decimation leaves, in a surface of so many triangles.
    pub fn is_crumpled(&self, triangles: usize) -> bool {
        self.folds * FOLDS_ONE_IN > triangles
    }

    /// Whether the surface, of so many triangles, passes through itself or is crumpled.
    pub fn are_serious(&self, triangles: usize) -> bool {
        self.overlaps > 0 || self.is_crumpled(triangles)
    }
}

/// A crossing of two triangles.
#[derive(Debug, Clone, Copy)]
pub struct Pair {
    /// Indices of the two triangles.
    pub triangles: [u32; 2],
    /// A point of the crossing, mm.
    pub point: Vec3,
    /// Depth by which one triangle penetrates the other, mm.
    pub depth_mm: f64,
}

/// Counts pairs of triangles that cross by more than the tracer's resolution. `part_of` gives the index of each
/// triangle's connected part; it is empty if unknown.
pub fn find(tree: &Tree<'_>, part_of: &[u32]) -> Crossings {
    let mesh = tree.mesh;
    let found = pairs(tree);
    let neighbours = if found.is_empty() { Vec::new() } else { triangles_at_vertices(mesh) };
    let part = |t: u32| part_of.get(t as usize);
    let parts_of = |pair: &Pair| {
        let [a, b] = pair.triangles.map(part);
        [a.min(b), a.max(b)]
    };
    let mut rings: HashMap<_, Vec<Vec3>> = HashMap::new();
    for pair in &found {
        rings.entry(parts_of(pair)).or_default().push(pair.point);
    }
    let wide: HashMap<_, bool> =
        rings.into_iter().map(|(parts, points)| (parts, Region::of(points).size_mm >= TOUCH_MM)).collect();
    let is_fold = |pair: &&Pair| {
        let ([t, u], parts) = (pair.triangles, parts_of(pair));
        let is_shallow = pair.depth_mm < SHALLOW_MM;
        if parts[0] == parts[1] { is_shallow || are_near(mesh, &neighbours, t, u) } else { is_shallow && !wide[&parts] }
    };
    let (mut folds, mut overlaps): (Vec<&Pair>, Vec<&Pair>) = found.iter().partition(is_fold);
    if overlaps.len() < RING {
        folds.append(&mut overlaps);
    }
    let shown = if overlaps.is_empty() { &folds } else { &overlaps };
    let mut regions = vec![Region::of(shown.iter().map(|pair| pair.point))];
    regions.extend(shown.first().filter(|_| shown.len() > 1).map(|pair| Region::of([pair.point])));
    Crossings { overlaps: overlaps.len(), folds: folds.len(), regions }
}

/// Pairs of triangles that cross by more than the tracer's resolution.
pub fn pairs(tree: &Tree<'_>) -> Vec<Pair> {
    let mesh = tree.mesh;
    (0..mesh.triangles.len() as u32)
        .into_par_iter()
        .with_min_len(256)
        .flat_map_iter(|t| {
            let mut pairs = Vec::new();
            tree.near(mesh.corners_of(t), |u| {
                if let Some((point, depth_mm)) = (u > t).then(|| cross(mesh, t, u)).flatten() {
                    pairs.push(Pair { triangles: [t, u], point: point.as_vec3(), depth_mm });
                }
            });
            pairs
        })
        .collect()
}

/// Indices of the triangles at each vertex.
fn triangles_at_vertices(mesh: &Mesh) -> Vec<Vec<u32>> {
    let mut at = vec![Vec::new(); mesh.vertices_mm.len()];
    for (t, index) in mesh.triangles.iter().zip(0u32..) {
        t.iter().for_each(|&vertex| at[vertex as usize].push(index));
    }
    at
}

/// Whether some triangle shares a vertex with both triangles.
fn are_near(mesh: &Mesh, at_vertex: &[Vec<u32>], first: u32, second: u32) -> bool {
    let second = mesh.triangles[second as usize];
    let around = mesh.triangles[first as usize].into_iter().flat_map(|vertex| &at_vertex[vertex as usize]);
    around.copied().any(|t| mesh.triangles[t as usize].iter().any(|vertex| second.contains(vertex)))
}

/// Point and depth (mm) of the crossing of two triangles; `None` if they don't cross.
pub fn cross(mesh: &Mesh, first: u32, second: u32) -> Option<(DVec3, f64)> {
    let [a, b] = [first, second].map(|t| mesh.triangles[t as usize]);
    // Triangles with a common edge touch only there.
    if a.iter().filter(|i| b.contains(i)).count() > 1 {
        return None;
    }
    let [at, bt] = [first, second].map(|t| mesh.corners_of(t).map(|v| v.as_dvec3()));
    through(at, a, b, bt).or_else(|| through(bt, b, a, at))
}

/// Point at which an edge of a triangle passes through another triangle, and the depth of the crossing (mm). Edges from
/// a shared corner are skipped, since they start on the other triangle.
fn through(corners: [DVec3; 3], indices: [u32; 3], other: [u32; 3], onto: [DVec3; 3]) -> Option<(DVec3, f64)> {
    let normal = (onto[1] - onto[0]).cross(onto[2] - onto[0]).try_normalize()?;
    let height = corners.map(|p| normal.dot(p - onto[0]));
    (0..3).find_map(|i| {
        let j = (i + 1) % 3;
        if other.contains(&indices[i]) || other.contains(&indices[j]) {
            return None;
        }
        let (low, high) = (height[i].min(height[j]), height[i].max(height[j]));
        if low > -RESOLUTION_MM || high < RESOLUTION_MM {
            return None;
        }
        let point = corners[i].lerp(corners[j], height[i] / (height[i] - height[j]));
        is_within(point, onto, normal).then_some((point, high.min(-low)))
    })
}

/// Whether a point in a triangle's plane is inside the triangle, and farther from its edges than the tracer's
/// resolution.
fn is_within(point: DVec3, corners: [DVec3; 3], normal: DVec3) -> bool {
    (0..3).all(|i| {
        let (from, to) = (corners[i], corners[(i + 1) % 3]);
        (to - from).try_normalize().is_some_and(|along| normal.cross(along).dot(point - from) > RESOLUTION_MM)
    })
}
